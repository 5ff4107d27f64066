"""The picture of a residual: curves and maps of the recording and of both models' simulations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.markers.base import excess
from adv2e.diagnosis.markers.intervals import BORDERS_MS
from adv2e.diagnosis.markers.timing import LAGS_MS
from adv2e.diagnosis.scene import BRIGHTNESSES, SPEEDS, STILL, Placed, Scene
from adv2e.reports.result import Band, Curve, ResidualMap

Array = NDArray[np.float64]
_Measure = Callable[[Placed], Array]


class Gallery:
    """Draws curves and maps.

    Parameters
    ----------
    scene : Scene
    measured : Placed
    before, after : sequence of Placed
        Simulations of the declared model and of the model found.
    """

    def __init__(
        self, scene: Scene, measured: Placed, before: Sequence[Placed], after: Sequence[Placed]
    ) -> None:
        self._scene = scene
        self._measured, self._before, self._after = measured, before, after
        self._seconds = np.diff(scene.times_us) * 1e-6

    def curves(self) -> list[Curve]:
        """Return all curves."""
        gaps = np.array([0.05, *BORDERS_MS, 512.0])
        phase = np.linspace(0.0, 100.0, 11)
        course = np.linspace(0.0, float(self._seconds.sum()), 25)
        middle = np.array(LAGS_MS)
        return [
            *(
                self._curve(
                    f"Time between events of a pixel, {text}",
                    "time since the event before [ms]",
                    "events",
                    gaps,
                    _gap_counts(gaps, same),
                    x_log=True,
                )
                for text, same in (("same polarity", True), ("other polarity", False))
            ),
            *(
                self._curve(
                    f"Rate against brightness, {text}, {name}",
                    "brightness (thirds)",
                    "events a pixel a second",
                    np.arange(BRIGHTNESSES + 1.0),
                    self._rates(moving, on),
                )
                for text, moving in (("in motion", True), ("at rest", False))
                for name, on in (("ON", 1), ("OFF", 0))
            ),
            self._curve(
                "Rate against speed",
                "speed (still, then thirds)",
                "events a pixel a second",
                np.arange(SPEEDS + 1.0),
                self._by_speed,
            ),
            self._curve(
                "Light before and after an event",
                "time before the event [ms]",
                "mean change of log light in its direction, at most 20 [1/s]",
                middle,
                self._lags,
            ),
            self._curve(
                "Place between two frames, at rest",
                "place [% of the frame interval]",
                "events",
                phase,
                self._phases(phase),
            ),
            self._curve("Course", "time [s]", "events a second", course, self._course(course)),
        ]

    def maps(self) -> list[ResidualMap]:
        """Return maps of the excess of events, ON and OFF."""
        return [
            ResidualMap(
                f"{name} events: measured less expected, in deviations of chance",
                self._excess(on, self._before),
                self._excess(on, self._after),
            )
            for name, on in (("ON", 1), ("OFF", 0))
        ]

    def _curve(
        self,
        title: str,
        x_label: str,
        y_label: str,
        x: Array,
        measure: _Measure,
        x_log: bool = False,
    ) -> Curve:
        return Curve(
            title=title,
            x_label=x_label,
            y_label=y_label,
            x=x,
            measured=measure(self._measured),
            before=_band([measure(placed) for placed in self._before]),
            after=_band([measure(placed) for placed in self._after]),
            x_log=x_log,
        )

    def _rates(self, moving: bool, on: int) -> _Measure:
        scene = self._scene
        kind = (scene.speed != STILL) == moving
        weight = self._seconds[:, None] * kind
        time = np.bincount(scene.brightness.ravel(), weight.ravel(), minlength=BRIGHTNESSES)

        def measure(placed: Placed) -> Array:
            used = ((placed.speed != STILL) == moving) & (placed.stream.on == on)
            number = np.bincount(placed.brightness[used], minlength=BRIGHTNESSES)
            return np.where(time > 0.0, number / np.maximum(time, 1e-9), np.nan)

        return measure

    def _by_speed(self, placed: Placed) -> Array:
        scene = self._scene
        weight = np.broadcast_to(self._seconds[:, None], scene.speed.shape)
        time = np.bincount(scene.speed.ravel(), weight.ravel(), minlength=SPEEDS)
        number = np.bincount(placed.speed, minlength=SPEEDS)
        return np.where(time > 0.0, number / np.maximum(time, 1e-9), np.nan)

    def _lags(self, placed: Placed) -> Array:
        scene, stream = self._scene, placed.stream
        if not len(stream):
            return np.full(len(LAGS_MS), np.nan)
        sign = 2.0 * stream.on - 1.0
        values = []
        for lag in LAGS_MS:
            slope = scene.slope[scene.interval_of(stream.t, lag * 1e3), stream.pixel]
            values.append(float(np.mean(np.clip(slope, -20.0, 20.0) * sign)))
        return np.array(values)

    def _phases(self, borders: Array) -> _Measure:
        def measure(placed: Placed) -> Array:
            still = placed.speed == STILL
            phase = self._scene.phase_of(placed.stream.t[still], placed.interval[still])
            return np.histogram(100.0 * phase, borders)[0].astype(np.float64)

        return measure

    def _course(self, borders: Array) -> _Measure:
        start, width = self._scene.times_us[0], borders[1] - borders[0]

        def measure(placed: Placed) -> Array:
            number, _ = np.histogram((placed.stream.t - start) * 1e-6, borders)
            return np.asarray(number / width)

        return measure

    def _excess(self, on: int, simulated: Sequence[Placed]) -> Array:
        scene = self._scene

        def number(placed: Placed) -> Array:
            pixel = placed.stream.pixel[placed.stream.on == on]
            return np.bincount(pixel, minlength=scene.pixels).astype(np.float64)

        mean = np.mean([number(placed) for placed in simulated], axis=0)
        return excess(number(self._measured), mean).reshape(scene.height, scene.width)


def _gap_counts(borders_ms: Array, same: bool) -> _Measure:
    def measure(placed: Placed) -> Array:
        stream = placed.stream
        used = (stream.since >= 0) & ((stream.on == stream.on_before) == same)
        gap = np.clip(stream.since[used] * 1e-3, borders_ms[0], borders_ms[-1])
        return np.histogram(gap, borders_ms)[0].astype(np.float64)

    return measure


def _band(rows: Sequence[Array]) -> Band:
    table = np.array(rows)
    low, middle, high = np.quantile(table, [0.025, 0.5, 0.975], axis=0)
    return Band(middle, low, high)
