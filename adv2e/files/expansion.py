"""Files that state more than they hold: how far what is packed may grow when it is read.

Deflate packs a thousand zeros into one byte, and HDF5 a whole dataset of them into none.  What is
read into memory at once must not grow so, whoever wrote the file; recordings and images are packed
to a tenth, a picture of one colour to a hundredth.
"""

from __future__ import annotations

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
