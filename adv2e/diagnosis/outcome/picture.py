"""The picture of a residual: curves and maps of the recording and of both models' simulations.

A measure turns the events of one stream into the values of a curve; a place is a pixel in a frame
interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import (
    BRIGHTNESSES,
    LIGHT_NAMES,
    SPEED_NAMES,
    SPEEDS,
    STILL,
    Placed,
    Scene,
)
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.data.stimulus import Leaps
from adv2e.diagnosis.statistics.groups import excess
from adv2e.diagnosis.statistics.rates import by_load, rate_hz
from adv2e.diagnosis.statistics.timing import BORDERS_MS, LAGS_MS
from adv2e.reports.result import Band, Curve, Estimate, ResidualMap, Snapshot, Total

Array = NDArray[np.float64]
Measure = Callable[[Placed], Array]

_PER_PIXEL, _PER_SENSOR = "rate [events a pixel a second]", "rate [events a second]"
_MOTION = (("in motion", True), ("at rest", False))
_POLARITIES = (("ON", 1), ("OFF", 0))
_LOADS = 8
_PHASES = np.linspace(0.0, 100.0, 11)
_GAPS_MS = np.array([0.05, *BORDERS_MS, 512.0])
_SINCE_LEAP_MS = 0.01 * 2.0 ** (0.5 * np.arange(31.0))
_STAMPS_US = np.r_[0.5, 2.0 ** np.arange(14.0) + 0.5]
"""Borders between whole numbers of microseconds, the first for none and one together."""

_NOWHERE = -1
"""Class of a place that is not looked at."""
_MOST_ROWS = 48
_STEEPEST = 20.0
"""Change of log light [1/s] at which slopes are cut off, so that single steps do not decide."""
_CONTRAST_S = 0.05
"""Time within which the change of log light counts as one contrast [s]."""
_CONTRASTS: Array = 0.025 * 2.0 ** np.arange(9.0)
"""Borders of classes of contrast [ln]; beyond the first and last are counted with them."""


@dataclass(frozen=True)
class _Axes:
    """Axes of a curve: labels, points or borders in x, and the measure in y."""

    title: str
    x_label: str
    y_label: str
    x: Array
    measure: Measure
    x_log: bool = False
    x_names: Sequence[str] = ()


def pictures_of(
    scene: Scene, measured: Stream, before: Sequence[Stream], after: Sequence[Stream]
) -> dict[str, Any]:
    """Return all of the picture, by the names of a diagnosis.

    `before` and `after` are simulations of the declared model and of the model found.
    """
    placed = Placed.of(measured, scene)
    first, second = ([Placed.of(one, scene) for one in some] for some in (before, after))
    kinds = {"curves": curves_of, "maps": maps_of, "totals": totals_of, "snapshot": snapshot_of}
    return {name: kind(scene, placed, first, second) for name, kind in kinds.items()}


def curves_of(
    scene: Scene, measured: Placed, before: Sequence[Placed], after: Sequence[Placed]
) -> list[Curve]:
    """Return curves by time, by what the light does, by place, by load.

    `before` and `after` are simulations of the declared model and of the model found.
    """
    drawn = []
    for kind in (*_between_events(), *_by_place(scene), *_by_time(scene, before)):
        axes = kind.title, kind.x_label, kind.y_label, kind.x
        first, second = (_band([kind.measure(one) for one in some]) for some in (before, after))
        values = kind.measure(measured), first, second
        drawn.append(Curve(*axes, *values, kind.x_log, x_names=kind.x_names))
    return drawn


def maps_of(
    scene: Scene, measured: Placed, before: Sequence[Placed], after: Sequence[Placed]
) -> list[ResidualMap]:
    """Return maps of the excess of events, ON and OFF; arguments as of :func:`curves_of`."""

    def number(placed: Placed, on: int) -> Array:
        pixel = placed.stream.pixel[placed.stream.on == on]
        return np.bincount(pixel, minlength=scene.pixels).astype(np.float64)

    def excess_of(on: int, simulated: Sequence[Placed]) -> Array:
        mean = np.mean([number(placed, on) for placed in simulated], axis=0)
        return excess(number(measured, on), mean).reshape(scene.height, scene.width)

    return [
        ResidualMap(
            f"{name} events: measured minus simulated", excess_of(on, before), excess_of(on, after)
        )
        for name, on in _POLARITIES
    ]


_LENGTHS_MS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_LEAST_SEEN = 0.125
"""Events a pixel that a snapshot holds, or it is longer."""


def totals_of(
    scene: Scene, measured: Placed, before: Sequence[Placed], after: Sequence[Placed]
) -> list[Total]:
    """Return totals: numbers of ON and OFF events, event rate, median inter-event interval.

    Arguments as of :func:`curves_of`.
    """

    def rate(placed: Placed) -> float:
        return len(placed.stream) / (scene.pixels * float(scene.seconds.sum()))

    def apart_ms(placed: Placed) -> float:
        since = placed.stream.since
        since = since[since >= 0]
        return 1e-3 * float(np.median(since)) if len(since) else math.nan

    kinds: list[tuple[str, str, Callable[[Placed], float]]] = [
        ("ON events", "events", lambda placed: float(np.count_nonzero(placed.stream.on))),
        ("OFF events", "events", lambda placed: float(np.count_nonzero(placed.stream.on == 0))),
        ("rate of ON and OFF", "events a pixel a second", rate),
        ("time from an event to the next of its pixel, median", "ms", apart_ms),
    ]
    return [
        Total(
            name,
            unit,
            number(measured),
            *(Estimate.of_draws([number(one) for one in placed]) for placed in (before, after)),
        )
        for name, unit, number in kinds
    ]


def snapshot_of(
    scene: Scene, measured: Placed, before: Sequence[Placed], after: Sequence[Placed]
) -> Snapshot:
    """Return the events of the busiest short time, of the recording and of a simulation each.

    Arguments as of :func:`curves_of`.  It is the busiest of all of them together, so that none is
    shown where it has the most by chance, and as long as makes events enough to see a picture.
    """
    shown = measured, before[0], after[0]
    start, stop = scene.times_us[[0, -1]]
    streams = [placed.stream for placed in (measured, *before, *after)]
    t = np.sort(np.concatenate([stream.t for stream in streams]))
    enough = _LEAST_SEEN * scene.pixels * len(streams)
    first, length = start, stop - start
    for length_ms in _LENGTHS_MS:
        borders = np.arange(start, stop, 500.0 * length_ms)  # two steps are a window
        number = np.diff(np.searchsorted(t, np.r_[borders, stop]))
        if len(number) < 3:
            break
        together = number[:-2] + number[1:-1]  # whole windows alone
        k = int(np.argmax(together))
        if together[k] >= enough:
            first, length = borders[k], 1000.0 * length_ms
            break

    def number_of(placed: Placed) -> NDArray[np.int64]:
        part = placed.stream.between(first, first + length)
        cell = part.on * np.int64(scene.pixels) + part.pixel
        number = np.bincount(cell, minlength=2 * scene.pixels)
        return number.reshape(2, scene.height, scene.width)

    return Snapshot((first - start) * 1e-6, length * 1e-6, *map(number_of, shown))


def _band(rows: Sequence[Array]) -> Band:
    low, middle, high = np.quantile(np.array(rows), [0.025, 0.5, 0.975], axis=0)
    return Band(middle, low, high)


def _between_events() -> Iterator[_Axes]:
    for kind, same in (("same", True), ("other", False)):
        title, label = f"a pixel, {kind} polarity", "the event before [ms]"
        yield _times(title, label, _GAPS_MS, partial(_gaps, same=same))
    for kind, same in (("same", True), ("other", False)):
        title, label = f"the sensor, {kind} row", "the event before, of any pixel [µs]"
        yield _times(title, label, _STAMPS_US, partial(_stamps, same=same))


def _times(of: str, since: str, borders: Array, values: Measure) -> _Axes:
    return _in_bins(f"Time between events of {of}", f"time since {since}", borders, values)


def _in_bins(
    title: str, label: str, borders: Array, values: Measure, *, x_log: bool = True
) -> _Axes:
    """Return axes for the number of events by a value of each."""

    def measure(placed: Placed) -> Array:
        return np.histogram(values(placed), borders)[0].astype(np.float64)

    return _Axes(title, label, "events in a bin", borders, measure, x_log)


def _by_place(scene: Scene) -> Iterator[_Axes]:
    """Yield rates by what the light does, when events follow it, and rates by row."""
    thirds = scene.brightness.astype(np.int64)
    borders = np.arange(BRIGHTNESSES + 1.0)
    for text, moving in _MOTION:
        kind = np.where((scene.speed != STILL) == moving, thirds, _NOWHERE)
        for name, on in _POLARITIES:
            title = f"Rate against brightness, {text}, {name}"
            measure = _rates(scene, kind, BRIGHTNESSES, on)
            label = f"thirds of brightness: {', '.join(scene.bounds_of_light)}; white: 255 DN"
            yield _Axes(title, label, _PER_PIXEL, borders, measure, x_names=LIGHT_NAMES)
    label = f"at rest, and thirds of speed of log light: {', '.join(scene.bounds_of_speed[1:])}"
    borders, speed = np.arange(SPEEDS + 1.0), _rates(scene, scene.speed, SPEEDS)
    yield _Axes("Rate against speed", label, _PER_PIXEL, borders, speed, x_names=SPEED_NAMES)
    contrasts = np.digitize(contrast(scene), _CONTRASTS[1:-1])
    label = "range of log light within 50 ms [ln]"
    for name, on in _POLARITIES:
        measure = _rates(scene, contrasts, len(_CONTRASTS) - 1, on)
        title = f"Rate against contrast, {name}"
        yield _Axes(title, label, _PER_PIXEL, _CONTRASTS, measure, x_log=True)
    yield _Axes(
        "Light before and after an event",
        "time before the event [ms]",
        "mean change of log light in its direction, at most 20 [1/s]",
        np.array(LAGS_MS),
        _lags(scene),
    )
    borders = np.rint(np.linspace(0.0, scene.height, min(scene.height, _MOST_ROWS) + 1))
    row = np.searchsorted(borders, np.arange(scene.pixels) // scene.width, "right") - 1
    rows = _rates(scene, row[None], len(borders) - 1)
    yield _Axes("Rate against row", "row, from the top [pixels]", _PER_PIXEL, borders, rows)


def _by_time(scene: Scene, before: Sequence[Placed]) -> Iterator[_Axes]:
    """Yield rates by that of the declared model, between two frames, and over the recording."""
    declared = rate_hz(scene, before)
    loads, load = np.unique(by_load(declared, _LOADS), return_inverse=True)
    number = np.bincount(load, declared * scene.seconds)
    of_load = _rates(scene, load[:, None], len(loads))
    yield _Axes(
        "Rate of the sensor, from times of few events to times of many",
        "rate of the declared model [events a second]",
        _PER_SENSOR,
        number / np.bincount(load, scene.seconds),
        lambda placed: scene.pixels * of_load(placed),
    )
    if scene.leaps is not None:
        for name, on in _POLARITIES:
            title, label = f"Events after a leap of the light, {name}", "time since the leap [ms]"
            yield _in_bins(
                title, label, _SINCE_LEAP_MS, partial(_since_leap, leaps=scene.leaps, on=on)
            )
    else:
        for text, moving in _MOTION:
            title, label = f"Place between two frames, {text}", "place [% of the frame interval]"
            values = partial(_phases, scene=scene, moving=moving)
            yield _in_bins(title, label, _PHASES, values, x_log=False)
    borders_s = np.linspace(0.0, float(scene.seconds.sum()), 25)
    start, width = scene.times_us[0], borders_s[1] - borders_s[0]

    def course(placed: Placed) -> Array:
        number, _ = np.histogram((placed.stream.t - start) * 1e-6, borders_s)
        return np.asarray(number / width)

    yield _Axes("Events over time", "time after the start [s]", _PER_SENSOR, borders_s, course)


def contrast(scene: Scene) -> NDArray[np.float32]:
    """Return the contrast [ln] that each place sees, (frame intervals, pixels).

    It is the range of its log light within 50 ms about the middle of the interval, or from one
    frame to the next where frames are as far apart.
    """
    seconds = scene.seconds.astype(np.float32)
    light = np.zeros((scene.intervals + 1, scene.pixels), np.float32)
    np.cumsum(scene.slope * seconds[:, None], axis=0, out=light[1:])
    beside = int(max(0.0, 0.5 * (_CONTRAST_S / float(np.median(seconds)) - 1.0)))
    high, low = light[1:].copy(), light[1:].copy()
    for step in range(-beside, beside + 2):
        frame = np.clip(np.arange(scene.intervals) + step, 0, scene.intervals)
        np.maximum(high, light[frame], out=high)
        np.minimum(low, light[frame], out=low)
    return high - low


def _gaps(placed: Placed, same: bool) -> Array:
    """Return times between events of a pixel [ms], of the same or of the other polarity."""
    stream = placed.stream
    used = (stream.since >= 0) & ((stream.on == stream.on_before) == same)
    return np.asarray(np.clip(stream.since[used] * 1e-3, _GAPS_MS[0], _GAPS_MS[-1]))


def _stamps(placed: Placed, same: bool) -> Array:
    """Return times between events of the whole sensor [us], of the same row or of another."""
    stream = placed.stream
    used = (np.diff(stream.pixel // stream.width) == 0) == same
    return np.asarray(np.clip(np.diff(stream.t)[used], _STAMPS_US[0], _STAMPS_US[-1]))


def _phases(placed: Placed, scene: Scene, moving: bool) -> Array:
    """Return the places of events between two frames [%], in motion or at rest."""
    used = (placed.speed != STILL) == moving
    return 100.0 * scene.phase_of(placed.stream.t[used], placed.interval[used])


def _since_leap(placed: Placed, leaps: Leaps, on: int) -> Array:
    """Return the times from the light's last leap to events of a polarity [ms]."""
    since = leaps.since(placed.stream)
    used = (since >= 0) & (placed.stream.on == on)
    return np.asarray(np.maximum(since[used] * 1e-3, _SINCE_LEAP_MS[0]))


