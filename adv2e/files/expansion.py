"""Decompression bombs: limit of the growth of compressed data when they are read.

Deflate packs a thousand zeros into one byte, and HDF5 a whole dataset of them into none.  Data that
are read into memory at once must not grow so, whoever wrote the file; recordings and images are
compressed to a tenth, a picture of one colour to a hundredth.
"""

from __future__ import annotations

from typing import Any

from adv2e.errors import DataError

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
    data : bytes
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
