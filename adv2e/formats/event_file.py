"""An event file that was opened: what it states, its events in parts, and the frames beside them.

What reads a format is a function ``open_...(path, facts)``.  It reads the head of the file, tells
`facts` what the file states, and returns an :class:`EventFile`; the events are read when its
`parts` are.  Whether they are kept or passed on is for others to say.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.formats.clock import unwrapped
from adv2e.formats.columns import event_unit, named_geometry
from adv2e.sources.base import Selection
from adv2e.sources.frame import Light, Shot, Track, choose
from adv2e.sources.stored import recorded_light
from adv2e.sources.times.rates import Unit
from adv2e.ticks import US

MOST_COLUMNS = 1 << 16
"""Columns and rows that coordinates of events can name."""

Column = NDArray[Any]

Columns = tuple[Column, Column, Column, Column]
"""Time, column, row, and polarity (ON above 0; 0/1 and -1/+1 are both usual), of integers."""

Progress = Callable[[int, int], None]
"""Is told how much of a file was read, and of how much: bytes, or events."""

_GATHERED = 1 << 20
"""Events of packets that go on together, or some more."""

_WHOLE = Selection()


class Facts:
    """Facts about an event file: those it states, those the user gives, and its problems.

    Parameters
    ----------
    path : Path
        The file, or folder.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times, as the user says.
    progress : callable, optional
        Is told how far the reading is.
    selection : Selection
        The stream and the part of it that the user wants, and whether it is turned by half a turn.
    set_back : {'continue', 'sort'}, optional
        Treatment of times that go back; see :mod:`adv2e.formats.clock`.
    crop_events : bool
        Leave out events outside the sensor, however many.

    Attributes
    ----------
    inputs : list of str or Path
        Files that are read beside `path`, and within it if it is a folder.
    progress : callable
        For the reader to tell.
    has_chosen : bool
        The reader looked for the stream that the user wants.
    needs_unit : bool
        Neither the format nor the file says the unit of its times: that of the user counts.
    whole : (int, int)
        Width and height of the sensor before it is cut, once events were asked for in order.
    span_us : (int, int) or None
        First and last time of the events [us], of frames where there are none; None before all
        were read.
    problems : list of str
        Doubts about the file, and how they were resolved.
    uncarried : list of str
        What the file holds beside events and frames, such as an IMU.
    description : dict
        Description in the file, if this program wrote it.
    geometry : (int, int) or None
        Width and height [pixels] that the file states.
    stated_by : str
        Name of the place that states the geometry, for messages.
    time_unit : str or None
        Unit of the times that the user gives.
    stated_unit : str or None
        Unit of the times that the file states, if this program wrote it.
    """

    def __init__(
        self,
        path: Path,
        time_unit: str | None = None,
        progress: Progress | None = None,
        *,
        selection: Selection = _WHOLE,
        set_back: str | None = None,
        crop_events: bool = False,
    ) -> None:
        self.path = path
        self.selection = selection
        self.has_chosen = self.needs_unit = False
        self.inputs: list[str | Path] = []
        self.whole = 0, 0
        self.span_us: tuple[int, int] | None = None
        self.set_back = set_back
        self.crop_events = crop_events
        self.progress = progress or (lambda done, total: None)
        self.problems: list[str] = []
        self.uncarried: list[str] = []
        self.description: dict[str, Any] = {}
        self.geometry: tuple[int, int] | None = None
        self.stated_by = ""
        self.time_unit = time_unit
        self.stated_unit: str | None = None
        self._frames: tuple[Unit, bool] | None = None
        self._events: tuple[Unit, bool] = Unit("s"), False

    def tell(self, problem: str) -> None:
        """Add a problem, unless it was told already: files are read twice."""
        if problem not in self.problems:
            self.problems.append(problem)

    def describe(self, text: str, label: str, name: str) -> None:
        """Take the description in the file; if it is broken, note a problem.

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
            self.state_by_names(description, name)
        else:
            self.problems.append(f"{label}: not a JSON mapping, ignored")

    def describe_from(self, file: Path) -> None:
        """Take the description in a file beside it, as :meth:`describe` does."""
        self.inputs.append(file)
        text = file.read_text("utf-8", errors="replace")
        self.describe(text, str(file), file.name)
        if "adv2e" not in self.description:  # somebody else's
            self.stated_unit = None

    def choose(
        self, events: Sequence[Track], frames: Sequence[Track] = ()
    ) -> tuple[int | None, int | None]:
        """Return the streams to be read, as :func:`adv2e.sources.frame.choose` does."""
        event, frame, told = choose(self.selection.track, events, frames, self.path)
        self.has_chosen = True
        self.problems += told
        return event, frame

    def state(self, geometry: tuple[int, int] | None, by: str) -> None:
        """Take (width, height) [pixels] that something states, unless something before it did."""
        if self.geometry is None:
            self.geometry, self.stated_by = geometry, by

    def state_by_names(self, values: Mapping[str, Any], by: str) -> None:
        """Take the size of the sensor from whatever among named values states one."""
        name, geometry = named_geometry(values)
        self.state(geometry, by if name in ("", "width, height") else f"{by}: {name}")

    @property
    def light(self) -> Light:
        """Encoding and white of the frames; see ``recorded_light``."""
        return recorded_light(self.description, str(self.path))

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
            self.needs_unit = True
            if size is None:
                size = (int(x.max()) + 1, int(y.max()) + 1) if t.size else (1, 1)
            frames = self._frames
            alike = frames is None or frames[1] == whole
            unit = event_unit(
                unwrapped(t),
                max(1, size[0] * size[1]),
                whole=whole,
                given=self.time_unit if alike or whole else None,
                beside=frames[0] if frames is not None and alike else None,
            )
        if t.size and unit.doubt:
            self.tell(unit.doubt)
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


