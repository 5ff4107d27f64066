"""Events: the one record type, its order, and what must hold of it.

An event is ``(t, x, y, p)``: time in integer microseconds, column, row (origin top left) and
polarity, 1 for ON and 0 for OFF.  A stream is sorted by time; ties are ordered by (y, x, p), so
that the order of a file does not depend on how the work was divided.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

EVENT_DTYPE = np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
"""The record type of every event array in the package."""

Events = NDArray[Any]
"""A structured array of ``EVENT_DTYPE``."""


def empty_events(count: int = 0) -> Events:
    """Return an event array of `count` zeroed events."""
    return np.zeros(count, dtype=EVENT_DTYPE)


def make_events(t: Any, x: Any, y: Any, p: Any) -> Events:
    """Return an event array from four columns, in the order given.

    Parameters
    ----------
    t, x, y, p : array_like, (events,)
        Time [us], column, row, polarity (anything above 0 is ON).
    """
    t = np.asarray(t)
    events = np.empty(t.shape[0], dtype=EVENT_DTYPE)
    events["t"], events["x"], events["y"] = t, x, y
    events["p"] = np.asarray(p) > 0
    return events


def pixels_of(events: Events, columns: int) -> NDArray[np.int64]:
    """Return the pixel of each event, counted along rows of so many columns, (events,)."""
    pixels: NDArray[np.int64] = events["y"].astype(np.int64) * columns + events["x"]
    return pixels


def sort_events(events: Events) -> Events:
    """Return the events sorted by time, ties by (y, x, p)."""
    order = np.lexsort((events["p"], events["x"], events["y"], events["t"]))
    return events[order]


def is_sorted(events: Events) -> bool:
    """Tell whether times never decrease."""
    return bool(np.all(events["t"][1:] >= events["t"][:-1]))
