"""Event counts by polarity, speed, brightness, time, rate and phase, and the sums of each."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.diagnosis.data.scene import (
    BRIGHTNESSES,
    LIGHT_NAMES,
    SPEED_NAMES,
    SPEEDS,
    STILL,
    Placed,
    Scene,
)
from adv2e.diagnosis.data.stimulus import Leaps
from adv2e.diagnosis.statistics.groups import (
    POLARITIES,
    SURPLUS,
    Array,
    Entry,
    Group,
    counts,
    excess,
    numbers,
)

_MOTION = ("at rest", "in motion")
_COURSE, _LOADS, _PHASES = 6, 5, 10
_SINCE_BURST_US = (150, 300, 600, 1200, 2400, 4800)
_BEFORE_US = 50.0
"""A burst may begin earlier than it was found to by so much."""
SINCE_LEAP_MS = (
    *(0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 32.0),
    *(64.0, 128.0),
)


def rates(scene: Scene) -> Group:
    """Return numbers of events by speed, brightness and polarity."""
    entries = numbers(
        (
            f"{p} events, {speed}, {light}",
            f"{p} events where the picture is {scene.bounds_of_light[j]} and"
            f" {scene.bounds_of_speed[k]}",
        )
        for k, speed in enumerate(SPEED_NAMES)
        for j, light in enumerate(LIGHT_NAMES)
        for p in POLARITIES
    )

    def count(placed: Placed) -> Array:
        cell = (placed.speed * BRIGHTNESSES + placed.brightness) * 2 + placed.stream.on
        return counts(placed.part, cell, SPEEDS * BRIGHTNESSES * 2)

    return Group("number of events", 0.6, entries, count, kind="count")


def course(start_us: float, stop_us: float) -> Group:
    """Return numbers of events over the time of the recording."""
    borders_us = np.linspace(start_us, stop_us, _COURSE + 1)
    borders, spans = borders_us[1:-1], spans_text(borders_us)
    entries = numbers(
        (f"{p} events, {where}, time {k + 1}/{_COURSE}", f"{p} events {where} {spans[k]}")
        for k in range(_COURSE)
        for where in _MOTION
        for p in POLARITIES
    )

    def count(placed: Placed) -> Array:
        step = np.searchsorted(borders, placed.stream.t, "right")
        cell = (step * 2 + (placed.speed != STILL)) * 2 + placed.stream.on
        return counts(placed.part, cell, _COURSE * 4)

    return Group("events over time", 0.6, entries, count, kind="count")


def spans_text(borders_us: Array) -> list[str]:
    """Return the time spans of the parts of a recording in words, from their borders [us]."""
    seconds = (borders_us - borders_us[0]) * 1e-6
    return [f"from {a:.3g} to {b:.3g} s of the recording" for a, b in itertools.pairwise(seconds)]


def rate_hz(scene: Scene, simulations: Sequence[Placed]) -> Array:
    """Return the event rate of the sensor in each frame interval [1/s], mean of simulations."""
    number = [np.bincount(one.interval, minlength=scene.intervals) for one in simulations]
    return np.asarray(np.mean(number, axis=0) / scene.seconds)


def by_load(rate_hz: Array, steps: int) -> NDArray[np.int64]:
    """Return the class of event rate of each frame interval, 0 to `steps` - 1, (intervals,).

    `rate_hz`: event rate of the whole sensor by a model, (intervals,).  Each class holds about as
    many events.
    """
    order = np.argsort(rate_hz, kind="stable")
    total = np.cumsum(rate_hz[order])
    step = np.empty(len(rate_hz), np.int64)
    step[order] = np.minimum(steps * total / max(total[-1], 1e-9), steps - 1e-9).astype(np.int64)
    return step


def load(rate_hz: Array) -> Group:
    """Return numbers of events when few and when many come from the whole sensor.

    `rate_hz`: (frame intervals,) events a second that the declared model makes.
    """
    step_of = by_load(rate_hz, _LOADS)
    entries = numbers(
        (
            f"{p} events, load {k + 1}/{_LOADS}",
            f"{p} events at the times when the declared model makes"
            f" {_range_text(rate_hz[step_of == k])} events a second on the whole sensor",
        )
        for k in range(_LOADS)
        for p in POLARITIES
    )

    def count(placed: Placed) -> Array:
        return counts(placed.part, step_of[placed.interval] * 2 + placed.stream.on, _LOADS * 2)

    return Group("load of the readout", 0.6, entries, count, kind="count")


def _range_text(rates: Array) -> str:
    return f"{rates.min():,.0f} to {rates.max():,.0f}" if rates.size else "no"


def phase(scene: Scene) -> Group:
    """Return numbers of events by their place between two frames, relative to chance."""
    entries = [
        Entry(
            f"{p} events, {where}, {k * 10}-{k * 10 + 10} % after a frame",
            f"surplus of {p} events {where} from {k * 10} to {k * 10 + 10} % of the time between"
            " two frames over a tenth of all, in standard deviations (sd) of chance",
            SURPLUS,
        )
        for k in range(_PHASES)
        for where in _MOTION
        for p in POLARITIES
    ]

    def count(placed: Placed) -> Array:
        at = scene.phase_of(placed.stream.t, placed.interval)
        step = np.clip((at * _PHASES).astype(np.int64), 0, _PHASES - 1)
        cell = (step * 2 + (placed.speed != STILL)) * 2 + placed.stream.on
        return counts(placed.part, cell, _PHASES * 4)

    def values(raw: Array) -> Array:
        number = raw.reshape(_PHASES, 4)
        return excess(number, number.sum(axis=0) / _PHASES).ravel()

    return Group("time since the last frame", 0.6, entries, count, values, kind="time")


def since_leap(scene: Scene, leaps: Leaps) -> Group:
    """Return numbers of events by the time since the light leapt, polarity and brightness."""
    bins = list(zip((0.0, *SINCE_LEAP_MS), SINCE_LEAP_MS, strict=False))
    entries = numbers(
        (
            f"{p} events {a:g}-{b:g} ms after a leap, {light}",
            f"{p} events {a:g} to {b:g} ms after the light leapt, where it is"
            f" {scene.bounds_of_light[j]}",
        )
        for a, b in bins
        for j, light in enumerate(LIGHT_NAMES)
        for p in POLARITIES
    )
    borders_us = np.array(SINCE_LEAP_MS) * 1e3

    def count(placed: Placed) -> Array:
        since = leaps.since(placed.stream)
        used = (since >= 0) & (since < borders_us[-1])
        step = np.searchsorted(borders_us, since[used], "right")
        cell = (step * BRIGHTNESSES + placed.brightness[used]) * 2 + placed.stream.on[used]
        return counts(placed.part[used], cell, len(entries))

    return Group("time since the light leapt", 0.6, entries, count, kind="time")


def since_burst(period_us: float, begins_us: float) -> Group:
    """Return numbers of events by the time since the last burst of all pixels.

    Bursts begin `begins_us` after zero of the clock, and come again after `period_us`.
    """
    borders = np.array([border for border in _SINCE_BURST_US if border < period_us])
    entries = numbers(
        (
            f"{p} events {a}-{b} us after a burst, {where}",
            f"{p} events {where} that come {a} to {b} us after a burst of all pixels begins",
        )
        for a, b in zip((0, *borders[:-1]), borders, strict=True)
        for where in _MOTION
        for p in POLARITIES
    )

    def count(placed: Placed) -> Array:
        since = (placed.stream.t - begins_us + _BEFORE_US) % period_us
        step = np.searchsorted(borders, since - _BEFORE_US, "right")
        used = step < len(borders)
        cell = ((step * 2 + (placed.speed != STILL)) * 2 + placed.stream.on)[used]
        return counts(placed.part[used], cell, len(entries))

    return Group("time since a burst of all pixels", 0.6, entries, count, kind="time")


# ---- Sums over the events of a stream, compiled: they run beside simulations without the lock.
#
# Arguments in common: time [us], pixel, polarity and part of each event; `times`, (frames,), and
# `lags` [us]; `slope`, (frames - 1, pixels).  Some events look at few frames, which stay in cache:
# at those of one lag after another, and then come the next events.

_EVENTS = 2048


@kernel
def _frame_of(t: int, lag: float, times: Any, f: int) -> int:
    """Return the frame interval that lies `lag` before a time [us], the f-th or a later one."""
    while f < times.shape[0] - 2 and t >= times[f + 1] + lag:
        f += 1
    return f


@kernel
def _end_of(f: int, lag: float, times: Any) -> float:
    """Return the time before which events look at a frame interval [us]."""
    return times[f + 1] + lag if f < times.shape[0] - 2 else np.inf


@kernel
def sum_slopes(
    t: Any, pixel: Any, on: Any, cell: Any, times: Any, lags: Any, slope: Any, sums: Any
) -> None:
    """Add up the change of light some time before each event, in the event's direction.

    `cell`: (events,) column of `sums`, (lags, cells), that the event counts for.
    """
    at = np.zeros(lags.shape[0], np.int64)
    for begin in range(0, t.shape[0], _EVENTS):
        stop = min(begin + _EVENTS, t.shape[0])
        for j in range(lags.shape[0]):
            i, f, own = begin, at[j], sums[j]
            while i < stop:
                f = _frame_of(t[i], lags[j], times, f)
                end, now = _end_of(f, lags[j], times), slope[f]
                while i < stop and t[i] < end:
                    own[cell[i]] += now[pixel[i]] if on[i] else -now[pixel[i]]
                    i += 1
            at[j] = f


@kernel
def count_neighbours(
    t: Any, pixel: Any, on: Any, part: Any, width: int, borders: Any, last: Any, number: Any
) -> None:
    """Count the times since the latest event of the four neighbouring pixels.

    `last`, (pixels + 2 width, 2): time of the latest event of each pixel and polarity [us], long
    ago at first, as in the row above and below the sensor; `number`, (parts, 2, borders + 1): after
    an event of the other, and of the same, polarity.
    """
    for k in range(t.shape[0]):
        i, p = width + pixel[k], on[k]
        left, right = pixel[k] % width > 0, pixel[k] % width < width - 1
        for same in range(2):
            q = p if same else 1 - p
            latest = max(last[i - width, q], last[i + width, q])
            if left:
                latest = max(latest, last[i - 1, q])
            if right:
                latest = max(latest, last[i + 1, q])
            gap, bin_ = t[k] - latest, np.int64(0)
            while bin_ < borders.shape[0] and gap >= borders[bin_]:
                bin_ += 1
            number[part[k], same, bin_] += 1.0
        last[i, p] = t[k]


@kernel
def find_places(begins: Any, before: Any, places: Any) -> None:
    """Compute the place of each event in its run, from 0, into `places`.

    `begins`: whether it is the first; `before`: the event before it in its pixel.
    """
    for k in range(begins.shape[0]):
        places[k] = 0 if begins[k] else places[before[k]] + 1
