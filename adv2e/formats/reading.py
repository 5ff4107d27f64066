"""Event files of any format: opened, and their events put in the order of time.

Some facts are known only once all events of a file were read: the size of the sensor, the order of
timestamps, and whether each column is what it is taken for.  Where the events need not all be kept
(:func:`events_in_order`) the file is therefore read twice.  Events of one time keep the order of
the file.

The part that is wanted counts its times from the first event, or without any from the first frame;
both ends belong to it, and its coordinates count from its corner.  Frames are cut with the events.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSED_DTYPE
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE, Events, by_time, repeated
from adv2e.files.regular import beside, check_ends
from adv2e.formats.causes import beside as beside_of_causes
from adv2e.formats.causes import check_numbers, found_beside
from adv2e.formats.clock import Clock
from adv2e.formats.columns import FEW
from adv2e.formats.event_file import (
    MOST_COLUMNS,
    Column,
    Columns,
    EventFile,
    Facts,
    Progress,
)
from adv2e.formats.recording import Recording
from adv2e.formats.registry import format_of
from adv2e.geometry import MOST_PIXELS, Size
from adv2e.label import guessed, left_out
from adv2e.options import EventInput, size_of, takes
from adv2e.process.machine import machine_complaint
from adv2e.sources.base import Selection
from adv2e.sources.frame import Frame, Shot, Track
from adv2e.sources.times.rates import SETTLED, seconds
from adv2e.ticks import check_us, microseconds

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Recording", "open_events", "read_events"]


@takes(EventInput)
def open_events(
    path: str | Path, *, progress: Progress | None = None, **options: Unpack[EventInput]
) -> EventFile:
    """Open an event file, or a folder in the DAVIS240C layout; its events are not read yet.

    Parameters
    ----------
    path, progress
        See :func:`read_events`.
    **options
        See :class:`adv2e.options.EventInput`.

    Raises
    ------
    DataError
        As :func:`read_events`.
    """
    path = Path(path)
    time_unit, selection = options["time_unit"], Selection.of(options)
    facts = Facts(
        path,
        time_unit,
        progress,
        selection=selection,
        set_back=options["set_back"],
        crop_events=options["crop_events"],
    )
    facts.state(size_of(options), "--size")
    with _reading(path):
        check_ends(path)
        if not path.exists():
            raise DataError(f"{path}: no such file or folder")
        found = format_of(path)
        description = beside(path, ".json")
        if not found.holds_settings and description.is_file():
            facts.describe_from(description)
        file: EventFile = found.load(found.reader)(path, facts)
        if not facts.has_chosen:
            facts.choose([Track("events")])
        if time_unit is not None and not facts.needs_unit:
            facts.tell(f"--time-unit {time_unit} is not followed: the file says what its times are")
        facts.inputs.append(beside_of_causes(path))
        inside = found.load(found.causes)(path) if found.causes else None
    if selection.rotate180 and facts.geometry is None:
        raise DataError(
            f"{path}: states no size of its sensor, which --rotate180 needs to turn the events"
        )
    return replace(file, causes=inside or found_beside(path))


@takes(EventInput)
def read_events(
    path: str | Path, *, progress: Progress | None = None, **options: Unpack[EventInput]
) -> Recording:
    r"""Read an event file, or a folder in the DAVIS240C layout.

    Parameters
    ----------
    path : str or Path
        Its suffix and its first bytes tell the format: see docs/formats.md.
    progress : callable, optional
        Is called now and then with two numbers: how much was read, and of how much.
    **options
        See :class:`adv2e.options.EventInput`.

    Returns
    -------
    Recording
        Its `problems` tell what is doubtful.

    Raises
    ------
    DataError
        No such file, an unknown format, or content that cannot be read; the text names the file,
        and the line where there are lines.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from adv2e import read_events
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "events.txt")
    ...     _ = path.write_text("0.000001 3 2 1\n0.000250 0 0 0\n")
    ...     recording = read_events(path)
    >>> recording.events["t"].tolist(), recording.events["p"].tolist()
    ([1, 250], [1, 0])
    >>> recording.width, recording.height, recording.frame_times_ns is None
    (4, 3, True)
    """
    file = open_events(path, progress=progress, **options)
    recording = assemble(file)
    _check_size(recording)
    return recording


def shots_of(file: EventFile, shots: Iterable[Shot] | None = None) -> Iterator[Shot]:
    """Yield the frames of the part that is wanted, turned and cut, in the order of time.

    `shots` are all frames, where they were listed before.
    """
    begin_us, end_us = wanted_us(file)
    with _reading(file.facts.path):
        if shots is None:
            shots = () if file.shots is None else file.shots()
        for shot in shots:
            if begin_us <= microseconds(shot.t_ns) <= end_us:
                yield replace(shot, load=partial(_loaded, file.facts, shot))


def _loaded(facts: Facts, shot: Shot) -> Frame:
    with _reading(facts.path):
        frame = shot.load()
    facts.selection.check_crop(Size(*frame.image.shape[1::-1]), shot.label)
    return facts.selection.of_frame(frame)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn an OSError about a file in the body into a DataError."""
    try:
        yield
    except OSError as error:
        if machine_complaint(error):
            raise
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error


