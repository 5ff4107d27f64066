"""A folder in which compiled code is kept between runs, by this user alone.

Whoever can write what is loaded as code runs as the user.  So a folder counts only if it is the
user's own and nobody else may write to it.  Each function has a folder there.  Damaged code may do
anything: a manifest holds the digest of every file, and what differs from it is removed before the
function is loaded.

Numba numbers the files of a function, so two processes that write at once could take the code of
one signature for that of another.  Whoever writes holds :meth:`CodeCache.lock`; it is not held
while a function is compiled, so nobody waits for long.  Whoever reads needs none: files are
replaced whole, and a number keeps its signature.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from adv2e.files.workspace import is_ours, lock_file, unlock_file

_UNUSED_S = 30 * 24 * 3600.0
_USE_NOTED_S = 24 * 3600.0
_ROOM_BYTES = 64 << 20  # the code of all kernels, for several kinds of frames
_MANIFEST, _LOCK, _USED = "manifest.json", "lock", "used"


class CodeCache:
    """A folder for compiled code.

    Parameters
    ----------
    name : str
        Of the folder, for the code of one state of the sources.

    Attributes
    ----------
    folder : Path or None
        None: there is none to be trusted or written to.
    why_not : str
        Why there is none.
    """

    def __init__(self, name: str) -> None:
        self.folder: Path | None = None
        self.why_not = ""
        self._file: BinaryIO | None = None
        self._holds = threading.RLock()
        self._depth = 0
        self._noted: dict[Path, tuple[int, int]] = {}
        self._checked: set[str] = set()
        for base in _bases():
            wrong = self._open(base / "adv2e", base / "adv2e" / name)
            if not wrong:
                self.folder, self.why_not = (base / "adv2e" / name).resolve(), ""
                _note_use(self.folder)
                break
            self.why_not = self.why_not or wrong

    def _open(self, base: Path, folder: Path) -> str:
        """Make the folder if need be; return why code is not to be kept in it, or nothing."""
        try:
            base.parent.mkdir(parents=True, exist_ok=True)
            for place in (base, folder):
                place.mkdir(mode=0o700, exist_ok=True)
                # of a link, who laid it, and what it leads to
                if not (is_ours(place.lstat()) and is_ours(place.stat())):
                    return f"{place} belongs to another user"
                if os.name == "posix" and place.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                    return f"others may write to {place} (chmod go-w would mend it)"
            tempfile.TemporaryFile(dir=folder).close()  # what is read-only says so
            if shutil.disk_usage(folder).free < _ROOM_BYTES:
                return f"{folder}: less than {_ROOM_BYTES >> 20} MiB are free"
            self._file = (folder / _LOCK).open("ab", buffering=0)
            weakref.finalize(self, self._file.close)
            if not lock_file(self._file, wait=True):
                return f"{folder}: its file system knows no locks"
        except OSError as error:
            return f"{base}: {error.strerror or error}"
        unlock_file(self._file)
        return ""

    def lock(self) -> None:
        """Wait until no other thread or process writes here."""
        self._holds.acquire()
        try:
            if self._file is not None and self._depth == 0:
                lock_file(self._file, wait=True)
        except BaseException:
            self._holds.release()
            raise
        self._depth += 1

    def unlock(self) -> None:
        """Let others write, once for each :meth:`lock`."""
        self._depth -= 1
        if self._file is not None and self._depth == 0:
            unlock_file(self._file)
        self._holds.release()

    def checked(self, name: str) -> Path | None:
        """Return the folder of one function, without files of code that differ from its manifest.

        None: there is none to be trusted.
        """
        if self.folder is None:
            return None
        folder = self.folder / name
        self.lock()
        try:
            listed = _listed(folder)
            for file, path in _code(folder).items():
                self._is_new(path)
                if listed.get(file) != _digest(path):
                    path.unlink()
            self._checked.add(name)
        except OSError:
            return None
        finally:
            self.unlock()
        return folder

    def note_files(self, name: str) -> None:
        """Add to a manifest what came or changed since this process looked, under the lock.

        Where it never looked, there may be files that nobody vouches for.
        """
        if self.folder is None or name not in self._checked:
            return
        folder = self.folder / name
        with suppress(OSError):  # what is not listed is compiled again
            listed = _listed(folder)
            there = _code(folder)
            digests = {file: listed[file] for file in there if file in listed}
            digests |= {file: _digest(path) for file, path in there.items() if self._is_new(path)}
            part = folder / f"{_MANIFEST}.part"
            part.write_text(json.dumps(digests, indent=0), encoding="utf-8")
            part.replace(folder / _MANIFEST)

    def _is_new(self, path: Path) -> bool:
        """Tell whether a file is not as it was when this process looked last, which is now."""
        status = path.stat()
        before, self._noted[path] = self._noted.get(path), (status.st_mtime_ns, status.st_ino)
        return before != self._noted[path]


def _bases() -> list[Path]:
    """Return the possible parents of the cache folder, the best first."""
    told = [os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME")]
    if sys.platform == "win32":
        told.append(os.environ.get("LOCALAPPDATA"))
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - Path.home() raises where there is none
    cache = home / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    return [*map(Path, filter(None, told)), cache]


def _code(folder: Path) -> dict[str, Path]:
    """Return each file of a function's code, by its name below `folder`; Numba makes one there."""
    return {
        path.relative_to(folder).as_posix(): path
        for path in folder.glob("*/**/*.nb[ci]")
        if path.is_file()
    }


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _listed(folder: Path) -> dict[str, Any]:
    """Return the manifest: the digest of each file of code."""
    with suppress(OSError, ValueError):
        listed = json.loads((folder / _MANIFEST).read_text(encoding="utf-8"))
        if isinstance(listed, dict):
            return listed
    return {}


def _note_use(folder: Path) -> None:
    """Note that the code in `folder` is in use; once a day, remove folders out of use."""
    now = time.time()
    with suppress(OSError):  # of no matter to whoever wants to compute
        noted = folder / _USED
        if noted.exists() and now - noted.stat().st_mtime < _USE_NOTED_S:
            return
        noted.touch()
        for other in folder.parent.glob("kernels-*"):
            last = max(path.stat().st_mtime for path in (other, *other.glob(_USED)))
            if now - last > _UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)
