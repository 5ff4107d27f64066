"""Where compiled code is kept between runs: in folders and files that only the user can have made.

Whoever can write what is loaded as code runs as the user.  So a folder counts only if it is the
user's own and nobody else may write to it, a file only if it is the user's own; and every file
begins with a digest of its name and content, as damaged code may do anything.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from adv2e.process import cleanup as unfinished

ROOM_BYTES = 16 << 20
"""What the code of one conversion takes, and more."""

_UNUSED_S = 30 * 24 * 3600.0
_USE_NOTED_S = 24 * 3600.0
_DIGEST = hashlib.sha256


@dataclass(frozen=True)
class Place:
    """A folder for compiled code, and why what lies in it is gone after this run, if it is."""

    folder: Path
    why_lost: str = ""

    @cached_property
    def why_full(self) -> str:
        """Why the code of a conversion cannot be written there; empty if it can."""
        try:
            with tempfile.TemporaryFile(dir=self.folder) as file:
                file.write(bytes(ROOM_BYTES))
                file.flush()
        except OSError as error:
            return f"{self.folder}: {error.strerror or error}"
        return ""


def place_for(name: str) -> Place:
    """Return a folder called `name` that is kept; where there can be none, a fresh private one."""
    refused = []
    for base in _bases():
        wrong = _unfit(base, base / name)
        if not wrong:
            folder = (base / name).resolve()
            note_use(folder)
            return Place(folder)
        refused.append(wrong)
    return Place(_fresh(name), refused[0])


def _bases() -> list[Path]:
    """Return where folders for compiled code may lie, the best first."""
    bases: list[Path] = []
    if os.environ.get("NUMBA_CACHE_DIR"):
        bases.append(Path(os.environ["NUMBA_CACHE_DIR"]) / "adv2e")
    if os.environ.get("XDG_CACHE_HOME"):
        bases.append(Path(os.environ["XDG_CACHE_HOME"]) / "adv2e")
    if sys.platform == "win32" and os.environ.get("LOCALAPPDATA"):
        bases.append(Path(os.environ["LOCALAPPDATA"]) / "adv2e" / "Cache")
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - Path.home() raises where there is none
    bases.append(home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "adv2e")
    return bases


def _unfit(base: Path, folder: Path) -> str:
    """Make the folder if need be; return why code is not to be kept in it, or nothing."""
    try:
        base.parent.mkdir(parents=True, exist_ok=True)
        for place in (base, folder):
            place.mkdir(mode=0o700, exist_ok=True)
            # of a link, who laid it, and what it leads to
            if not (_is_ours(place.lstat()) and _is_ours(place.stat())):
                return f"{place} belongs to another user"
            if os.name == "posix" and place.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                return f"others may write to {place} (chmod go-w would mend it)"
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return f"{base}: {error.strerror or error}"


def _is_ours(status: os.stat_result) -> bool:
    return os.name != "posix" or status.st_uid == os.geteuid()


@dataclass(frozen=True)
class _Fresh(unfinished.Unfinished):
    """A folder that goes when this process ends."""

    folder: Path

    def remove_now(self) -> bool:
        """Remove it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        return True


def _fresh(name: str) -> Path:
    """Return a new folder, which nobody knew before and which is removed at the end."""
    try:
        fresh = _Fresh(Path(tempfile.mkdtemp(prefix="adv2e-")))
    except OSError:
        return Path(os.devnull)  # nothing can be written below it
    unfinished.add(fresh)
    atexit.register(fresh.remove_now)
    folder = fresh.folder / "adv2e" / name  # as below NUMBA_CACHE_DIR
    with suppress(OSError):
        folder.parent.mkdir(mode=0o700)
        folder.mkdir(mode=0o700)
    return folder


def note_use(folder: Path) -> None:
    """Remember that the code in `folder` is in use; once a day, remove what nobody has used.

    A process that still runs with the code in a folder removed here has it in memory.
    """
    now = time.time()
    with suppress(OSError):  # of no matter to whoever wants to compute
        noted = folder / "used"
        if noted.exists() and now - noted.stat().st_mtime < _USE_NOTED_S:
            return
        noted.touch()
        for other in folder.parent.glob("kernels-*"):
            last = max(path.stat().st_mtime for path in (other, *other.glob("used")))
            if now - last > _UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


def read_kept(path: Path) -> bytes | None:
    """Return what :func:`write_kept` wrote; None where it did not, or not exactly this."""
    try:
        with path.open("rb") as file:
            if not _is_ours(os.fstat(file.fileno())):
                return None
            digest, data = file.read(_DIGEST().digest_size), file.read()
    except OSError:
        return None
    return data if digest == _digest(path, data) else None


def write_kept(path: Path, data: bytes) -> None:
    """Keep `data` in a file, if that is possible; other processes see all of it or nothing."""
    part = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}")
    with suppress(OSError):
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            part.write_bytes(_digest(path, data) + data)
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink()


def _digest(path: Path, data: bytes) -> bytes:
    digest = _DIGEST(path.name.encode() + b"\0")
    digest.update(data)
    return digest.digest()
