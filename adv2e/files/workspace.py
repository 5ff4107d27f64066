"""Hidden folders in which outputs are written, and removal of those that killed runs left.

A run holds a lock on a file in its folder for as long as it lives; the system lets go of the lock,
however the run ends.  So a folder whose file can be locked is abandoned, and the next run beside it
removes it.  Where files cannot be locked none looks abandoned, and the folder of a run on another
machine is left alone: a file system may not know of locks elsewhere.

Such a folder may also come from elsewhere, in an archive, made by anybody.  So nothing in it says
what to do: no name is read from it, nothing is moved out of it, and it goes only if it holds
nothing but what runs write there, with its links and never through them.  Any other stays, and a
warning names it.
"""

from __future__ import annotations

import ctypes
import errno
import os
import re
import secrets
import shutil
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from adv2e.errors import Adv2eWarning
from adv2e.files.regular import open_regular, shown

# ---- Single steps by which finished files and folders get their names.


_HERE, _EXCHANGE = -100, 2  # AT_FDCWD; RENAME_EXCHANGE of Linux and RENAME_SWAP of macOS
_CANNOT_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)


def move_to_free(path: Path, name: Path) -> None:
    """Give a file or folder a name that nothing has.

    Where a file system knows no hard links, as FAT, a file that appears at this very moment is
    replaced all the same.

    Raises
    ------
    FileExistsError
        Something has that name.
    """
    if os.path.lexists(name):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(name))
    if os.name == "nt" or path.is_dir():  # a rename replaces nothing, but for an empty folder
        path.rename(name)
        return
    try:
        os.link(path, name)
    except FileExistsError:
        raise
    except OSError:
        path.rename(name)
    else:
        path.unlink()


def exchange(one: Path, other: Path) -> bool:
    """Exchange two names in one step; return False where the system does not do that."""
    names = os.fsencode(one), os.fsencode(other)
    with suppress(OSError, AttributeError, TypeError):  # TypeError: Windows
        system = ctypes.CDLL(None)
        if sys.platform == "darwin":
            return bool(system.renamex_np(*names, _EXCHANGE) == 0)
        return bool(system.renameat2(_HERE, names[0], _HERE, names[1], _EXCHANGE) == 0)
    return False


def sync(path: Path) -> None:
    """Have the disk hold a file, or a folder and all in it, whatever happens to the machine.

    Raises
    ------
    OSError
        Something of it could not be written.
    """
    if path.is_dir():
        for entry in path.iterdir():
            sync(entry)
    sync_one(path)


def sync_one(path: Path) -> None:
    """Have the disk hold a file, or the names in a folder."""
    if os.name == "nt" and path.is_dir():
        return
    descriptor = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise
    finally:
        os.close(descriptor)


_NAME = re.compile(r"\.adv2e\.[0-9a-f]{8}\.part-?")
_LOCK, _OLD = "lock", "old"
_WRITTEN = re.compile(r"lock|new[0-9]+[A-Za-z0-9._-]*", re.ASCII)
_LONGEST = 1 << 10
"""Most bytes that are read from a lock file."""


