"""Events of a file in the order of time, part by part, for what need not have all of them at once.

The file is read twice: first to see how large the sensor is and whether the events are in order,
then to pass them on.  Only events out of order are all kept in memory, to be sorted.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from adv2e.errors import DataError
from adv2e.events import Events, empty_events, is_sorted, sort_ties
from adv2e.formats.assembly import (
    Check,
    assemble,
    events_of_file,
    inside,
    left_out,
    needed_size,
    settled_size,
)
from adv2e.formats.event_file import EventFile


def events_in_order(file: EventFile) -> tuple[tuple[int, int], int, Generator[Events, None, None]]:
    """Return the size of the sensor, the time of the first event [us], and all events in order.

    The events come part by part, those on the sensor.  What is doubtful is added to the problems of
    the file, of the events themselves after the last part that is taken.

    Raises
    ------
    DataError
        There are no events, and no size is stated; or the file cannot be read.
    """
    seen = survey(file)
    if not seen.is_sorted:
        recording = assemble(file)
        held = [recording.events] if recording.events.size else []
        first_us = int(held[0]["t"][0]) if held else 0
        return (recording.width, recording.height), first_us, (part for part in held)
    size = settled_size(seen.needed, file.facts)
    if size == (0, 0):
        raise DataError(
            f"{file.facts.path}: no events, and no size of the sensor: state it with --size"
        )
    check = Check()

    def parts() -> Generator[Events, None, None]:
        outside = 0
        try:
            for events in in_order(events_of_file(file, check)):
                fitting = inside(events, size)
                outside += events.size - fitting.size
                if fitting.size:
                    yield fitting
        finally:
            file.facts.problems += check.problems()
            if outside:
                file.facts.problems.append(left_out(outside, size, file.facts.stated_by))

    return size, seen.first_us, parts()


@dataclass(frozen=True)
class Survey:
    """What one reading of all events told that must be known before they can be passed on.

    Attributes
    ----------
    needed : (int, int) or None
        Width and height that the largest coordinates need; None without events.
    first_us : int
        Time of the first event [us].
    is_sorted : bool
        Times never decrease.
    """

    needed: tuple[int, int] | None
    first_us: int
    is_sorted: bool


def survey(file: EventFile) -> Survey:
    """Read all events of a file once, and keep none."""
    check = Check()
    needed: tuple[int, int] | None = None
    first = last = None
    rising = True
    for columns in file.parts():
        events = check.events_of(columns)
        if not events.size:
            continue
        here, most = needed_size(events) or (0, 0), needed or (0, 0)
        needed = max(most[0], here[0]), max(most[1], here[1])
        first = events["t"][0] if first is None else first
        rising &= is_sorted(events) and (last is None or bool(last <= events["t"][0]))
        last = events["t"][-1]
    return Survey(needed, int(first or 0), rising)


def in_order(parts: Iterable[Events]) -> Iterator[Events]:
    """Yield events whose times never decrease, with those of one time in their order."""
    held = empty_events()
    for part in parts:
        events = np.concatenate([held, part]) if held.size else part
        # more of the last time may come
        cut = int(np.searchsorted(events["t"], events["t"][-1])) if events.size else 0
        done, held = events[:cut], events[cut:]
        if done.size:
            sort_ties(done)
            yield done
    if held.size:
        sort_ties(held)
        yield held
