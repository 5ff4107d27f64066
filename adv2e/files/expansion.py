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
    """Refuse what states far more bytes than a file holds for it.

    Parameters
    ----------
    stated, held : int
        Bytes in memory, and in the file.
    label : str
        What it is, for messages.

    Raises
    ------
    DataError
        More than 64 MiB, and more than 200 times what is held.
    """
    if stated > FREE and stated > MOST * held:
        raise DataError(
            f"{label}: states {stated:,} bytes and holds {held:,}; what grows more than"
            f" {MOST}-fold is not read: damaged, or made to fill the memory"
        )
