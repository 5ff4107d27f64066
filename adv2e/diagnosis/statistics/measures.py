"""What the curves of a residual show of a stream: numbers and rates of events by when and where.

Each function returns a measure, which turns the events of one stream into the values of a curve.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import STILL, Placed, Scene
from adv2e.diagnosis.statistics.timing import LAGS_MS

Array = NDArray[np.float64]
Measure = Callable[[Placed], Array]

NOWHERE = -1
"""Class of a place that is not looked at."""
_STEEPEST = 20.0
"""Change of log light [1/s] at which slopes are cut off, so that single steps do not decide."""


def gaps(borders_ms: Array, *, same: bool) -> Measure:
    """Count times between events of a pixel, of the same or of the other polarity."""

    def measure(placed: Placed) -> Array:
        stream = placed.stream
        used = (stream.since >= 0) & ((stream.on == stream.on_before) == same)
        gap = np.clip(stream.since[used] * 1e-3, borders_ms[0], borders_ms[-1])
        return np.histogram(gap, borders_ms)[0].astype(np.float64)

    return measure


def stamps(borders_us: Array, *, same: bool) -> Measure:
    """Count times between events of the whole sensor, of the same row or of another."""

    def measure(placed: Placed) -> Array:
        stream = placed.stream
        used = (np.diff(stream.pixel // stream.width) == 0) == same
        gap = np.clip(np.diff(stream.t)[used], borders_us[0], borders_us[-1])
        return np.histogram(gap, borders_us)[0].astype(np.float64)

    return measure


def rates(scene: Scene, kind: NDArray[Any], classes: int, on: int | None = None) -> Measure:
    """Return rates of classes of places [events a pixel a second].

    Parameters
    ----------
    scene : Scene
    kind : (frame intervals, pixels)
        Class of each pixel in each frame interval, or :data:`NOWHERE`; may be broadcast.
    classes : int
    on : int, optional
        Polarity; default: both.

    Returns
    -------
    Measure
        NaN for classes that no place has.
    """
    kind = np.broadcast_to(kind, scene.slope.shape)
    weight = np.broadcast_to(scene.seconds[:, None], kind.shape)
    used = kind != NOWHERE
    time = np.bincount(kind[used], weight[used], minlength=classes)

    def measure(placed: Placed) -> Array:
        of_events = kind[placed.interval, placed.stream.pixel]
        chosen = of_events != NOWHERE
        if on is not None:
            chosen &= placed.stream.on == on
        number = np.bincount(of_events[chosen], minlength=classes)
        return np.where(time > 0.0, number / np.maximum(time, 1e-9), np.nan)

    return measure


def restricted(scene: Scene, kind: NDArray[Any], *, moving: bool) -> NDArray[np.int64]:
    """Return classes of the places in motion, or at rest, alone."""
    return np.where((scene.speed != STILL) == moving, kind.astype(np.int64), NOWHERE)


def lags(scene: Scene) -> Measure:
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


def phases(scene: Scene, borders: Array, *, moving: bool) -> Measure:
    """Count events by their place between two frames [%], in motion or at rest."""

    def measure(placed: Placed) -> Array:
        used = (placed.speed != STILL) == moving
        phase = scene.phase_of(placed.stream.t[used], placed.interval[used])
        return np.histogram(100.0 * phase, borders)[0].astype(np.float64)

    return measure


def course(scene: Scene, borders_s: Array) -> Measure:
    """Return the rate of the whole sensor over time [events a second]."""
    start, width = scene.times_us[0], borders_s[1] - borders_s[0]

    def measure(placed: Placed) -> Array:
        number, _ = np.histogram((placed.stream.t - start) * 1e-6, borders_s)
        return np.asarray(number / width)

    return measure
