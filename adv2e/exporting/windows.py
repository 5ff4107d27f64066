"""Streams of events, cut into the windows of which networks are given a picture each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count, pairwise

import numpy as np

from adv2e.errors import DataError
from adv2e.events import Events, Window, cut, empty_events


@dataclass(frozen=True)
class Slice:
    """The events of a window.

    Attributes
    ----------
    start_us, stop_us : int
        First and last time of the window [us].
    events : array of EVENT_DTYPE
        Sorted.
    """

    start_us: int
    stop_us: int
    events: Events


MOST_EMPTY = 1000
"""Windows in a row without an event, unless more are asked for."""


def by_time(
    parts: Iterable[Events],
    first_us: int,
    length_us: int,
    label: str = "events",
    most_empty: int = MOST_EMPTY,
) -> Iterator[Slice]:
    """Yield windows of one length, [start, start + length), from `first_us` on.

    What is left at the end and is shorter than a window is left out.

    Raises
    ------
    DataError
        More than `most_empty` in a row have no event, as a wrong time makes them.
    """
    windows = ((start, start + length_us) for start in count(first_us, length_us))
    empty = 0
    for one in _between(parts, windows, to_the_end=False):
        empty = 0 if one.events.size else empty + 1
        if empty > most_empty:
            raise DataError(
                f"{label}: no event in over {most_empty:,} windows of {length_us / 1000:g} ms, to"
                f" {one.stop_us * 1e-6:.3f} s: 'adv2e info' tells gaps that a wrong time makes; a"
                " longer --window makes fewer, --max-empty N allows N"
            )
        yield one


def by_count(parts: Iterable[Events], number: int) -> Iterator[Slice]:
    """Yield windows of so many events each; fewer at the end are left out."""
    held = empty_events()
    for part in parts:
        held = _joined(held, part)
        while held.size >= number:
            taken, held = held[:number], held[number:]
            yield Slice(int(taken["t"][0]), int(taken["t"][-1]), taken)


def between_images(parts: Iterable[Events], times_us: list[int]) -> Iterator[Slice]:
    """Yield the windows from each image to the next, [image, next image)."""
    return _between(parts, pairwise(times_us), to_the_end=True)


def before_images(parts: Iterable[Events], times_us: list[int], length_us: int) -> Iterator[Slice]:
    """Yield the windows before each image, [image - length, image)."""
    return _between(parts, ((t - length_us, t) for t in times_us), to_the_end=True)


def _joined(held: Events, part: Events) -> Events:
    """Return both, of which the second may have a column more than an empty first."""
    return np.concatenate([held, part]) if held.size else part


def _between(
    parts: Iterable[Events], windows: Iterable[Window], *, to_the_end: bool
) -> Iterator[Slice]:
    """Yield the events of windows whose starts never decrease.

    Parameters
    ----------
    parts : iterable of arrays
        Sorted, and so are the events of all of them.
    windows : iterable of (int, int)
    to_the_end : bool
        Windows after the last event are wanted, too; else those that end at the last event or
        before it.
    """
    source = iter(parts)
    held = empty_events()
    ended = False
    for start, stop in windows:
        while not ended and not (held.size and held["t"][-1] >= stop):
            part = next(source, None)
            ended = part is None
            held = cut(held, start, held["t"][-1] + 1) if held.size else held
            held = held if part is None else _joined(held, part)
        if ended and not to_the_end and not (held.size and held["t"][-1] >= stop):
            return
        yield Slice(start, stop, cut(held, start, stop))
