"""Events of the data sets N-MNIST and N-Caltech101, in files that end on ``.bin``.

A file has no header.  Each event has five bytes:

====== ==================================================
byte   content
====== ==================================================
0, 1   column, row
2      bit 7: polarity, 1 is ON; the rest: time, high bits
3, 4   time [us], big endian; 23 bits in all
====== ==================================================

A row of 240, which no sensor of these data sets has, is no event: times from there on are 8192 us
later.  Pictures of N-MNIST have 34x34 pixels, others what their events need.

References
----------
.. [1] G. Orchard et al., "Converting Static Image Datasets to Spiking Neuromorphic Datasets Using
   Saccades", Frontiers in Neuroscience 2015, doi:10.3389/fnins.2015.00437.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from adv2e.errors import DataError
from adv2e.formats.binary import blocks
from adv2e.formats.event_file import Columns, EventFile, Facts

_LATER, _LATER_US = 240, 1 << 13
_SIDE = 34  # pixels of N-MNIST
_BLOCK = 1 << 18  # events
_MOST_BACK = 0.1
"""Share of times before the last one from which on a file is something else."""


def open_nmnist(path: Path, facts: Facts) -> EventFile:
    """Open a file of these data sets; DataError if its times show that it is none."""

    def parts(told: Facts | None = facts) -> Iterator[Columns]:
        later = 0
        for data in blocks(path, 0, "(5,)u1", _BLOCK, told):
            x, y, high, middle, low = data.astype(np.int64).T
            is_later = y == _LATER
            turns = later + np.cumsum(is_later)
            later = int(turns[-1])
            t = ((high & 0x7F) << 16 | middle << 8 | low) + turns * _LATER_US
            yield tuple(column[~is_later] for column in (t, x, y, high >> 7))

    size = count = back = beyond = 0
    for t, x, y, _ in parts(None):
        count += t.size
        back += int(np.count_nonzero(np.diff(t) < 0))
        beyond += int(np.count_nonzero(y > _LATER))
        size = max(size, int(np.max([x, y], initial=-1)) + 1)
    if beyond or back > _MOST_BACK * count:
        raise DataError(
            f"{path}: no file of N-MNIST or N-Caltech101, which alone are read of this suffix: of"
            f" {count} events {beyond} are in rows from {_LATER} on, and {back} times go back"
        )
    if size <= _SIDE:
        facts.state((_SIDE, _SIDE), "N-MNIST")
    facts.stated_unit = "us"
    return EventFile("nmnist", facts, parts)
