"""The model of a table of latencies, and the effects it may lack."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.tables.latency import first_crossing
from adv2e.diagnosis.tables.measurements import Latencies
from adv2e.diagnosis.tables.problem import Array, Declared, Problem, Settings, row_errors
from adv2e.errors import DataError

CUTOFF = "pixel.low_pass.cutoff_hz"
DARK_CUTOFF = "pixel.low_pass.dark_cutoff_hz"
DARK_CURRENT = "pixel.dark_current.dn"
FOLLOWER = "pixel.source_follower.cutoff_hz"
SLEW = "pixel.slew_limit.per_s"
OFFSET = "frames.clock_offset_us"
THRESHOLD = {1: "pixel.thresholds.on", 0: "pixel.thresholds.off"}

LEAST_ERROR = 0.02
"""Relative error of the light that a table states, at the least."""
ASSUMED_ERROR = 0.05
_FAST = 1e12  # rad/s
_SOONEST_US = 1e-3
NEVER = 20.0
"""Logarithm of the latency [us] where the model has no event, some 8 minutes: finite for fits."""


class LatencyProblem(Problem):
    """Latency against light.

    The corner is 0 at zero light unless the declared model writes
    ``pixel.low_pass.dark_cutoff_hz``; the corner at white is fitted unless it is written.  Rows of
    another polarity or bias have a threshold of their own, that of the first group being held, as
    without steps of several sizes only ratios of thresholds show.

    Parameters
    ----------
    data : Latencies
    declared : Declared
    test : (rows,) of bool
    settings : Settings

    Raises
    ------
    DataError
        The steps do not reach a threshold, or no row is left to fit one to.
    """

    what = "latency"
    unit = "us"
    out_of_reach: ClassVar = {
        "refractory": "the first event after a step from rest comes before any dead time",
        "leak": "the latency is too short for the reference to move",
        "shot_noise": "moves single latencies, not their median",
    }

    def __init__(
        self, data: Latencies, declared: Declared, test: NDArray[np.bool_], settings: Settings
    ) -> None:
        white = settings.white or float(data.light.max())
        super().__init__(declared, data.light, data.unit, test, white)
        self.measured, self._polarity = np.log(data.latency_us), data.polarity
        self._contrast = np.full(data.light.shape, settings.contrast)
        if data.contrast is not None:
            self._contrast = data.contrast
        labels = list(zip(data.polarity.tolist(), data.bias, strict=True))
        self._labels = sorted(set(labels), key=lambda g: (-g[0], labels.index(g)))
        self._group = np.array([self._labels.index(label) for label in labels])
        self.groups = {
            _title(*label): np.flatnonzero(self._group == k) for k, label in enumerate(self._labels)
        }
        cells = list(zip(self._group, self.light, self._contrast, strict=True))
        self.error, self.error_source = row_errors(
            data.error, self.measured, cells, ASSUMED_ERROR, LEAST_ERROR, settings.error
        )
        self._has_low_pass = not declared.switched_off("pixel.low_pass")
        self.nuisances = self._nuisances()
        self.candidates = list(self._candidates(data))
        known = DARK_CUTOFF in declared.written or not self._has_low_pass
        self.neutral = {} if known else {DARK_CUTOFF: 0.0}
        self.notes = [
            f"255 DN stand for {white:g} {data.unit}; corners are stated there.",
            "A constant delay is given as clock_offset; a readout that takes its time makes the"
            " same one, and such a table cannot tell them apart.",
        ]
        if data.contrast is None:
            contrast = f"steps are taken as {settings.contrast:g} (ln)"
            self.notes.append(f"The table has no contrast_ln: {contrast}.")
        self._check(data.name)

    def predict(self, values: Mapping[str, float]) -> Array:
        """Return ln of the latency [us], (rows,)."""
        cutoff, dark, stray, offset = (
            self._number(values, key) for key in (CUTOFF, DARK_CUTOFF, DARK_CURRENT, OFFSET)
        )
        bright = 255.0 * self.light / self.white
        dim = bright * np.exp(-self._contrast)
        step = np.log((bright + stray) / (dim + stray))
        after = np.where(self._polarity == 1, bright, dim) + stray
        corner = np.full(step.shape, _FAST)
        if self._has_low_pass or CUTOFF in values:
            corner = np.maximum(2.0 * np.pi * (dark + (cutoff - dark) * after / 255.0), 1e-9)
        follower = self.declared.value(values, FOLLOWER, None)
        thresholds = [self._threshold(k, values) for k in range(len(self._labels))]
        time = first_crossing(
            step,
            np.array(thresholds)[self._group],
            corner,
            None if follower is None else 2.0 * np.pi * follower,
            self.declared.value(values, SLEW, None),
        )
        latency = np.maximum(1e6 * time + offset, _SOONEST_US)
        return np.asarray(np.minimum(np.log(latency), NEVER), dtype=np.float64)

    def _check(self, name: str) -> None:
        free = {one.key for one in self.nuisances.parameters}
        for k, (title, rows) in enumerate(self.groups.items()):
            key = self._threshold_key(k)
            if key in free and self.test[rows].all():
                raise DataError(
                    f"{name}: --judge takes all rows of {title}: none is left to fit their"
                    f" threshold to; declare {key.partition('[')[0]}, or judge by another column"
                )
            threshold, largest = self._threshold(k, {}), float(self._contrast[rows].max())
            if key not in free and threshold >= largest:
                raise DataError(
                    f"{name}: steps of {largest:g} (ln), {title}, do not reach the threshold"
                    f" of {threshold:g} ({key}): declare the camera's, or --contrast of the steps"
                )

    def _threshold(self, group: int, values: Mapping[str, float]) -> float:
        key = self._threshold_key(group)
        if key in values:
            return values[key]
        thresholds = self.declared.config.pixel.thresholds
        return thresholds.on if self._labels[group][0] == 1 else thresholds.off

    def _threshold_key(self, group: int) -> str:
        """Return the name of a group's threshold: a key, but for further biases."""
        polarity, bias = self._labels[group]
        first = next(k for k, other in enumerate(self._labels) if other[0] == polarity)
        key = THRESHOLD[polarity]
        return key if group == first else f"{key}[bias={bias}]"

    def _thresholds(self, which: Sequence[int]) -> Candidate:
        """Return the thresholds of some groups, to be fitted."""
        parameters, starts = [], []
        for group in which:
            most = float(self._contrast[self._group == group].min())
            start = self._threshold(group, {})
            starts.append(start if start < most else 0.5 * most)
            key = self._threshold_key(group)
            parameters.append(FitParameter(key, 1e-3 * most, (1 - 1e-6) * most))
        return Candidate("thresholds", tuple(parameters), (tuple(starts),))

    def _nuisances(self) -> Candidate:
        written = self.declared.written
        several = np.unique(self._contrast).size > 1
        unknown = self._thresholds(
            [
                group
                for group in range(len(self._labels))
                if (group > 0 or several) and self._threshold_key(group) not in written
            ]
        )
        if CUTOFF in written or not self._has_low_pass:
            return unknown
        share = np.log(2.0) * self.white / (2e-6 * np.pi)  # about half of the step
        start = float(np.median(share / (np.exp(self.measured) * self.light)))
        corner = _of_one("low_pass", CUTOFF, start, 0.3 * start, low=1e-5 * start, high=1e5 * start)
        return Candidate.joined([corner, unknown])

    def _candidates(self, data: Latencies) -> Iterator[Candidate]:
        written = self.declared.written
        fastest, slowest = float(data.latency_us.min()), float(data.latency_us.max())
        typical = float(np.median(data.latency_us))
        if CUTOFF in written:
            start = float(written[CUTOFF])
            ends = {"low": 1e-5 * start, "high": 1e5 * start}
            yield _of_one("low_pass", CUTOFF, start, 0.2 * start, 5 * start, **ends)
        dark = [1e6 / (2 * np.pi * slowest * factor) for factor in (1.0, 10.0)]
        if self._has_low_pass:
            yield _of_one("low_pass", DARK_CUTOFF, *dark)
        else:
            white = [factor * start for start in dark for factor in (1.0, 30.0)]
            yield _of_one("low_pass", CUTOFF, *white)
        least = float(255.0 * data.light.min() / self.white)
        yield _of_one("dark_current", DARK_CURRENT, least, 0.1 * least)
        follower = [1e6 / (2 * np.pi * typical * factor) for factor in (0.3, 2.0)]
        yield _of_one("source_follower", FOLLOWER, *follower)
        slew = [1e6 * 0.2 / (typical * factor) for factor in (0.3, 1.0)]
        yield _of_one("slew_limit", SLEW, *slew)
        floors = (0.3 * fastest, 0.9 * fastest)
        yield _of_one("clock_offset", OFFSET, *floors, low=1e-4 * fastest, high=slowest)
        changed = [k for k in range(len(self._labels)) if self._threshold_key(k) in written]
        if changed:
            yield self._thresholds(changed)


def _of_one(
    name: str, key: str, *starts: float, low: float | None = None, high: float | None = None
) -> Candidate:
    """Return an effect with one key; by itself, it reaches far beyond all starts."""
    parameter = FitParameter(key, low or 1e-5 * min(starts), high or 1e5 * max(starts))
    return Candidate(name, (parameter,), tuple((start,) for start in starts))


def _title(polarity: int, bias: str) -> str:
    return ("ON" if polarity == 1 else "OFF") + (f", bias {bias}" if bias else "")
