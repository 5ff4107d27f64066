"""From columns as a file holds them to a sorted event array, with a list of what was wrong."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import EVENT_DTYPE, Events, disorder, empty_events, sort_events, sort_ties
from adv2e.formats.recording import Recording, described_geometry
from adv2e.formats.units import event_unit
from adv2e.sources.frame import Image, Pixels
from adv2e.sources.times.instants import seconds
from adv2e.sources.times.units import SETTLED, Unit

_LARGEST = np.iinfo(np.uint16).max

_FEW = 100
"""So few events may well lie in a small part of the recording."""
_APART = 300
"""Events and frames that differ in length by this factor are in doubt."""

Column = NDArray[Any]

Progress = Callable[[int, int], None]
"""Is told how much of a file was read, and of how much: bytes, or events."""


class RecordingBuilder:
    """Collects what a file holds, then sorts and judges it.

    Parameters
    ----------
    path : Path
        The file, or folder.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times, as the user says.
    progress : callable, optional
        Is told how far the reading is.

    Attributes
    ----------
    progress : callable
        For the reader to tell.
    problems : list of str
        What is doubtful and what was done about it.
    description : dict
        What the file says of itself, if this program wrote it.
    geometry : (int, int) or None
        Width and height [pixels] that the file states.
    time_unit : str or None
        What the user says.
    stated_unit : str or None
        What the file says: that of times that we wrote.
    """

    def __init__(
        self, path: Path, time_unit: str | None = None, progress: Progress | None = None
    ) -> None:
        self.progress = progress or (lambda done, total: None)
        self.problems: list[str] = []
        self.description: dict[str, Any] = {}
        self.geometry: tuple[int, int] | None = None
        self.time_unit = time_unit
        self.stated_unit: str | None = None
        self._frames: tuple[Unit, bool] | None = None
        self._events: tuple[Unit, bool] = Unit("s"), False
        self._path = path
        self._stated_by = ""
        self._parts: list[Events] = []
        self._unstorable = 0
        self._values: set[int] = set()
        self._odd_polarities = 0

    def describe(self, text: str, label: str, name: str) -> None:
        """Take what the file says of itself; if that is broken, note a problem.

        Parameters
        ----------
        text : str
            JSON.
        label, name : str
            Where it stands, for messages: in full, and in short.
        """
        try:
            description = json.loads(text)
        except (ValueError, RecursionError):
            description = None
        if isinstance(description, dict):
            self.description = description
            self.stated_unit = "s" if description else None
            self.state(described_geometry(description), name)
        else:
            self.problems.append(f"{label}: not a JSON mapping, ignored")

    def state(self, geometry: tuple[int, int] | None, by: str) -> None:
        """Take (width, height) [pixels] that something states, unless something before it did."""
        if self.geometry is None:
            self.geometry, self._stated_by = geometry, by

    def note_frames(self, unit: Unit, *, whole: bool) -> None:
        """Take the unit of the times of two or more frames, and whether they are whole numbers."""
        self._frames = unit, whole

    def unit_of_events(
        self, t: Column, x: Column, y: Column, size: tuple[int, int] | None, *, whole: bool
    ) -> Unit:
        """Return the unit of the times of the events.

        Where the times of frames and events are written in different ways, one of them as whole
        numbers, what the user says is meant for that one: the other is in seconds.

        Parameters
        ----------
        t, x, y : arrays, (events,)
            Times as the file has them, columns and rows; of all events, or of the first.
        size : (int, int) or None
            Width and height, where the file states them.
        whole : bool
            Times are written as whole numbers.
        """
        if self.stated_unit is not None:
            unit = Unit(self.stated_unit)
        else:
            if size is None:
                size = (int(x.max()) + 1, int(y.max()) + 1) if t.size else (1, 1)
            frames = self._frames
            alike = frames is None or frames[1] == whole
            unit = event_unit(
                t,
                max(1, size[0] * size[1]),
                whole=whole,
                given=self.time_unit if alike or whole else None,
                beside=frames[0] if frames is not None and alike else None,
            )
        if t.size and unit.doubt:
            self.problems.append(unit.doubt)
        self._events = unit, whole
        return unit

    def unit_of_frames(self, *, whole: bool) -> str | None:
        """Return the unit of the frames' times that the user or events tell; None: neither.

        Parameters
        ----------
        whole : bool
            They are written as whole numbers.
        """
        unit, events_whole = self._events
        if self.stated_unit is not None:
            return None
        if self.time_unit is not None:
            return self.time_unit if whole or not events_whole else None
        return unit.name if events_whole == whole and self._frames is None else None

    def add(self, t: Column, x: Column, y: Column, p: Column) -> None:
        """Append events, in the order of the file.

        Parameters
        ----------
        t, x, y, p : integer arrays, (events,)
            Time [us], column, row, and polarity, ON above 0 (0/1 and -1/+1 are both usual).
        """
        self._note_polarities(p)
        fits = (x >= 0) & (x <= _LARGEST) & (y >= 0) & (y <= _LARGEST)
        count = int(np.count_nonzero(fits))
        if count < fits.size:
            self._unstorable += fits.size - count
            t, x, y, p = t[fits], x[fits], y[fits], p[fits]
        part = np.empty(count, EVENT_DTYPE)
        part["t"], part["x"], part["y"], part["p"] = t, x, y, p > 0
        self._parts.append(part)

    def _note_polarities(self, p: Column) -> None:
        usual = 0
        for value in (-1, 0, 1):
            found = int(np.count_nonzero(p == value))
            usual += found
            if found:
                self._values.add(value)
        self._odd_polarities += p.size - usual

    def finish(
        self,
        layout: str,
        frame_times_ns: NDArray[np.int64] | None = None,
        images: Callable[[], Iterator[Image | Pixels]] = lambda: iter(()),
    ) -> Recording:
        """Return the recording, its events sorted and inside its geometry.

        Parameters
        ----------
        layout, frame_times_ns, images
            See :class:`Recording`.
        """
        events = np.concatenate(self._parts) if self._parts else empty_events()
        self._parts.clear()
        if self._unstorable:
            self._say(
                f"{self._unstorable} events with a coordinate below 0 or above 65535: left out"
            )
        self._judge_polarities()
        events, width, height = self._fit(events)
        events = self._in_order(events)
        self.problems += _disagreement(events, frame_times_ns)
        return Recording(
            str(self._path),
            layout,
            width,
            height,
            events,
            frame_times_ns,
            self.description,
            self.problems,
            images,
        )

    def _say(self, text: str) -> None:
        self.problems.append(text)

    def _judge_polarities(self) -> None:
        if self._odd_polarities:
            self._say(
                f"{self._odd_polarities} events with a polarity other than -1, 0 and 1:"
                " taken as ON above 0, else OFF"
            )
        if {-1, 0} <= self._values:
            self._say("polarities -1 and 0 both occur: both taken as OFF")

    def _fit(self, events: Events) -> tuple[Events, int, int]:
        """Settle the geometry, and leave out what lies outside."""
        geometry, by = self.geometry, self._stated_by
        if not events.size:
            self._say("no events")
            return events, *(geometry or (0, 0))
        needed = int(events["x"].max()) + 1, int(events["y"].max()) + 1
        if geometry is None:
            self._say(f"no geometry stated: {needed[0]}x{needed[1]} from the largest coordinates")
            return events, *needed
        width, height = geometry
        if needed[0] <= width and needed[1] <= height:
            return events, width, height
        if needed[0] <= width + 1 and needed[1] <= height + 1:
            # a known fault of writers: the largest coordinate in place of the size
            wider = max(width, needed[0]), max(height, needed[1])
            self._say(
                f"{by} states {width}x{height}, one less than the largest coordinates need:"
                f" {wider[0]}x{wider[1]} taken"
            )
            return events, *wider
        inside = (events["x"] < width) & (events["y"] < height)
        self._say(
            f"{inside.size - np.count_nonzero(inside)} events outside {width}x{height}, which"
            f" {by} states: left out"
        )
        return events[inside], width, height

    def _in_order(self, events: Events) -> Events:
        back, untidy, repeated = disorder(events)
        if back:
            self._say(f"events are not in the order of time ({back} steps back): sorted")
            events = sort_events(events)
        elif untidy:
            sort_ties(events)
        if back or untidy:
            repeated = disorder(events)[2]
        if events.size and events["t"][0] < 0:
            self._say(f"times begin below zero, at {events['t'][0] / 1e6:.6f} s")
        if repeated:
            self._say(f"{repeated} events repeat another one exactly: kept")
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