@dataclass(frozen=True)
class EventFile:
    """An event file that was opened.

    Attributes
    ----------
    layout : str
        What it is called.
    facts : Facts
        What it states.
    parts : callable
        Returns an iterator over all events, part by part in the order of the file; it raises
        DataError where they cannot be read, and may add problems to the facts.
    shots : callable, optional
        Returns an iterator over all frames, in the order of time, not loaded and not turned (see
        :func:`adv2e.formats.reading.shots_of`); None: the file has none.
    causes : callable, optional
        Returns the number of the cause of each event, in the order of the file; None: it has none.
    unit_ns, offset_us : int
        Unit of the times in the parts [ns], and what is to be added to them [us].
    bits : int
        Of the clock, where the format says it; 0: it does not.
    times : str
        What the times are called in the file, for messages.
    order : str
        That of the columns, where the file does not name them.
    """

    layout: str
    facts: Facts
    parts: Callable[[], Iterator[Columns]]
    shots: Callable[[], Iterator[Shot]] | None = None
    causes: Callable[[], Column] | None = None
    unit_ns: int = US
    offset_us: int = 0
    bits: int = 0
    times: str = "times"
    order: str = ""

    @property
    def inputs(self) -> list[str | Path]:
        """Files that are read, and their folder, where nothing may be written."""
        shots = self.shots() if self.shots is not None and self.facts.path.is_dir() else ()
        return [self.facts.path, *self.facts.inputs, *(shot.label for shot in shots)]


def joined(parts: Callable[[], Iterator[Columns]]) -> Iterator[Columns]:
    """Yield the events of small packets, many of them at once."""
    held: list[Columns] = []
    count = 0
    for columns in parts():
        held.append(columns)
        count += columns[0].size
        if count >= _GATHERED:
            yield _concatenated(held)
            held, count = [], 0
    if held:
        yield _concatenated(held)


def _concatenated(held: list[Columns]) -> Columns:
    t, x, y, p = (np.concatenate(columns) for columns in zip(*held, strict=True))
    return t, x, y, p
