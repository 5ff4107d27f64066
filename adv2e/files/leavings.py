"""What a run that was killed left in a folder, and how a later one knows that nobody needs it.

A run lays a file beside what it writes, which names it all, and holds a lock on that file for as
long as it lives; the system lets go of the lock, however the run ends.  So a file of this kind
that can be locked tells of a dead run.  Where files cannot be locked none is laid, and what a run
on another machine laid is left alone: a file system may not know of locks elsewhere.

If the run was killed while its files came into place, that is brought to its end, or undone.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_SUFFIX = ".part.lock"
_PART = re.compile(r"\.[\w.-]+\.[0-9a-f]{8}\.part[\w.-]*")
_FAR = 1 << 30  # a byte beyond the content: what is locked on Windows cannot be read
_PLACING = b"placing\n"


@dataclass(frozen=True)
class Names:
    """Of one file or folder to be, all in one folder.

    Attributes
    ----------
    temporary : str
        While it is written.
    aside : str
        Of what it replaces, meanwhile.
    final : str
    waits_for : str, optional
        Temporary name of what it tells about: it comes into place after that has.  Empty: that is
        in another folder.
    """

    temporary: str
    aside: str
    final: str
    waits_for: str | None = None


class Claim:
    """Says, as long as this process lives, that files in a folder are its own.

    Parameters
    ----------
    folder : Path
    names : iterable of Names
    """

    def __init__(self, folder: Path, names: Iterable[Names]) -> None:
        self._path = folder / f".adv2e.{secrets.token_hex(4)}{_SUFFIX}"
        told = {**_machine(), "outputs": [asdict(one) for one in names]}
        self._file: int | None = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        try:
            _lock(self._file, wait=True)
            os.write(self._file, json.dumps(told).encode() + b"\n")
        except OSError:  # no locks here: then nothing must look like a dead run
            self.drop()

    def note_placing(self) -> None:
        """Note that all is written and comes into place from now on."""
        if self._file is not None:
            os.write(self._file, _PLACING)
            os.fsync(self._file)

    def drop(self) -> None:
        """Say so no longer."""
        if self._file is None:
            return
        # an open file cannot be removed on Windows, and one that is not open looks like a dead
        # run's; by then nothing is left of this one
        if os.name == "nt":
            os.close(self._file)
        with suppress(OSError):
            self._path.unlink()
        if os.name != "nt":
            os.close(self._file)
        self._file = None


def clear(folder: Path) -> None:
    """Remove what dead runs left in a folder; finish or undo what came into place."""
    with suppress(OSError):
        found = [entry.path for entry in os.scandir(folder) if entry.name.endswith(_SUFFIX)]
        for path in found:
            with suppress(OSError, ValueError, KeyError, TypeError):
                _clear_after(Path(path))


def _clear_after(path: Path) -> None:
    """Remove what the run left that laid `path`, if it is dead and was one of ours."""
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
    with os.fdopen(os.open(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if os.name == "posix" and status.st_uid != os.geteuid():
            return
        _lock(file.fileno(), wait=False)
        if not os.path.samestat(status, path.stat()):
            return  # it was removed meanwhile
        first, _, rest = file.read().partition(b"\n")
        told = json.loads(first)
        here = _machine()
        if not any(told[key] == here[key] != "" for key in here):
            return
        outputs = [Names(**one) for one in told["outputs"]]
        plain = all(Path(one.final).name == one.final for one in outputs)
        if not plain or not all(map(_PART.fullmatch, _hidden(outputs))):
            return
        if rest == _PLACING:
            _settle(path.parent, outputs)
        for name in _hidden(outputs):
            remove(path.parent / name)
        if os.name != "nt":
            path.unlink()
    if os.name == "nt":
        path.unlink()


def _hidden(outputs: list[Names]) -> list[str]:
    return [name for one in outputs for name in (one.temporary, one.aside)]


def _settle(folder: Path, outputs: list[Names]) -> None:
    """Bring back what was moved aside; but bring into place what tells about what is in place."""
    placed = {one.temporary for one in outputs if _is_placed(folder, one)}
    for one in outputs:
        if one.waits_for == "":
            continue  # what it would tell about cannot be known
        wanted = folder / (one.temporary if one.waits_for in placed else one.aside)
        if os.path.lexists(wanted) and not os.path.lexists(folder / one.final):
            wanted.rename(folder / one.final)


def _is_placed(folder: Path, one: Names) -> bool:
    temporary, final = folder / one.temporary, folder / one.final
    if not os.path.lexists(temporary):
        return True
    return os.path.lexists(final) and temporary.samefile(final)  # both names, for an instant


def _machine() -> dict[str, str]:
    """Return what tells machines apart: the name, and what the system drew when it started."""
    name = os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
    start = ""
    with suppress(OSError):
        start = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    return {"machine": name, "start": start}


def _lock(descriptor: int, *, wait: bool) -> None:
    """Lock a file; raise OSError if that cannot be, or without `wait`, if another one has."""
    if sys.platform == "win32":
        os.lseek(descriptor, _FAR, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
        os.lseek(descriptor, 0, os.SEEK_SET)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))


def remove(path: Path) -> None:
    """Remove a file or a folder, if that is possible."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)
