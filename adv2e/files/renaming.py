"""Single steps by which finished files and folders get their names."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from contextlib import suppress
from pathlib import Path

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