def _check_size(recording: Recording) -> None:
    """Refuse sensors too large to make a picture of, as one stray coordinate makes them."""
    width, height, events = recording.width, recording.height, recording.events
    if width * height <= MOST_PIXELS:
        return
    why = "is stated"
    if events.size and (int(events["x"].max()) + 1, int(events["y"].max()) + 1) == (width, height):
        far = events[int(np.argmax(np.maximum(events["x"], events["y"])))]
        why = (
            f"the event at {far['t'] / 1e6:.6f} s, x {far['x']}, y {far['y']} needs; if it is"
            " wrong, state the size: --size WxH"
        )
    raise DataError(
        f"{recording.path}: a sensor of {width}x{height} pixels, over {MOST_PIXELS:,}, {why}"
    )


_STRAY = 1000
"""Events of which one may have an impossible polarity."""
_MOST_OUTSIDE = 0.01
"""Share of the events that may lie outside the sensor: stray ones."""
_POLARITY = "write polarities as 0 and 1"
_FEW = 100
"""Number of events below which they may well lie in a small part of the recording."""
_APART = 300
"""Events and frames that differ in length by this factor are in doubt."""


class Survey:
    """Takes note of all events of a file, part by part.

    Attributes
    ----------
    count : int
        Events until now.
    steps_back : int
        How often an event is earlier than that before it in the file.
    """

    def __init__(self, file: EventFile) -> None:
        self._file, self._facts = file, file.facts
        self.count = self.steps_back = self._largest_back_us = 0
        self._unstorable = self._outside = self._odd = 0
        self._needed = (0, 0)
        self._signs: set[int] = set()
        self._whole = True
        self._columns = {name: _Column() for name in "txyp"}

    def note(self, columns: Columns) -> None:
        """Take note of a part, its times in microseconds."""
        t, x, y, p = columns
        if not t.size:
            return
        self.count += t.size
        step = np.diff(t, prepend=self._columns["t"].last if self._columns["t"].size else t[0])
        back = step < 0
        if back.any():
            self.steps_back += int(np.count_nonzero(back))
            self._largest_back_us = max(self._largest_back_us, -int(step.min()))
        if self._whole and self._file.unit_ns > 1000:
            self._whole = not np.any(t % (self._file.unit_ns // 1000))
        for name, column in zip("txyp", columns, strict=True):
            self._columns[name].note(column)
        self._note_polarities(p)
        fits = storable(x, y)
        if fits is not None:
            self._unstorable += fits.size - int(np.count_nonzero(fits))
            x, y = x[fits], y[fits]
        if x.size:
            right, down = int(x.max()) + 1, int(y.max()) + 1
            self._needed = max(self._needed[0], right), max(self._needed[1], down)
            stated = self._facts.geometry
            if stated is not None and (right > stated[0] or down > stated[1]):
                self._outside += int(np.count_nonzero((x >= stated[0]) | (y >= stated[1])))

    def _note_polarities(self, p: Column) -> None:
        usual = 0
        for value in (-1, 0, 1):
            found = int(np.count_nonzero(p == value))
            usual += found
            if found:
                self._signs.add(value)
        self._odd += p.size - usual

    def settle(self) -> tuple[int, int]:
        """Return width and height of the sensor, and tell what is doubtful of all events.

        Raises
        ------
        DataError
            The columns are not what they were taken for; or more than a few events lie outside the
            sensor, and nobody asked for the others.
        """
        self._check_columns()
        self._facts.span_us = self.span_us()
        if self._unstorable:
            self._tell_outside(self._unstorable, "with a coordinate below 0 or above 65535")
        if self._odd:
            told = (
                f"{self._odd} events with a polarity other than -1, 0 and 1: taken as ON above 0,"
            )
            self._facts.tell(guessed(f"{told} else OFF", "polarity", "ON above 0", _POLARITY))
        if {-1, 0} <= self._signs:
            told = "polarities -1 and 0 both occur: both taken as OFF"
            self._facts.tell(guessed(told, "polarity", "-1 and 0 are OFF", _POLARITY))
        size = self._size()
        if self._outside and size == self._facts.geometry:
            where = f"outside {size[0]}x{size[1]}, which {self._facts.stated_by} states"
            self._tell_outside(self._outside, where)
        return size

    def span_us(self) -> tuple[int, int]:
        """Return first and last time of the events [us], of the frames where there are none."""
        if self.count:
            return self._columns["t"].least, self._columns["t"].most
        with _reading(self._facts.path):
            shots = [] if self._file.shots is None else list(self._file.shots())
        return (microseconds(shots[0].t_ns), microseconds(shots[-1].t_ns)) if shots else (0, 0)

    def tell_order(self) -> None:
        """Tell of events out of order, which were sorted."""
        if self.steps_back:
            self._facts.tell(
                f"events are not in the order of time ({self.steps_back} steps back, the largest"
                f" {_length(self._largest_back_us)}): sorted"
            )

    def _check_columns(self) -> None:
        facts, (t, *others) = self._facts, self._columns.values()
        wrong = ""
        if self._odd > max(1, self.count // _STRAY):
            wrong = f"{self._odd} of {self.count} polarities are other than -1, 0 and 1"
        elif self._signs == {-1, 0}:
            wrong = "polarities are -1 (or 255) and 0 alone, so that nothing is ON"
        elif (
            self.count >= FEW
            and self.steps_back > self.count // 4
            and self._whole
            and t.least >= 0
            and t.most * 1000 < MOST_COLUMNS * self._file.unit_ns
            and any(column.rises for column in others[:2])
        ):
            wrong = f"times go back {self.steps_back} times, and another column never does"
        if wrong:
            held = "; ".join(f"{name} {c.text}" for name, c in self._columns.items() if name != "t")
            raise DataError(
                f"{facts.path}: {wrong}: are the columns {' '.join(self._file.order or 'txyp')}?"
                f" {held}"
            )

    def _tell_outside(self, count: int, where: str) -> None:
        told = f"{count} events {where}"
        if not self._facts.crop_events and count > _MOST_OUTSIDE * self.count:
            hint, (width, height) = "", self._needed
            stated = self._facts.geometry
            if stated and width <= stated[1] and height <= stated[0]:
                hint = f" (a sensor of {stated[1]}x{stated[0]} holds them)"
            elif stated:
                hint = f" (they need {width}x{height})"
            raise DataError(
                f"{self._facts.path}: {told}, of {self.count}{hint}: --crop-events leaves them out"
            )
        self._facts.tell(left_out(f"{told}: left out"))

    def _size(self) -> tuple[int, int]:
        facts, needed = self._facts, self._needed
        stated, by = facts.geometry, facts.stated_by
        if needed == (0, 0):
            facts.tell("no events")
            return stated or (0, 0)
        size = f"{needed[0]}x{needed[1]}"
        if stated is None:
            told = f"no geometry stated: {size} from the largest coordinates"
            facts.tell(guessed(told, "size", size, f"give --size {size}, or that of the sensor"))
            return needed
        wider = max(stated[0], needed[0]), max(stated[1], needed[1])
        if wider == stated or wider[0] > stated[0] + 1 or wider[1] > stated[1] + 1:
            return stated
        # a known fault of writers: the largest coordinate in place of the size
        told = f"{by} states {stated[0]}x{stated[1]}, one less than the largest coordinates need:"
        size = f"{wider[0]}x{wider[1]}"
        facts.tell(guessed(f"{told} {size} taken", "size", size, f"give --size {size}"))
        return wider


class _Column:
    """Range of a column, and whether it ever falls."""

    def __init__(self) -> None:
        self.size = 0
        self.first = self.last = self.least = self.most = 0
        self.falls = False

    def note(self, column: Column) -> None:
        if not self.size:
            self.first = self.last = self.least = self.most = int(column[0])
        self.least = min(self.least, int(column.min()))
        self.most = max(self.most, int(column.max()))
        if not self.falls:
            self.falls = bool(column[0] < self.last or np.any(column[1:] < column[:-1]))
        self.size += column.size
        self.last = int(column[-1])

    @property
    def rises(self) -> bool:
        return not self.falls and self.last > self.first

    @property
    def text(self) -> str:
        return f"is {self.least} to {self.most}" + (" and never falls" if self.rises else "")


def storable(x: Column, y: Column) -> NDArray[np.bool_] | None:
    """Return a mask of the coordinates that a sensor can have, (n,) bool; None: all of them."""
    fits = (x >= 0) & (x < MOST_COLUMNS) & (y >= 0) & (y < MOST_COLUMNS)
    return None if fits.all() else fits


def events_of_file(file: EventFile, survey: Survey | None = None) -> Iterator[Events]:
    """Yield the events part by part in the order of the file, with their causes if it has them.

    Those that no sensor can have are left out.

    Parameters
    ----------
    file : EventFile
    survey : Survey, optional
        Takes note of all events.

    Raises
    ------
    DataError
        They cannot be read; their times go back (:mod:`adv2e.formats.clock`).
    """
    path, geometry, done = file.facts.path, file.facts.geometry, 0
    clock = Clock(file.facts, file.unit_ns, bits=file.bits)
    label = f"{path}: {file.times}"
    with _reading(path):
        causes = None if file.causes is None else file.causes()
        if causes is not None:
            check_numbers(causes, f"{path}: causes")
        for raw, *others in file.parts():
            x, y, p = others
            t = clock.ticks(raw, label)
            if file.offset_us:
                t += file.offset_us
                check_us(t, label)
            if file.facts.selection.rotate180 and geometry is not None:
                x, y = geometry[0] - 1 - x.astype(np.int64), geometry[1] - 1 - y.astype(np.int64)
            if survey is not None:
                survey.note((t, x, y, p))
            part = np.empty(t.size, EVENT_DTYPE if causes is None else CAUSED_DTYPE)
            if causes is not None:
                if done + t.size > causes.size:
                    raise DataError(f"{path}: fewer causes than events: {causes.size}")
                part["cause"] = causes[done : done + t.size]
            fits = storable(x, y)
            if fits is not None:
                part = part[fits]
                t, x, y, p = t[fits], x[fits], y[fits], p[fits]
            part["t"], part["x"], part["y"], part["p"] = t, x, y, p > 0
            done += raw.size
            yield part
    if causes is not None and done != causes.size:
        raise DataError(f"{path}: {causes.size} causes for {done} events")
    clock.tell()
    if clock.resets and file.shots is not None:
        file.facts.tell("frames beside the events go by times of their own: they may lie apart")


def assemble(file: EventFile) -> Recording:
    """Return the part of a file that is wanted, its events sorted and inside its geometry."""
    facts, survey = file.facts, Survey(file)
    parts = list(events_of_file(file, survey))
    size = survey.settle()
    events = _all_in_order(file, parts, size)
    survey.tell_order()
    if events.size and events["t"][0] < 0:
        facts.tell(f"times begin below zero, at {events['t'][0] / 1e6:.6f} s")
    if count := repeated(events):
        facts.tell(f"{count} events repeat another one exactly: kept")
    shots = None
    if file.shots is not None:
        with _reading(facts.path):
            shots = list(file.shots())  # once: it may take as long as the events
        facts.problems += _disagreement(events, _times_ns(shots))
        shots = list(shots_of(file, shots))
    size = _size_wanted(file, size)
    events = next(_wanted(file, [events]), np.empty(0, events.dtype))
    return Recording(
        path=str(facts.path),
        layout=file.layout,
        width=size[0],
        height=size[1],
        events=events,
        frame_times_ns=None if shots is None else _times_ns(shots),
        metadata=facts.description,
        problems=facts.problems,
        images=lambda: (shot.load() for shot in shots or ()),
        inputs=file.inputs,
    )


def events_in_order(file: EventFile) -> tuple[tuple[int, int], int, Generator[Events, None, None]]:
    """Return size and first time [us] of the part that is wanted, and its events in order.

    The events come part by part, those on the sensor.  What is doubtful is added to the problems of
    the file.  Only events out of order are all kept in memory, to be sorted.

    Raises
    ------
    DataError
        There are no events, and no size is stated; the part is not on the sensor, or holds nothing;
        or the file cannot be read.
    """
    survey, size = _surveyed(file)
    if size == (0, 0):
        raise DataError(
            f"{file.facts.path}: no events, and no size of the sensor: state it with --size"
        )
    if survey.steps_back:
        parts = iter([_all_in_order(file, list(events_of_file(file)), size)])
        survey.tell_order()
    else:
        parts = (inside(events, size) for events in events_of_file(file))
    file.facts.whole = size
    first_us = _span_us(file)[0] + file.facts.selection.start_ns // 1000
    return _size_wanted(file, size), first_us, _wanted(file, parts)


def _surveyed(file: EventFile) -> tuple[Survey, tuple[int, int]]:
    """Return the survey of all events, and the size of the sensor."""
    survey = Survey(file)
    for _ in events_of_file(file, survey):
        pass
    return survey, survey.settle()


def _span_us(file: EventFile) -> tuple[int, int]:
    if file.facts.span_us is None:
        file.facts.span_us = _surveyed(file)[0].span_us()
    return file.facts.span_us


def wanted_us(file: EventFile) -> tuple[float, float]:
    """Return the first and the last time of the part that is wanted [us]."""
    wanted = file.facts.selection
    if not wanted.is_timed:
        return -math.inf, math.inf
    first_us, _ = _span_us(file)
    begin_us = first_us + wanted.start_ns / 1000 if wanted.start_ns else -math.inf
    return begin_us, first_us + wanted.stop_ns / 1000


def _size_wanted(file: EventFile, size: tuple[int, int]) -> tuple[int, int]:
    """Return the size of the part of a sensor that is wanted; DataError if it is not on it."""
    crop = file.facts.selection.crop
    if crop is None:
        return size
    if not crop.is_inside(*size):
        raise DataError(
            f"{file.facts.path}: --crop {crop} does not lie on the sensor of {Size(*size)} pixels"
        )
    return crop.width, crop.height


def _wanted(file: EventFile, parts: Iterable[Events]) -> Generator[Events, None, None]:
    """Yield what is wanted of sorted events; DataError if that leaves no events and no frames."""
    begin_us, end_us = wanted_us(file)
    wanted, found = file.facts.selection, False
    for events in parts:
        times = events["t"]
        some = events[bisect_left(times, begin_us) : bisect_right(times, end_us)]
        if wanted.crop is not None:
            x, y, width, height = wanted.crop
            some = some[(some["x"] >= x) & (some["y"] >= y)]
            some["x"] -= x
            some["y"] -= y
            some = inside(some, (width, height))
        elif some.size < events.size:
            some = some.copy()  # without the rest in memory
        ends = bool(times.size and times[-1] > end_us)  # now: who takes them may change them
        if some.size:
            found = True
            yield some
        if ends:
            break
    if not found and (wanted.is_timed or wanted.crop) and next(shots_of(file), None) is None:
        first_us, last_us = _span_us(file)
        raise DataError(
            f"{file.facts.path}: --start, --stop and --crop leave no event of its"
            f" {(last_us - first_us) / 1e6:.6f} s"
        )


def _times_ns(shots: Iterable[Shot]) -> NDArray[np.int64]:
    return np.array([shot.t_ns for shot in shots], np.int64)


def _all_in_order(file: EventFile, parts: list[Events], size: tuple[int, int]) -> Events:
    """Return the events of all parts that lie on the sensor, by time."""
    dtype = EVENT_DTYPE if file.causes is None else CAUSED_DTYPE
    events = np.concatenate([np.empty(0, dtype), *parts])
    parts.clear()
    return by_time(inside(events, size))


def inside(events: Events, size: tuple[int, int]) -> Events:
    """Return the events on a sensor of that width and height."""
    fits = (events["x"] < size[0]) & (events["y"] < size[1])
    return events if fits.all() else events[fits]


def _length(time_us: int) -> str:
    """Return a length of time in the unit that suits it."""
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if time_us >= size:
            return f"{time_us / size:.7g} {unit}"
    return f"{time_us} us"


def _disagreement(events: Events, times_ns: NDArray[np.int64]) -> list[str]:
    """Return a warning if events and frames seem to be on different clocks, else nothing."""
    if len(times_ns) < 2 or len(events) < _FEW:
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
