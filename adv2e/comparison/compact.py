"""Two streams on a sensor too large for grids of it: rows and columns without events go.

The distances look at a pixel and at its neighbours, so that of columns without events between two
with some only two have to stay: what smoothing spills over from either side then falls on the same
pixels as before.  All numbers are those of the whole sensor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events

ENOUGH = 1 << 21
"""Pixels up to which the sensor is taken as it is."""

MOST = 1 << 23
"""Pixels of the grids; each takes some 400 bytes."""

_APART = 3
"""Columns that are farther from each other do not meet."""


def compact(streams: list[Events], width: int, height: int) -> tuple[list[Events], int, int]:
    """Return the streams and the size of a sensor that gives the same distances.

    Raises
    ------
    DataError
        Too many pixels are left.
    """
    if width * height <= ENOUGH:
        return streams, width, height
    columns, kept_width = _places([events["x"] for events in streams], width)
    rows, kept_height = _places([events["y"] for events in streams], height)
    if kept_width * kept_height > MOST:
        raise DataError(
            f"events of {kept_width} columns and {kept_height} rows are too many to compare;"
            f" {MOST:,} pixels are the most: crop the streams"
        )
    moved = [events.copy() for events in streams]
    for events in moved:
        events["x"], events["y"] = columns[events["x"]], rows[events["y"]]
    return moved, kept_width, kept_height


def _places(used: list[NDArray[Any]], size: int) -> tuple[NDArray[np.int64], int]:
    """Return the new place of each coordinate, (size,), and how many there are."""
    there = np.zeros(size, np.bool_)
    for coordinates in used:
        there[coordinates] = True
    at = np.flatnonzero(there)
    places = np.zeros(size, np.int64)
    if not at.size:
        return places, 1
    # an edge of the sensor is kept where it is near, as nothing is smoothed beyond it
    first = min(int(at[0]), 1)
    places[at] = first + np.cumsum(np.r_[0, np.minimum(np.diff(at), _APART)])
    return places, int(places[at[-1]]) + 1 + min(size - 1 - int(at[-1]), 1)
