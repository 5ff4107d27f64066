"""Recordings of a known light: events, and a table of the light over time.

::

    time_s,light_dn,light_dn 0 0 32 24
    0,      20,     40
    1.0,    20,     40
    1.0,    60,     40
    2.0,    60,     80

``time_s`` (or ``time_ms``, ``time_us``) is on the clock of the events.  ``light_dn`` is linear
light of which 255 is white; ``light`` is that of which 1 is white.  The column without numbers
holds for all pixels that are in no rectangle; one with them for the rectangle of its first column,
first row, columns and rows.  Between two rows the light is a line; two rows of the same time are a
leap.

A table whose rectangles have few pixels each is a film (:mod:`adv2e.diagnosis.data.stimulus`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Sensor
from adv2e.diagnosis.data.evidence import Evidence, check_events, of_covered_time
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.data.stimulus import FILM_STEPS, LEAP_NS, Seen, Stimulus, of_film, refined
from adv2e.diagnosis.tables.table import Table, read_table
from adv2e.effects.frames.brightness import BRIGHTEST
from adv2e.errors import DataError
from adv2e.files.regular import shown
from adv2e.formats.reading import assemble, open_events
from adv2e.geometry import Rectangle, Size, parse_rectangle
from adv2e.light.sensor import check_beside

_TIMES_NS = {"time_s": 1e9, "time_ms": 1e6, "time_us": 1e3}
_LIGHTS_DN = {"light_dn": 1.0, "light": 255.0}
_WHITE_DN = 255.0
_REST = -1
_ALIKE = 8
"""Pixels of a column of light from which on, on average, it is that of a lamp and not of a film."""


def read_known_light(
    events: str | Path, light: str | Path, sensor: Sensor | None = None, **reading: Any
) -> Evidence:
    """Read events and the light that they were made under.

    Events as :func:`adv2e.formats.reading.read_events` reads them, `reading` as it takes it; the
    `sensor` says of how many pixels they are, where the file does not.

    Raises
    ------
    DataError
        A file cannot be read; the table is none of light for this sensor; events come before it or
        after it; there are too few.
    """
    size = None if sensor is None else (sensor.width, sensor.height)
    recording = assemble(open_events(events, size=size, **reading))
    width, height = recording.width, recording.height
    check_beside(width, height, sensor, recording.path)
    stimulus, part = read_stimulus(light, Size(width, height))
    kept, t_us = recording.events, recording.events["t"]
    check_events(len(kept), events, "in all")
    _check_span(t_us[[0, -1]], events, stimulus)
    times_ns = stimulus.looked_at_ns()
    seen = Seen(stimulus.at(times_ns).astype(np.float32), stimulus.region)
    times_s = np.asarray(times_ns * 1e-9, np.float64)
    whole = Evidence(
        name=shown(events),
        frames=seen,
        times_s=times_s,
        stream=Stream.of(kept, width, height).between(times_s[0] * 1e6, times_s[-1] * 1e6),
        width=width,
        height=height,
        notes=[one for one in recording.problems if "frame" not in one],
        white=_WHITE_DN,
        stimulus=stimulus,
    )
    if part != Rectangle(0, 0, width, height):
        inside = whole.cut(slice(part.y, part.y + part.height), slice(part.x, part.x + part.width))
        check_events(len(inside.stream), events, f"in the rectangle {part} of known light")
        outside = f"pixels outside the rectangle {part} of known light"
        whole, t_us = inside.without(outside, of=len(kept)), inside.stream.t
    return of_covered_time(whole, t_us)


def read_stimulus(path: str | Path, size: Size) -> tuple[Stimulus, Rectangle]:
    """Return the course of the light in a file, for a sensor of some size, and where it is known.

    Raises
    ------
    DataError
        The file cannot be read; columns are missing or not known; a time is before the one above
        it; light is negative or no number; rectangles are not on the sensor, overlap, or leave out
        pixels between them.  File and line, or column, are named.
    """
    table = read_table(path)
    (time,) = _columns(table, _TIMES_NS) or [""]
    names = _columns(table, _LIGHTS_DN)
    _check_columns(table, time, names)
    times_ns = _times_ns(table, time)
    light = np.stack([table.numbers(name, at_least=0.0, required=True) for name in names], axis=1)
    light *= _LIGHTS_DN[names[0].split()[0]]
    for row, column in np.argwhere(light > BRIGHTEST * _WHITE_DN)[:1].tolist():
        most = f"must be at most {BRIGHTEST * _WHITE_DN:,.0f} DN, {BRIGHTEST:g} times white"
        raise table.wrong(row, names[column], most)
    region, part = _regions(table.name, names, size)
    course = Stimulus(shown(path), times_ns, light, region)
    is_film = part.width * part.height < _ALIKE * len(names)
    every, steps = (of_film, FILM_STEPS) if is_film else (refined, 1)
    at_ns = every(times_ns, light)
    return Stimulus(course.name, at_ns, course.at(at_ns), region, steps), part


def _columns(table: Table, known: dict[str, float]) -> list[str]:
    return [name for name in table.columns if name.split()[0] in known]


def _check_columns(table: Table, time: str, names: list[str]) -> None:
    there = ", ".join(table.columns)
    if time not in _TIMES_NS:
        raise DataError(
            f"{table.name}: needs one column time_s, time_ms or time_us (there: {there})"
        )
    if not names:
        raise DataError(
            f"{table.name}: needs a column light_dn (255 is white) or light (1 is white; there:"
            f" {there})"
        )
    if len({name.split()[0] for name in names}) > 1:
        raise DataError(f"{table.name}: must have all light in one unit, light_dn or light")
    other = [name for name in table.columns if name != time and name not in names]
    if other:
        raise DataError(
            f"{table.name}: column {other[0]!r} is not known; one of light is named light_dn, or"
            " 'light_dn X Y COLUMNS ROWS' for a rectangle"
        )


def _times_ns(table: Table, column: str) -> NDArray[np.int64]:
    """Return the times of the rows [ns]; the second of two that are the same comes a leap later."""
    times = np.rint(table.numbers(column, required=True) * _TIMES_NS[column]).astype(np.int64)
    if len(times) < 2:
        raise DataError(f"{table.name}: has {len(times)} row, at least 2 are needed")
    step = np.diff(times)
    for k in np.flatnonzero(step < 0)[:1]:
        raise table.wrong(int(k) + 1, column, "must not be before the row above")
    for k in np.flatnonzero((step[1:] == 0) & (step[:-1] == 0))[:1]:
        raise table.wrong(
            int(k) + 2, column, "must not stand more than twice: before a leap, and after"
        )
    times[1:][step == 0] += LEAP_NS
    for k in np.flatnonzero(np.diff(times) < LEAP_NS // 2)[:1]:
        raise table.wrong(
            int(k) + 1, column, "must be 0.2 us or more after the row above, or equal"
        )
    return times


def _regions(name: str, columns: list[str], size: Size) -> tuple[NDArray[np.intp], Rectangle]:
    """Return the column of light of each pixel, (rows, columns), and the rectangle around them."""
    region = np.full((size.height, size.width), _REST, np.intp)
    whole, parts = _REST, []
    for number, column in enumerate(columns):
        words = column.split()[1:]
        if not words:
            whole = number
            continue
        try:
            part = parse_rectangle(",".join(words))
        except ValueError as error:
            raise DataError(f"{name}: column {column!r}: {error}".replace(",", " ")) from None
        if not part.is_inside(*size):
            raise DataError(
                f"{name}: column {column!r}: the rectangle must be inside the sensor of {size}"
            )
        place = region[part.y : part.y + part.height, part.x : part.x + part.width]
        if np.any(place != _REST):
            raise DataError(f"{name}: column {column!r}: the rectangle must not overlap another")
        place[:] = number
        parts.append(part)
    if whole != _REST:
        region[region == _REST] = whole
        return region, Rectangle(0, 0, *size)
    x, y = min(one.x for one in parts), min(one.y for one in parts)
    right, below = max(one.x + one.width for one in parts), max(one.y + one.height for one in parts)
    part = Rectangle(x, y, right - x, below - y)
    if np.any(region[y:below, x:right] == _REST):
        base = columns[0].split()[0]
        raise DataError(
            f"{name}: the rectangles must fill the one about them; or add a column {base} for all"
            " other pixels"
        )
    return region, part


def _check_span(ends_us: NDArray[np.int64], events: str | Path, stimulus: Stimulus) -> None:
    """Raise DataError where the light is not known."""
    known = stimulus.times_ns[[0, -1]] // 1000
    if ends_us[0] < known[0] or ends_us[1] > known[1]:
        came, told = (
            f"{first * 1e-6:.6f} to {last * 1e-6:.6f} s" for first, last in (ends_us, known)
        )
        raise DataError(
            f"{stimulus.name}: tells the light from {told}, events of {shown(events)} come from"
            f" {came}: add rows for all of that, on the clock of the events, or cut the events"
            " ('adv2e convert --start --stop')"
        )