def _rates(scene: Scene, kind: NDArray[Any], classes: int, on: int | None = None) -> Measure:
    """Return rates of classes of places [events a pixel a second], NaN for those none is in.

    `kind`: of each pixel in each frame interval, (frame intervals, pixels), or nowhere; `on`: of
    one polarity alone.
    """
    kind = np.broadcast_to(kind, scene.slope.shape)
    weight = np.broadcast_to(scene.seconds[:, None], kind.shape)
    used = kind != _NOWHERE
    time = np.bincount(kind[used], weight[used], minlength=classes)

    def measure(placed: Placed) -> Array:
        of_events = kind[placed.interval, placed.stream.pixel]
        chosen = of_events != _NOWHERE
        if on is not None:
            chosen &= placed.stream.on == on
        number = np.bincount(of_events[chosen], minlength=classes)
        return np.where(time > 0.0, number / np.maximum(time, 1e-9), np.nan)

    return measure


def _lags(scene: Scene) -> Measure:
    """Return the mean slope of log light about events, in their direction [1/s], by lag."""

    def measure(placed: Placed) -> Array:
        stream = placed.stream
        if not len(stream):
            return np.full(len(LAGS_MS), np.nan)
        sign = 2.0 * stream.on - 1.0
        values = []
        for lag in LAGS_MS:
            slope = scene.slope[scene.interval_of(stream.t, lag * 1e3), stream.pixel]
            values.append(float(np.mean(np.clip(slope, -_STEEPEST, _STEEPEST) * sign)))
        return np.array(values)

    return measure
