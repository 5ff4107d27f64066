"""Input files: regular ones alone, as an input must end; growth of compressed ones; names shown.

Text that people hand over by the shell, ``-c <(...)`` or ``--timestamps /dev/stdin``, comes through
descriptors that are open already; there somebody writes, and it is read to its end.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

from adv2e.errors import Adv2eError, DataError

_LONGEST = 64 << 20
"""Most text that is read from a descriptor [bytes]."""


@contextmanager
def reading(name: str | Path, kind: type[Adv2eError] = DataError) -> Iterator[None]:
    """Turn an OSError in the body into an error of that kind with the name."""
    try:
        yield
    except OSError as error:
        raise kind(f"{name}: {error.strerror or error}") from error


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


def read_text(path: Path, kind: type[Adv2eError] = DataError) -> str:
    """Return the UTF-8 text in a file; an error of that kind if it cannot be read as such."""
    try:
        return read_text_bytes(path, kind).decode("utf-8-sig")
    except OSError as error:
        raise kind(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise kind(f"{path}: byte {error.start} is not UTF-8 text") from None


def open_regular(path: Path) -> BinaryIO | None:
    """Return a file, opened to be changed, without buffer; None: it is none, or a link.

    For files of our own in folders that may come from elsewhere.  A pipe is not waited for.

    Raises
    ------
    OSError
        It cannot be opened.
    """
    extra = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    if path.is_symlink() or path.is_dir():
        return None
    opened = open(path, "r+b", 0, opener=lambda name, flags: os.open(name, flags | extra))  # noqa: SIM115
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


# ---- Decompression bombs: limit of the growth of compressed data when they are read.
#
# Deflate packs a thousand zeros into one byte, and HDF5 a whole dataset of them into none. Data
# that are read into memory at once must not grow so, whoever wrote the file; recordings and images
# are compressed to a tenth, a picture of one colour to a hundredth.


FREE = 64 << 20
"""Uncompressed size up to which any growth is allowed [bytes]."""

MOST = 200
"""Largest growth: uncompressed bytes for one byte of a file."""


def check_expansion(stated: int, held: int, label: str) -> None:
    """Raise DataError if the stated size exceeds both 64 MiB and 200 times the bytes held."""
    if stated > FREE and stated > MOST * held:
        raise DataError(
            f"{label}: states {stated:,} bytes and holds {held:,}; what grows more than"
            f" {MOST}-fold is not read: damaged, or made to fill the memory"
        )


def expand(reader: Any, data: bytes, label: str, errors: tuple[type[Exception], ...]) -> bytes:
    """Return the uncompressed data, if they grow no further than is allowed.

    Parameters
    ----------
    reader : decompressor
        As those of :mod:`bz2` are, not used yet.
    label : str
        Name of the data, for messages.
    errors : tuple of exceptions
        Exceptions of the reader for damaged data.

    Raises
    ------
    DataError
        The data are damaged, cut short, or grow more than 200-fold beyond 64 MiB.
    """
    most = max(FREE, MOST * len(data))
    try:
        plain: bytes = reader.decompress(data, max_length=most)
    except errors as failed:
        raise DataError(f"{label}: cannot be uncompressed: {failed}") from failed
    if not reader.eof:
        how = f"grows more than {MOST}-fold" if len(plain) >= most else "is cut short"
        raise DataError(f"{label}: cannot be uncompressed: it {how}")
    return plain


# ---- Names of files as they are shown and stored: any name that a file system allows, on one
# line.
#
# A name may hold bytes that are not UTF-8, which Python keeps as lone surrogates, and control
# characters, line breaks among them. Neither can be printed or stored as they are: many readers
# refuse the first, and terminals obey the second. A file is always opened by its name as it is;
# what people or other programs are to read goes through :func:`shown`.


_UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


def shown(name: str | Path) -> str:
    r"""Return a name, or a line that holds names, with escapes for what cannot be shown.

    A byte that is not UTF-8 reads ``\xff``, a line break ``\n``.

    >>> shown("two\nlines")
    'two\\nlines'
    """
    return _UNFIT.sub(_escape, str(name))


def beside(path: Path, ending: str) -> Path:
    """Return the path beside a file or folder with its name and an ending, also of ``.``."""
    whole = path if path.name.strip(".") else path.resolve()
    return whole.parent / f"{whole.name}{ending}"


def _escape(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # a byte that Python could not decode
        code -= 0xDC00
        return f"\\x{code:02x}"
    return found[0].encode("unicode_escape").decode("ascii")
