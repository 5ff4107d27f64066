"""From columns as a file holds them to a sorted event array, with a list of what was wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSED_DTYPE
from adv2e.errors import DataError
from adv2e.events import (
    EVENT_DTYPE,
    Events,
    disorder,
    sort_events,
    sort_ties,
)
from adv2e.formats.causes import check_numbers
from adv2e.formats.event_file import Column, Columns, EventFile, Facts
from adv2e.formats.recording import Recording
from adv2e.sources.times.instants import seconds
from adv2e.sources.times.units import SETTLED

_LARGEST = np.iinfo(np.uint16).max

_FEW = 100
"""So few events may well lie in a small part of the recording."""
_APART = 300
"""Events and frames that differ in length by this factor are in doubt."""


class Check:
    """Makes event arrays of columns, part by part, and counts what does not fit."""

    def __init__(self) -> None:
        self._unstorable = 0
        self._values: set[int] = set()
        self._odd_polarities = 0

    def events_of(self, columns: Columns, causes: Column | None = None) -> Events:
        """Return the events of a part in their order, without those that no sensor can have."""
        t, x, y, p = columns
        self._note_polarities(p)
        fits = (x >= 0) & (x <= _LARGEST) & (y >= 0) & (y <= _LARGEST)
        count = int(np.count_nonzero(fits))
        if count < fits.size:
            self._unstorable += fits.size - count
            t, x, y, p = t[fits], x[fits], y[fits], p[fits]
            causes = None if causes is None else causes[fits]
        part = np.empty(count, EVENT_DTYPE if causes is None else CAUSED_DTYPE)
        part["t"], part["x"], part["y"], part["p"] = t, x, y, p > 0
        if causes is not None:
            part["cause"] = causes
        return part

    def _note_polarities(self, p: Column) -> None:
        usual = 0
        for value in (-1, 0, 1):
            found = int(np.count_nonzero(p == value))
            usual += found
            if found:
                self._values.add(value)
        self._odd_polarities += p.size - usual

    def problems(self) -> list[str]:
        """Return what is to be told of all parts until now."""
        told = []
        if self._unstorable:
            told.append(
                f"{self._unstorable} events with a coordinate below 0 or above 65535: left out"
            )
        if self._odd_polarities:
            told.append(
                f"{self._odd_polarities} events with a polarity other than -1, 0 and 1:"
                " taken as ON above 0, else OFF"
            )
        if {-1, 0} <= self._values:
            told.append("polarities -1 and 0 both occur: both taken as OFF")
        return told


def assemble(file: EventFile) -> Recording:
    """Return all that a file holds, its events sorted and inside its geometry."""
    facts, check = file.facts, Check()
    parts = list(events_of_file(file, check))
    dtype = EVENT_DTYPE if file.causes is None else CAUSED_DTYPE
    events = np.concatenate([np.empty(0, dtype), *parts])
    del parts
    facts.problems += check.problems()
    size = settled_size(needed_size(events), facts)
    found = events.size
    events = inside(events, size)
    if events.size < found:
        facts.problems.append(left_out(found - events.size, size, facts.stated_by))
    events = _in_order(events, facts)
    shots = list(file.shots()) if file.shots is not None else None
    times = None if shots is None else np.array([shot.t_ns for shot in shots], np.int64)
    facts.problems += _disagreement(events, times)
    return Recording(
        path=str(facts.path),
        layout=file.layout,
        width=size[0],
        height=size[1],
        events=events,
        frame_times_ns=times,
        metadata=facts.description,
        problems=facts.problems,
        images=lambda: (shot.load() for shot in shots or ()),
        inputs=file.inputs,
    )


def events_of_file(file: EventFile, check: Check) -> Iterator[Events]:
    """Yield the events part by part, with their causes if the file has them."""
    if file.causes is None:
        yield from map(check.events_of, file.parts())
        return
    causes, done = file.causes(), 0
    check_numbers(causes, f"{file.facts.path}: causes")
    for columns in file.parts():
        size = columns[0].size
        if done + size > causes.size:
            raise DataError(f"{file.facts.path}: fewer causes than events: {causes.size}")
        yield check.events_of(columns, causes[done : done + size])
        done += size
    if done != causes.size:
        raise DataError(f"{file.facts.path}: {causes.size} causes for {done} events")


def settled_size(needed: tuple[int, int] | None, facts: Facts) -> tuple[int, int]:
    """Return width and height of the sensor, and note what is doubtful of them.

    Parameters
    ----------
    needed : (int, int) or None
        What the largest coordinates need; None: there are no events.
    facts : Facts
    """
    stated, by = facts.geometry, facts.stated_by
    if needed is None:
        facts.problems.append("no events")
        return stated or (0, 0)
    size = f"{needed[0]}x{needed[1]}"
    if stated is None:
        facts.problems.append(f"no geometry stated: {size} from the largest coordinates")
        return needed
    wider = max(stated[0], needed[0]), max(stated[1], needed[1])
    if wider == stated or wider[0] > stated[0] + 1 or wider[1] > stated[1] + 1:
        return stated
    # a known fault of writers: the largest coordinate in place of the size
    facts.problems.append(
        f"{by} states {stated[0]}x{stated[1]}, one less than the largest coordinates need:"
        f" {wider[0]}x{wider[1]} taken"
    )
    return wider


def inside(events: Events, size: tuple[int, int]) -> Events:
    """Return the events on a sensor of that width and height."""
    fits = (events["x"] < size[0]) & (events["y"] < size[1])
    return events if fits.all() else events[fits]


def left_out(count: int, size: tuple[int, int], by: str) -> str:
    """Return what is told of so many events outside the sensor."""
    return f"{count} events outside {size[0]}x{size[1]}, which {by} states: left out"


def needed_size(events: Events) -> tuple[int, int] | None:
    """Return width and height that the largest coordinates need."""
    return (int(events["x"].max()) + 1, int(events["y"].max()) + 1) if events.size else None


def _in_order(events: Events, facts: Facts) -> Events:
    back, untidy, repeated = disorder(events)
    if back:
        facts.problems.append(f"events are not in the order of time ({back} steps back): sorted")
        events = sort_events(events)
    elif untidy:
        sort_ties(events)
    if back or untidy:
        repeated = disorder(events)[2]
    if events.size and events["t"][0] < 0:
        facts.problems.append(f"times begin below zero, at {events['t'][0] / 1e6:.6f} s")
    if repeated:
        facts.problems.append(f"{repeated} events repeat another one exactly: kept")
    return events


def _disagreement(events: Events, times_ns: NDArray[np.int64] | None) -> list[str]:
    """Return what is to be told of events and frames that seem to be on different clocks."""
    if times_ns is None or len(times_ns) < 2 or len(events) < _FEW:
        return []
    begin, end = int(events["t"][0]) * 1000, int(events["t"][-1]) * 1000
    first, last = int(times_ns.min()), int(times_ns.max())
    length, frames_length = max(end - begin, 1), max(last - first, 1)
    alike = 1 / _APART < length / frames_length < _APART
    if alike and begin <= last and first <= end:
        return []
    return [
        f"events are from {seconds(begin)} to {seconds(end)} s, frames from {seconds(first)} to"
        f" {seconds(last)} s: are some in another unit? {SETTLED}"
    ]
