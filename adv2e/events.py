"""Events: the one record type, its order, and what must hold of it.

An event is ``(t, x, y, p)``: time in integer microseconds, column, row (origin top left) and
polarity, 1 for ON and 0 for OFF.  A stream is sorted by time.  Events of one time that were read
keep the order of the file; of those that are made here, pixels come by row and column, so that the
order does not depend on how the work was divided, and those of one pixel as they happened.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError

EVENT_DTYPE = np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
"""The record type of every event array in the package."""

Events = NDArray[Any]
"""A structured array of ``EVENT_DTYPE``, or with one more field (:mod:`adv2e.causes`)."""

Window = tuple[int, int]
"""Start and stop [us], half open."""


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


def checked_events(
    events: Any, width: int, height: int, dtype: np.dtype[Any] = EVENT_DTYPE
) -> Events:
    """Return events that somebody made as a sorted array of ``EVENT_DTYPE``.

    Parameters
    ----------
    events : structured array, (n,)
        With the fields t [us], x, y, p of whole numbers, in any order of time.
    width, height : int
        Size of the sensor [pixels].
    dtype : dtype
        Another record type to return, whose fields `events` has.

    Raises
    ------
    DataError
        The array has other fields, or an event lies outside the sensor; the text names the first.
    """
    events = with_fields(events)
    for name, most in (("x", width), ("y", height)):
        outside = np.flatnonzero((events[name] < 0) | (events[name] >= most))
        if outside.size:
            number = int(outside[0])
            raise DataError(
                f"events: number {number} has {name} {events[name][number]}, outside a sensor of"
                f" {width}x{height} pixels"
            )
    if events.dtype != dtype:
        ours = np.empty(events.size, dtype)
        for name in dtype.names or ():
            ours[name] = events[name] > 0 if name == "p" else events[name]
        events = ours
    return by_time(events)


def with_fields(made: Any) -> Events:
    """Return events that somebody made as a structured array; DataError if it has other fields."""
    events: Events = np.asarray(made)
    held = events.dtype.names or ()
    if events.ndim != 1 or not {"t", "x", "y", "p"} <= set(held):
        raise DataError(
            f"events: must be a structured array, (n,), with the fields t, x, y, p, got"
            f" {events.dtype} {events.shape}"
        )
    for name in ("t", "x", "y"):
        if events[name].dtype.kind not in "iu":
            raise DataError(
                f"events: {name} must be whole numbers, t in microseconds, got {events[name].dtype}"
            )
    return events


def pixels_of(events: Events, columns: int) -> NDArray[np.int64]:
    """Return the pixel of each event, counted along rows of so many columns, (events,)."""
    pixels: NDArray[np.int64] = events["y"].astype(np.int64) * columns + events["x"]
    return pixels


def cut(events: Events, start: int, stop: int) -> Events:
    """Return the part of the sorted `events` with start <= t < stop [us], as a view."""
    times = events["t"]
    # of a field, np.searchsorted copies all times first
    return events[bisect_left(times, start) : bisect_left(times, stop)]


def sort_events(events: Events) -> Events:
    """Return the events sorted by time, ties by row and column, those of a pixel as they were."""
    return events[np.lexsort([events[name] for name in ("x", "y", "t")])]


def is_sorted(events: Events) -> bool:
    """Tell whether times never decrease."""
    return bool(np.all(events["t"][1:] >= events["t"][:-1]))


def by_time(events: Events) -> Events:
    """Return the events sorted by time, those of one time as they were."""
    return events if is_sorted(events) else events[np.argsort(events["t"], kind="stable")]


def repeated(events: Events) -> int:
    """Return the number of events, sorted by time, that repeat another one."""
    t = events["t"]
    tied = np.zeros(events.size, np.bool_)
    np.equal(t[1:], t[:-1], out=tied[1:])
    tied[:-1] |= tied[1:]
    y, x, p = (events[name][tied].astype(np.int64) for name in "yxp")
    t, place = t[tied], (y << 17) | (x << 1) | p
    if np.any((t[1:] == t[:-1]) & (place[1:] < place[:-1])):
        order = np.lexsort([place, t])
        t, place = t[order], place[order]
    return int(np.count_nonzero((t[1:] == t[:-1]) & (place[1:] == place[:-1])))
