"""The picture of a residual: curves and maps of the recording and of both models' simulations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import BRIGHTNESSES, SPEEDS, Placed, Scene
from adv2e.diagnosis.statistics import classes, measures
from adv2e.diagnosis.statistics.base import excess
from adv2e.diagnosis.statistics.intervals import BORDERS_MS
from adv2e.diagnosis.statistics.measures import Measure
from adv2e.diagnosis.statistics.timing import LAGS_MS
from adv2e.reports.result import Band, Curve, ResidualMap

Array = NDArray[np.float64]

_PER_PIXEL = "events a pixel a second"
_MOTION = (("in motion", True), ("at rest", False))
_POLARITIES = (("ON", 1), ("OFF", 0))
_LOADS = 8
_GAPS_MS = np.array([0.05, *BORDERS_MS, 512.0])
_STAMPS_US = np.r_[0.5, 2.0 ** np.arange(14.0) + 0.5]
"""Borders between whole numbers of microseconds, the first for none and one together."""


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

    def curves(self) -> list[Curve]:
        """Return all curves: by time, by what the light does, by place, by load."""
        return [
            *self._between_events(),
            *self._by_brightness(),
            *self._by_change(),
            self._by_row(),
            self._by_load(),
            *self._between_frames(),
            self._course(),
        ]

    def maps(self) -> list[ResidualMap]:
        """Return maps of the excess of events, ON and OFF."""
        return [
            ResidualMap(
                f"{name} events: measured less expected, in deviations of chance",
                self._excess(on, self._before),
                self._excess(on, self._after),
            )
            for name, on in _POLARITIES
        ]

    def _between_events(self) -> list[Curve]:
        """Return curves of the times between events of a pixel, and of the whole sensor."""
        gaps_ms, stamps_us = _GAPS_MS, _STAMPS_US
        of_pixel, of_sensor = "the event before [ms]", "the event before, of any pixel [us]"
        kinds = [
            ("a pixel, same polarity", of_pixel, gaps_ms, measures.gaps(gaps_ms, same=True)),
            ("a pixel, other polarity", of_pixel, gaps_ms, measures.gaps(gaps_ms, same=False)),
            ("the sensor, same row", of_sensor, stamps_us, measures.stamps(stamps_us, same=True)),
            ("the sensor, other row", of_sensor, stamps_us, measures.stamps(stamps_us, same=False)),
        ]
        return [
            self._curve(
                f"Time between events of {text}", f"time since {since}", "events", borders, measure,
                x_log=True,
            )
            for text, since, borders, measure in kinds
        ]  # fmt: skip

    def _by_brightness(self) -> list[Curve]:
        scene = self._scene
        return [
            self._curve(
                f"Rate against brightness, {text}, {name}",
                "brightness (thirds)",
                _PER_PIXEL,
                np.arange(BRIGHTNESSES + 1.0),
                measures.rates(
                    scene,
                    measures.restricted(scene, scene.brightness, moving=moving),
                    BRIGHTNESSES,
                    on,
                ),
            )
            for text, moving in _MOTION
            for name, on in _POLARITIES
        ]

    def _by_change(self) -> list[Curve]:
        """Return curves against how fast and how far the light changes, and when events follow."""
        scene = self._scene
        contrasts = classes.of_contrast(scene)
        return [
            self._curve(
                "Rate against speed",
                "speed (still, then thirds)",
                _PER_PIXEL,
                np.arange(SPEEDS + 1.0),
                measures.rates(scene, scene.speed, SPEEDS),
            ),
            *(
                self._curve(
                    f"Rate against contrast, {name}",
                    "change of log light within 50 ms [ln]",
                    _PER_PIXEL,
                    classes.CONTRASTS,
                    measures.rates(scene, contrasts, len(classes.CONTRASTS) - 1, on),
                    x_log=True,
                )
                for name, on in _POLARITIES
            ),
            self._curve(
                "Light before and after an event",
                "time before the event [ms]",
                "mean change of log light in its direction, at most 20 [1/s]",
                np.array(LAGS_MS),
                measures.lags(scene),
            ),
        ]

    def _by_row(self) -> Curve:
        scene = self._scene
        borders = classes.row_borders(scene)
        rows = classes.of_rows(scene, borders)
        return self._curve(
            "Rate against row",
            "row, from the top",
            _PER_PIXEL,
            borders,
            measures.rates(scene, rows, len(borders) - 1),
        )

    def _by_load(self) -> Curve:
        """Return the rate of the sensor against that of the declared model."""
        scene = self._scene
        declared = classes.rate_hz(scene, self._before)
        step = classes.by_load(declared, _LOADS)
        kinds, step = np.unique(step, return_inverse=True)
        number = np.bincount(step, declared * scene.seconds)
        whole = measures.rates(scene, step[:, None], len(kinds))
        return self._curve(
            "Rate of the sensor, from times of few events to times of many",
            "rate of the declared model [events a second]",
            "events a second",
            number / np.bincount(step, scene.seconds),
            lambda placed: scene.pixels * whole(placed),
        )

    def _between_frames(self) -> list[Curve]:
        phase = np.linspace(0.0, 100.0, 11)
        return [
            self._curve(
                f"Place between two frames, {text}",
                "place [% of the frame interval]",
                "events",
                phase,
                measures.phases(self._scene, phase, moving=moving),
            )
            for text, moving in _MOTION
        ]

    def _course(self) -> Curve:
        borders = np.linspace(0.0, float(self._scene.seconds.sum()), 25)
        return self._curve(
            "Course",
            "time [s]",
            "events a second",
            borders,
            measures.course(self._scene, borders),
        )

    def _curve(
        self,
        title: str,
        x_label: str,
        y_label: str,
        x: Array,
        measure: Measure,
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

    def _excess(self, on: int, simulated: Sequence[Placed]) -> Array:
        scene = self._scene

        def number(placed: Placed) -> Array:
            pixel = placed.stream.pixel[placed.stream.on == on]
            return np.bincount(pixel, minlength=scene.pixels).astype(np.float64)

        mean = np.mean([number(placed) for placed in simulated], axis=0)
        return excess(number(self._measured), mean).reshape(scene.height, scene.width)


def _band(rows: Sequence[Array]) -> Band:
    table = np.array(rows)
    low, middle, high = np.quantile(table, [0.025, 0.5, 0.975], axis=0)
    return Band(middle, low, high)
