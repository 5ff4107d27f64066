"""How many events there are: by polarity, speed, brightness, time, rate, place between frames."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import BRIGHTNESSES, SPEEDS, STILL, Placed, Scene
from adv2e.diagnosis.statistics.base import (
    LIGHT_NAMES,
    POLARITIES,
    SPEED_NAMES,
    Entry,
    Numbers,
    Raw,
    counts,
    excess,
)
from adv2e.diagnosis.statistics.classes import by_load


class Rates(Numbers):
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


class Course(Numbers):
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


class Load(Numbers):
    """Numbers of events when few and when many come from the whole sensor."""

    title = "load of the readout"
    least = 0.6

    def __init__(self, rate_hz: NDArray[np.float64], steps: int = 5) -> None:
        """`rate_hz`: (frame intervals,) events a second that the declared model makes."""
        self._step_of = by_load(rate_hz, steps)
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
        phase = self._scene.phase_of(placed.stream.t, placed.interval)
        step = np.clip((phase * self._STEPS).astype(np.int64), 0, self._STEPS - 1)
        cell = (step * 2 + (placed.speed > 0)) * 2 + placed.stream.on
        return counts(placed.part, cell, self._STEPS * 4)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics: shares of the events of their kind, relative to chance."""
        number = raw.reshape(self._STEPS, 4)
        whole = number.sum(axis=0)
        return excess(number, whole / self._STEPS).ravel()
