"""Files that state more than they hold: how far what is packed may grow when it is read.

Deflate packs a thousand zeros into one byte, and HDF5 a whole dataset of them into none.  What is
read into memory at once must not grow so, whoever wrote the file; recordings and images are packed
to a tenth, a picture of one colour to a hundredth.
"""

from __future__ import annotations

from typing import Any

from adv2e.errors import DataError

FREE = 64 << 20
"""Whatever is this small may be of any making [bytes]."""

MOST = 200
"""Bytes that one byte of a file may stand for."""


def check_expansion(stated: int, held: int, label: str) -> None:
    """Raise DataError if something states more than 64 MiB and 200 times the bytes it holds."""
    if stated > FREE and stated > MOST * held:
        raise DataError(
            f"{label}: states {stated:,} bytes and holds {held:,}; what grows more than"
            f" {MOST}-fold is not read: damaged, or made to fill the memory"
        )


def expand(reader: Any, data: bytes, label: str, errors: tuple[type[Exception], ...]) -> bytes:
    """Return what packed data stand for, if that is no more than they can well be.

    Parameters
    ----------
    reader : decompressor
        As those of :mod:`bz2` are, not used yet.
    data : bytes
    label : str
        What they are called, for messages.
    errors : tuple of exceptions
        What the reader raises.

    Raises
    ------
    DataError
        They are damaged, cut short, or grow more than 200-fold beyond 64 MiB.
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