class Workspace:
    """A hidden folder beside outputs, which other runs leave alone as long as this one lives.

    Parameters
    ----------
    folder : Path
        Folder of the outputs.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / f".adv2e.{secrets.token_hex(4)}.part"
        self._lock: BinaryIO | None = None

    @property
    def is_made(self) -> bool:
        return self._lock is not None

    def written(self, name: str) -> Path:
        """Return the path at which an output is written; `name` begins with its number."""
        return self.path / f"new{name}"

    def aside(self, name: str) -> Path:
        """Return the path of the old file of the final name `name` during its replacement."""
        return self.path / _OLD / name

    def make(self) -> None:
        lock = self.path / _LOCK
        while not lock.exists():  # again if, not locked yet, it looked abandoned to another run
            self.remove()
            self.path.mkdir(0o700, exist_ok=True)
            with suppress(FileNotFoundError):
                self._lock = lock.open("xb", buffering=0)
                self._lock.write(
                    _machine() if lock_file(self._lock, wait=True) else b"no locks here"
                )

    def put_aside(self, final: Path, *, linked: bool = False) -> None:
        """Move the old file of a final name into the folder; `linked`: it may keep its name."""
        aside = self.aside(final.name)
        aside.parent.mkdir(exist_ok=True)
        if linked:
            with suppress(OSError):  # it is a folder, or there are no hard links
                os.link(final, aside)
                return
        final.rename(aside)

    def put_back(self, final: Path) -> None:
        """Give the old file its final name again, if that is free."""
        aside = self.aside(final.name)
        with suppress(OSError):
            if not os.path.lexists(final):
                aside.rename(final)
            elif aside.samefile(final):
                aside.unlink()

    def drop_aside(self) -> None:
        """Remove the old files: their replacements have their names."""
        shutil.rmtree(self.path / _OLD, ignore_errors=True)

    def hide(self) -> None:
        """Rename the folder, so that writers that know it by name do not reach it any longer."""
        hidden = self.path.with_name(self.path.name + "-")
        self.path.rename(hidden)
        self.path = hidden

    def remove(self) -> None:
        """Remove the folder and all in it, but for old files that could not be put back."""
        if self._lock is not None:
            with suppress(OSError):  # it is empty, or not there
                (self.path / _OLD).rmdir()
            if not (self.path / _OLD).exists():
                _remove(self.path, self._lock)
            self._lock.close()
            self._lock = None


def remove_abandoned(folder: Path) -> None:
    """Remove the workspaces of dead runs in a folder; warn of those with foreign content."""
    with suppress(OSError):
        found = [entry for entry in os.scandir(folder) if _NAME.fullmatch(entry.name)]
        for entry in found:
            with suppress(OSError):
                if entry.is_dir(follow_symlinks=False) and is_ours(
                    entry.stat(follow_symlinks=False)
                ):
                    strange = _remove_if_abandoned(Path(entry.path))
                    if strange:
                        warnings.warn(
                            f"{shown(entry.path)}: left alone, as it {strange}",
                            Adv2eWarning,
                            stacklevel=2,
                        )


def _remove_if_abandoned(path: Path) -> str:
    """Return the reason for which a folder that looks abandoned is left alone, or ''."""
    file = path / _LOCK
    if not os.path.lexists(file):
        path.rmdir()  # if it is empty: the run was killed before it could lock it
        return ""
    lock = open_regular(file)
    if lock is None:
        return f"holds a {_LOCK} that is no file: no run made it; remove it if nobody needs it"
    with lock:
        if not (
            _may_be_dead(lock.read(_LONGEST))
            and lock_file(lock, wait=False)
            and os.path.samestat(os.fstat(lock.fileno()), file.lstat())
        ):
            return ""
        with suppress(OSError):  # nothing lies aside
            (path / _OLD).rmdir()
        with os.scandir(path) as entries:
            strange = next((one.name for one in entries if not _WRITTEN.fullmatch(one.name)), "")
        if strange == _OLD:
            return (
                f"holds, in {_OLD}, what a run was replacing when it was killed: take it from"
                " there, and remove the folder"
            )
        if strange:
            return f"holds {shown(strange)}, which no run writes: remove it if nobody needs it"
        try:
            _remove(path, lock)
        except RecursionError:
            return "holds too many folders in one another: remove it if nobody needs it"
    return ""


def _remove(path: Path, lock: BinaryIO) -> None:
    """Remove a folder, its lock last."""
    with suppress(OSError):
        for entry in list(os.scandir(path)):
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            elif entry.name != _LOCK:
                Path(entry.path).unlink()
        shutil.rmtree(path, ignore_errors=True)
        lock.close()
        shutil.rmtree(path, ignore_errors=True)  # Windows removes no open file


def is_ours(status: os.stat_result) -> bool:
    """Tell whether a file or folder of this status belongs to this user."""
    return os.name != "posix" or status.st_uid == os.geteuid()


def _may_be_dead(told: bytes) -> bool:
    """Tell whether a free lock means that its run is dead: if it was on this machine."""
    pairs = zip(told.split(b"\n"), _machine().split(b"\n"), strict=False)
    return not told or any(there == here != b"" for there, here in pairs)


def _machine() -> bytes:
    """Return an identifier of the machine: its name, and the random ID of its last boot."""
    name = os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
    start = b""
    with suppress(OSError):
        start = Path("/proc/sys/kernel/random/boot_id").read_bytes().strip()
    return os.fsencode(name) + b"\n" + start


# ---- Locks on files, which the system lets go of however a process ends.


if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_FAR = 1 << 30  # a byte beyond the content: what is locked on Windows cannot be read


def lock_file(file: BinaryIO, *, wait: bool) -> bool:
    """Lock a file; return False if that cannot be, or without `wait`, if another one has."""
    try:
        if sys.platform == "win32":
            file.seek(_FAR)
            msvcrt.locking(file.fileno(), msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
            file.seek(0)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError as error:
        if wait and error.errno == errno.EDEADLK:  # Windows waits for ten seconds only
            return lock_file(file, wait=True)
        return False
    return True


def unlock_file(file: BinaryIO) -> None:
    """Unlock a file that :func:`lock_file` locked."""
    with suppress(OSError):
        if sys.platform == "win32":
            file.seek(_FAR)
            msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)
            file.seek(0)
        else:
            fcntl.flock(file, fcntl.LOCK_UN)
