"""Locks on files, which the system lets go of however a process ends."""

from __future__ import annotations

import errno
import sys
from contextlib import suppress
from typing import BinaryIO

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
