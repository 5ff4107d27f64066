"""How many events there are, by polarity, speed, brightness, time and total rate."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.markers.base import (
    LIGHT_NAMES,
    POLARITIES,
    SPEED_NAMES,
    Entry,
    Raw,
    counts,
    stabilised,
)
from adv2e.diagnosis.scene import BRIGHTNESSES, SPEEDS, STILL, Placed


class Rates:
    """Numbers of events by speed, brightness and polarity."""

    title = "number of events"
    least = 0.6

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"{p} events, {speed}, {light}",
                f"number of {p} events where the picture is {light} and {speed}",
                is_number=True,
            )
            for speed in SPEED_NAMES
            for light in LIGHT_NAMES
            for p in POLARITIES
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        cell = (placed.speed * BRIGHTNESSES + placed.brightness) * 2 + placed.stream.on
        return counts(placed.part, cell, SPEEDS * BRIGHTNESSES * 2)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        return stabilised(raw)


class Course:
    """Numbers of events over the time of the recording."""

    title = "course in time"
    least = 0.6

    def __init__(self, start_us: float, stop_us: float, steps: int = 6) -> None:
        self._borders = np.linspace(start_us, stop_us, steps + 1)[1:-1]
        self._steps = steps

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"{p} events, {where}, time {k + 1}/{self._steps}",
                f"number of {p} events {where} in part {k + 1} of {self._steps} of the time",
                is_number=True,
            )
            for k in range(self._steps)
            for where in ("at rest", "in motion")
            for p in POLARITIES
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        step = np.searchsorted(self._borders, placed.stream.t, "right")
        cell = (step * 2 + (placed.speed != STILL)) * 2 + placed.stream.on
        return counts(placed.part, cell, self._steps * 4)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        return stabilised(raw)


class Load:
    """Numbers of events when few and when many come from the whole sensor."""

    title = "load of the readout"
    least = 0.6

    def __init__(self, rate_hz: NDArray[np.float64], steps: int = 5) -> None:
        """`rate_hz`: (frame intervals,) events a second that the declared model makes."""
        order = np.argsort(rate_hz, kind="stable")
        total = np.cumsum(rate_hz[order])
        step = np.minimum(steps * total / max(total[-1], 1e-9), steps - 1e-9).astype(np.int64)
        self._step_of = np.empty(len(rate_hz), np.int64)
        self._step_of[order] = step
        self._steps = steps

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"{p} events, load {k + 1}/{self._steps}",
                f"number of {p} events at times when the declared model's rate over the whole"
                f" sensor is in part {k + 1} of {self._steps}",
                is_number=True,
            )
            for k in range(self._steps)
            for p in POLARITIES
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        cell = self._step_of[placed.interval] * 2 + placed.stream.on
        return counts(placed.part, cell, self._steps * 2)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        return stabilised(raw)
