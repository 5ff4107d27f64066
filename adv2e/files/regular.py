"""Regular files: an input must end, which a pipe, a device or a socket may never do.

Text that people hand over by the shell, ``-c <(...)`` or ``--timestamps /dev/stdin``, comes through
descriptors that are open already; there somebody writes, and it is read to its end.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO, cast

from adv2e.errors import Adv2eError, DataError

_LONGEST = 64 << 20
"""Most text that is read from a descriptor [bytes]."""


def check_ends(path: Path, kind: type[Adv2eError] = DataError) -> None:
    """Raise unless `path` is a file or a folder, or is missing.

    Raises
    ------
    Adv2eError
        Of the `kind` given: a pipe, a device, a socket, or links that lead to each other.
    OSError
        The file system does not say.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise kind(f"{path}: is a pipe, a device or a socket, must be a file")


def read_text_bytes(path: Path, kind: type[Adv2eError] = DataError) -> bytes:
    """Return the bytes of a small text file, or of a descriptor that is open.

    Raises
    ------
    Adv2eError
        As :func:`check_ends`; or more than 64 MiB came.
    OSError
        It cannot be read.
    """
    if not _is_open_already(path):
        check_ends(path, kind)
        return path.read_bytes()
    with path.open("rb") as file:
        data = file.read(_LONGEST + 1)
    if len(data) > _LONGEST:
        raise kind(f"{path}: does not end within {_LONGEST >> 20} MiB")
    return data


def open_regular(path: Path, mode: str) -> BinaryIO | None:
    """Return a file, opened without buffer; None: the name is that of something else, or a link.

    For files of our own in folders that may come from elsewhere.  A pipe is not waited for.

    Raises
    ------
    OSError
        It cannot be opened.
    """
    extra = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    if path.is_symlink() or path.is_dir():
        return None
    opened = open(path, mode, 0, opener=lambda name, flags: os.open(name, flags | extra))  # noqa: SIM115
    file = cast(BinaryIO, opened)
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    return None


def _is_open_already(path: Path) -> bool:
    """Tell whether a path names a descriptor of this process, or nothing at all."""
    if str(path) in ("/dev/stdin", os.devnull):
        return True
    folder = os.path.realpath(path.parent)
    return folder == "/dev/fd" or (folder.startswith("/proc/") and folder.endswith("/fd"))
