"""Standard error for ourselves: what libraries print about a file is not for users.

Decoders write there past Python, in lines that name no file and follow no setting; ours is the one
line that people see.  What they say is kept for a moment, as some say only there that a picture is
not whole.
"""

from __future__ import annotations

import faulthandler
import io
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, BinaryIO, cast

_descriptor = 2
_heard = -1


def errors_descriptor() -> int:
    return _descriptor


def keep_errors_for_ourselves() -> None:
    """Let Python alone write to standard error from now on, in this process.

    Nothing changes where there is no standard error, or where whoever looks for a fault wants to
    see all (``python -X faulthandler``, ``-X dev``).
    """
    global _descriptor, _heard
    if sys.stderr is None or faulthandler.is_enabled():
        return
    with suppress(OSError, ValueError):
        sys.stderr.flush()
        kept = os.dup(sys.stderr.fileno())
        heard = _nameless_file()
        os.dup2(heard, 2, inheritable=True)
        encoding = sys.stderr.encoding
        # nothing may stay in a buffer: where it cannot be written, the end would try again and fail
        unbuffered = open(kept, "wb", 0)  # noqa: PTH123, SIM115
        sys.stderr = io.TextIOWrapper(
            cast(BinaryIO, unbuffered), encoding, "backslashreplace", write_through=True
        )
        _descriptor, _heard = kept, heard


def _nameless_file() -> int:
    """Return a descriptor of a file that is gone when it is closed, or of none."""
    with suppress(OSError), tempfile.TemporaryFile(buffering=0) as file:
        return os.dup(file.fileno())
    return os.open(os.devnull, os.O_RDWR)


class Shared:
    """Context of a setting that is of the whole process: the last thread to leave puts it back.

    Parameters
    ----------
    begin : callable
        Changes the setting, and returns what it was.
    end : callable
        Is given what it was.
    """

    def __init__(self, begin: Callable[[], Any], end: Callable[[Any], object]) -> None:
        self._begin, self._end = begin, end
        self._lock = threading.Lock()
        self._inside = 0
        self._before: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._before = self._begin()
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._end(self._before)


@contextmanager
def overhearing() -> Iterator[Callable[[], bytes]]:
    """Within the context, have a function that returns what libraries have said in it.

    Nothing, where standard error is not kept for ourselves.
    """
    if _said_bytes():
        os.ftruncate(_heard, 0)
        os.lseek(_heard, 0, os.SEEK_SET)
    yield _said


def _said_bytes() -> int:
    """Return the number of bytes that libraries have written since the last reset."""
    if _heard >= 0:
        with suppress(OSError):  # it is no file
            return os.lseek(_heard, 0, os.SEEK_END)
    return 0


def _said() -> bytes:
    size = _said_bytes()
    if not size:
        return b""
    os.lseek(_heard, 0, os.SEEK_SET)
    return os.read(_heard, min(size, 1 << 16))
