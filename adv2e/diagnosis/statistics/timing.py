"""When events come after the change that makes them, and where: lag, drift of the clock, shift."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.data.scene import BRIGHTNESSES, Placed, Scene
from adv2e.diagnosis.statistics.base import LIGHT_NAMES, Entry, Raw, counts, share
from adv2e.diagnosis.statistics.counting import sum_slopes, sum_slopes_beside

LAGS_MS = (-20.0, -8.0, -4.0, -2.0, 0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
_PAIRS_MS = ((-2.0, 4.0), (-8.0, 16.0))


class Slopes:
    """Change of log light about events, bounded so that single large steps do not decide.

    Attributes
    ----------
    scene : Scene
    bounded : (pixels, frames - 1)
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        moving = np.abs(scene.slope[scene.speed > 0])
        typical = float(np.median(moving)) if moving.size else 1.0
        bounded = scene.slope / (np.abs(scene.slope) + np.float32(max(typical, 1e-6)))
        self.bounded = np.ascontiguousarray(bounded.T)

    def sums(
        self, placed: Placed, cell: NDArray[np.int64], cells: int, lags_ms: Sequence[float]
    ) -> Raw:
        """Return the change before events, in their direction, summed: (parts, lags x cells)."""
        stream = placed.stream
        lags = 1e3 * np.array(lags_ms)
        sums = np.zeros((len(lags), parts.COUNT * cells))
        sum_slopes(
            stream.t, stream.pixel, stream.on, placed.part * cells + cell,
            self.scene.times_us, lags, self.bounded, np.zeros(len(lags), np.int64), sums,
        )  # fmt: skip
        by_part = sums.reshape(len(lags), parts.COUNT, cells).swapaxes(0, 1)
        return np.ascontiguousarray(by_part).reshape(parts.COUNT, -1)


class Lag:
    """Mean change of light before and after an event, in the event's direction, by brightness."""

    title = "lag behind the light"
    least = 0.002

    def __init__(self, slopes: Slopes) -> None:
        self._slopes = slopes

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"change {lag:g} ms before, {light}",
                f"mean change of log light {lag:g} ms before an event in its direction, bounded to"
                f" 1, in {light} places",
            )
            for lag in LAGS_MS
            for light in LIGHT_NAMES
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        number = counts(placed.part, placed.brightness, BRIGHTNESSES)
        sums = self._slopes.sums(placed, placed.brightness, BRIGHTNESSES, LAGS_MS)
        return np.concatenate([number, sums], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        number = raw[:BRIGHTNESSES]
        return share(raw[BRIGHTNESSES:].reshape(-1, BRIGHTNESSES), number).ravel()


class Drift:
    """Change of the lag from segment to segment of the recording."""

    title = "course of the lag"
    least = 0.002

    def __init__(self, slopes: Slopes) -> None:
        self._slopes = slopes
        self._segments = slopes.scene.parts.segments

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"lag {b:g} less {a:g} ms, time {k + 1}/{self._segments}",
                f"mean change of log light {b:g} ms before an event less that at {a:g} ms, in part"
                f" {k + 1} of {self._segments} of the time",
            )
            for a, b in _PAIRS_MS
            for k in range(self._segments)
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        number = counts(placed.part, placed.segment, self._segments)
        lags = [lag for pair in _PAIRS_MS for lag in pair]
        sums = self._slopes.sums(placed, placed.segment, self._segments, lags)
        return np.concatenate([number, sums], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        number = raw[: self._segments]
        sums = raw[self._segments :].reshape(len(_PAIRS_MS), 2, self._segments)
        return share(sums[:, 1] - sums[:, 0], number).ravel()


class Shift:
    """Whether the change that makes events lies beside them."""

    title = "place of the change"
    least = 0.002

    _LAGS_MS = (2.0, 10.0)

    def __init__(self, slopes: Slopes) -> None:
        self._slopes = slopes

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"change {side} of the event, {lag:g} ms before",
                f"mean change of log light one pixel {side} of an event less that on the other"
                f" side, {lag:g} ms before it, in its direction",
            )
            for lag in self._LAGS_MS
            for side in ("right", "below")
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream, scene = placed.stream, self._slopes.scene
        x, y = stream.pixel % scene.width, stream.pixel // scene.width
        used = (x > 0) & (y > 0) & (x < scene.width - 1) & (y < scene.height - 1)
        number = np.bincount(placed.part[used], minlength=parts.COUNT)
        lags = 1e3 * np.array(self._LAGS_MS)
        sums = np.zeros((2 * len(lags), parts.COUNT))
        sum_slopes_beside(
            stream.t, stream.pixel, stream.on, placed.part, scene.width, scene.height,
            scene.times_us, lags, self._slopes.bounded, np.zeros(len(lags), np.int64), sums,
        )  # fmt: skip
        return np.concatenate([number[:, None], sums.T], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        return share(raw[1:], raw[0])
