"""When events come after the change that makes them, and where: lag, drift of the clock, shift."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis import parts
from adv2e.diagnosis.markers.base import LIGHT_NAMES, Entry, Raw, counts, share
from adv2e.diagnosis.markers.counting import sum_slopes, sum_slopes_beside
from adv2e.diagnosis.scene import BRIGHTNESSES, Placed, Scene

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


class Phase:
    """Numbers of events by their place between two frames."""

    title = "place between frames"
    least = 0.6

    _STEPS = 10

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"{p} events, {where}, {k * 10}-{k * 10 + 10} % after a frame",
                f"number of {p} events {where} in that part of the time between frames, less a"
                " tenth of all of them, in deviations of chance",
            )
            for k in range(self._STEPS)
            for where in ("at rest", "in motion")
            for p in ("OFF", "ON")
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        times = self._scene.times_us
        begin = times[placed.interval]
        phase = (placed.stream.t - begin) / (times[placed.interval + 1] - begin)
        step = np.clip((phase * self._STEPS).astype(np.int64), 0, self._STEPS - 1)
        cell = (step * 2 + (placed.speed > 0)) * 2 + placed.stream.on
        return counts(placed.part, cell, self._STEPS * 4)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics: shares of the events of their kind, relative to chance."""
        number = raw.reshape(self._STEPS, 4)
        whole = number.sum(axis=0)
        return np.asarray((number - whole / self._STEPS) / np.sqrt(whole / self._STEPS + 1)).ravel()


def keeps_time(hz: NDArray[Any], scene: Scene) -> NDArray[np.bool_]:
    """Tell which frequencies [Hz] are near whole multiples of the frame rate."""
    rate = 1e6 * scene.intervals / (scene.times_us[-1] - scene.times_us[0])
    near = np.abs(hz / rate - np.round(hz / rate)) * rate <= 1.5
    return np.asarray(near & (hz >= rate - 2.0))


def above_beside(log: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return logarithms of power less the median of those within `reach` places."""
    padded = np.pad(log, reach, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(log - np.median(around, axis=1))


class Spectrum:
    """Lines in the rate of the whole sensor, as lamps on the mains make."""

    title = "lines in the rate"
    least = 0.2

    BIN_US = 1000
    _BANDS_HZ = ((30, 90), (90, 99), (99, 101), (101, 119), (119, 121), (121, 240), (240, 490))

    def __init__(self, scene: Scene) -> None:
        self._start = scene.times_us[0]
        self._bins = max(64, int((scene.times_us[-1] - self._start) // self.BIN_US))
        self.hz = np.fft.rfftfreq(self._bins, self.BIN_US * 1e-6)
        # what keeps time with the frames has statistics of its own
        self.free = ~keeps_time(self.hz, scene)

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"line in the {kind} rate, {low}-{high} Hz",
                f"strongest line of the {kind} rate between {low} and {high} Hz over what is"
                " beside it, as a logarithm",
            )
            for kind in ("total", "signed")
            for low, high in self._BANDS_HZ
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream = placed.stream
        step = ((stream.t - self._start) // self.BIN_US).astype(np.int64)
        step = np.clip(step, 0, self._bins - 1)
        total = counts(placed.part, step, self._bins)
        signed = counts(placed.part, step, self._bins, 2.0 * stream.on - 1.0)
        return np.concatenate([total, signed], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        power = [self._prominence(rate) for rate in raw.reshape(2, -1)]
        result = []
        for line in power:
            for low, high in self._BANDS_HZ:
                band = line[(self.hz >= low) & (self.hz <= high) & self.free]
                result.append(float(band.max()) if band.size else 0.0)
        return np.array(result)

    def _prominence(self, rate: Raw) -> NDArray[np.float64]:
        """Return log power less that of the frequencies beside."""
        window = np.hanning(self._bins)
        power = np.abs(np.fft.rfft((rate - rate.mean()) * window)) ** 2 + 1.0
        return above_beside(np.log(power), max(3, int(np.searchsorted(self.hz, 12.0))))
