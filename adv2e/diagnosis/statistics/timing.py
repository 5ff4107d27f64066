"""Lag of events behind the change of light, its drift over time, and shift in space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import BRIGHTNESSES, LIGHT_NAMES, Placed, Scene
from adv2e.diagnosis.statistics.counting import sum_slopes, sum_slopes_beside
from adv2e.diagnosis.statistics.groups import Array, Entry, Group, counts, share
from adv2e.diagnosis.statistics.rates import spans_text
from adv2e.reports.quantities import NO_UNIT

LAGS_MS = (-20.0, -8.0, -4.0, -2.0, 0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
_PAIRS_MS = ((-2.0, 4.0), (-8.0, 16.0))
_BESIDE_MS = (2.0, 10.0)


class Slopes:
    """Change of log light about events, bounded so that single large steps do not decide.

    `change`: what is summed up, in words; from -1 to 1.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        moving = np.abs(scene.slope[scene.speed > 0])
        typical = max(float(np.median(moving)) if moving.size else 1.0, 1e-6)
        bounded = scene.slope / (np.abs(scene.slope) + np.float32(typical))
        self.change = f"mean change s of log light, as s/(|s| + {typical:.3g} ln/s),"
        self.bounded = np.ascontiguousarray(bounded.T)

    def count(
        self, placed: Placed, cell: NDArray[np.int64], cells: int, lags_ms: Sequence[float]
    ) -> Array:
        """Return events, then the change before them in their direction, summed.

        (parts, cells + lags x cells)
        """
        stream = placed.stream
        lags = 1e3 * np.array(lags_ms)
        sums = np.zeros((len(lags), splits.COUNT * cells))
        sum_slopes(
            stream.t, stream.pixel, stream.on, placed.part * cells + cell,
            self.scene.times_us, lags, self.bounded, np.zeros(len(lags), np.int64), sums,
        )  # fmt: skip
        by_part = sums.reshape(len(lags), splits.COUNT, cells).swapaxes(0, 1)
        number = counts(placed.part, cell, cells)
        return np.concatenate([number, by_part.reshape(splits.COUNT, -1)], axis=1)


def _when(lag_ms: float) -> str:
    """Return the words for a lag before an event; a negative one is after it."""
    return f"{abs(lag_ms):g} ms {'after' if lag_ms < 0.0 else 'before'}"


def lag(slopes: Slopes) -> Group:
    """Return the mean change of light before an event, in its direction, by brightness."""
    entries = [
        Entry(
            f"change {lag:g} ms before, {light}",
            f"{slopes.change} {_when(lag)} an event, in its direction, where it is"
            f" {slopes.scene.bounds_of_light[k]}",
            NO_UNIT,
        )
        for lag in LAGS_MS
        for k, light in enumerate(LIGHT_NAMES)
    ]

    def count(placed: Placed) -> Array:
        return slopes.count(placed, placed.brightness, BRIGHTNESSES, LAGS_MS)

    def values(raw: Array) -> Array:
        number, *sums = raw.reshape(-1, BRIGHTNESSES)
        return share(np.array(sums), number).ravel()

    return Group("lag behind the light", 0.002, entries, count, values)


def drift(slopes: Slopes) -> Group:
    """Return statistics of the lag by segment of time, which show a drift of the clock."""
    segments = slopes.scene.split.segments
    spans = spans_text(slopes.scene.split.borders_us)
    entries = [
        Entry(
            f"lag {b:g} less {a:g} ms, time {k + 1}/{segments}",
            f"{slopes.change} {_when(b)} an event less that {_when(a)} it, {spans[k]}",
            NO_UNIT,
        )
        for a, b in _PAIRS_MS
        for k in range(segments)
    ]

    def count(placed: Placed) -> Array:
        return slopes.count(placed, placed.segment, segments, np.ravel(_PAIRS_MS).tolist())

    def values(raw: Array) -> Array:
        sums = raw[segments:].reshape(len(_PAIRS_MS), 2, segments)
        return share(sums[:, 1] - sums[:, 0], raw[:segments]).ravel()

    return Group("lag over time", 0.002, entries, count, values)


def shift(slopes: Slopes) -> Group:
    """Return statistics of the change of light beside events, which show a shift in space."""
    entries = [
        Entry(
            f"change {name} of the event, {lag:g} ms before",
            f"{slopes.change} one pixel {side} an event less that on its other side,"
            f" {_when(lag)} it, in its direction",
            NO_UNIT,
        )
        for lag in _BESIDE_MS
        for name, side in (("right", "right of"), ("below", "below"))
    ]
    lags = 1e3 * np.array(_BESIDE_MS)

    def count(placed: Placed) -> Array:
        stream, scene = placed.stream, slopes.scene
        x, y = stream.pixel % scene.width, stream.pixel // scene.width
        used = (x > 0) & (y > 0) & (x < scene.width - 1) & (y < scene.height - 1)
        number = np.bincount(placed.part[used], minlength=splits.COUNT)
        sums = np.zeros((2 * len(lags), splits.COUNT))
        sum_slopes_beside(
            stream.t, stream.pixel, stream.on, placed.part, scene.width, scene.height,
            scene.times_us, lags, slopes.bounded, np.zeros(len(lags), np.int64), sums,
        )  # fmt: skip
        return np.concatenate([number[:, None], sums.T], axis=1)

    def values(raw: Array) -> Array:
        return share(raw[1:], raw[0])

    return Group("place where the light changes", 0.002, entries, count, values)
