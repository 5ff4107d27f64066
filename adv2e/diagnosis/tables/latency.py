"""The model of a table of latencies, simulated, and the effects it may lack."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Pixel, Sampling
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.tables.problem import (
    CUTOFF,
    DARK_CURRENT,
    DARK_CUTOFF,
    FOLLOWER,
    Array,
    Declared,
    Problem,
    Settings,
    of_one,
    row_errors,
)
from adv2e.diagnosis.tables.table import Latencies
from adv2e.effects.pixel.initial_reference import SETTLED
from adv2e.effects.pixel.log_response import LogResponse
from adv2e.effects.pixel.low_pass import LowPass
from adv2e.effects.pixel.slew_limit import SlewLimit
from adv2e.effects.pixel.source_follower import SourceFollower
from adv2e.effects.pixel.thresholds import Thresholds
from adv2e.errors import DataError
from adv2e.kernel import per_pixel
from adv2e.pixel.array import PixelArray

SLEW = "pixel.slew_limit.per_s"
OFFSET = "frames.clock_offset_us"
THRESHOLD = {1: "pixel.thresholds.on", 0: "pixel.thresholds.off"}

LEAST_ERROR = 0.02
"""Relative error of the light that a table states, at the least."""
ASSUMED_ERROR = 0.05
_SOONEST_US = 1e-3
_SPANS = 2.0, 16.0
"""How long is simulated, in the longest latency of the table; then a pixel has no event."""
_LEAP_NS = 1
_NO_POLE_HZ = 1e9
"""Second pole that delays nothing: two poles are solved sooner than one."""


def first_events_us(
    pixel: Pixel, before: Array, after: Array, threshold: Array, ends_us: Sequence[float]
) -> Array:
    """Return the time of each pixel's first event after a step of the light [us], (n,).

    Parameters
    ----------
    pixel : Pixel
        Without noise; it rests at the light before the step.
    before, after : (n,)
        Light [DN].
    threshold : (n,)
        ON and OFF threshold of each pixel [ln].
    ends_us : sequence of float
        Times after the step at which the simulation ends if all pixels that can have fired; inf
        stands for those that have not by the last.
    """
    first = np.full(before.size, np.inf)
    light = np.stack([before, after, after])[:, None].astype(np.float32)
    array = PixelArray(pixel, Sampling(L=1), 0, light[0], 0, threads=1, exact_times=True)
    array.state[[per_pixel.ON, per_pixel.OFF]] = threshold
    can = threshold < np.abs(np.log(after / before))
    times_ns = [0, _LEAP_NS]
    for end_us in ends_us:
        times_ns.append(_LEAP_NS + round(1e3 * end_us))
        events = array.advance(light[-len(times_ns) :], times_ns, np.zeros(len(times_ns), np.bool_))
        np.minimum.at(first, events["x"], array.last_times)
        if np.isfinite(first[can]).all():
            break
        del times_ns[:-1]
    return first


class LatencyProblem(Problem):
    """Latency against light, of pixels that rest at one side of the step.

    The corner is 0 at zero light unless the declared model writes
    ``pixel.low_pass.dark_cutoff_hz``; the corner at white is fitted unless it is written.  Rows of
    another polarity or bias have a threshold of their own, that of the first group being held, as
    without steps of several sizes only ratios of thresholds show.

    Parameters
    ----------
    test : (rows,) of bool

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
        self._ends_us = [span * float(data.latency_us.max()) for span in _SPANS]
        self._has_low_pass = declared.written.get("pixel.low_pass", "on") is not None
        self.nuisances = self._nuisances()
        self.candidates = list(self._candidates(data.latency_us))
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
        held = self.declared.value
        cutoff, dark, slew = (held(values, key) for key in (CUTOFF, DARK_CUTOFF, SLEW))
        follower = held(values, FOLLOWER) or (_NO_POLE_HZ if cutoff and not slew else 0.0)
        pixel = Pixel(
            initial_reference=SETTLED,
            log_response=LogResponse(linear_below=0.0, floor=1e-9),
            low_pass=LowPass(cutoff_hz=cutoff, dark_cutoff_hz=dark) if cutoff else None,
            slew_limit=SlewLimit(per_s=slew) if slew else None,
            source_follower=SourceFollower(cutoff_hz=follower) if follower else None,
            thresholds=Thresholds(mismatch=0.0),
            refractory=None,
            shot_noise=None,
        )
        bright = 255.0 * self.light / self.white
        sides = np.stack([bright * np.exp(-self._contrast), bright]) + held(values, DARK_CURRENT)
        before, after = np.where(self._polarity == 1, sides, sides[::-1])
        thresholds = np.array([self._threshold(k, values) for k in range(len(self._labels))])
        time = first_events_us(pixel, before, after, thresholds[self._group], self._ends_us)
        latency = np.clip(time + held(values, OFFSET), _SOONEST_US, self._ends_us[-1])
        return np.asarray(np.log(latency), dtype=np.float64)

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
        thresholds = self.declared.config.pixel.thresholds
        held = thresholds.on if self._labels[group][0] == 1 else thresholds.off
        return values.get(self._threshold_key(group), held)

    def _threshold_key(self, group: int) -> str:
        """Return the name of a group's threshold: a key, but for further biases."""
        polarity, bias = self._labels[group]
        first = next(k for k, other in enumerate(self._labels) if other[0] == polarity)
        key = THRESHOLD[polarity]
        return key if group == first else f"{key}[bias={bias}]"

    def _thresholds(self, which: Sequence[int]) -> Candidate:
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
        groups = range(0 if several else 1, len(self._labels))
        unknown = self._thresholds([k for k in groups if self._threshold_key(k) not in written])
        if CUTOFF in written or not self._has_low_pass:
            return unknown
        share = np.log(2.0) * self.white / (2e-6 * np.pi)  # about half of the step
        start = float(np.median(share / (np.exp(self.measured) * self.light)))
        return Candidate.joined([of_one("low_pass", CUTOFF, start, 0.3 * start), unknown])

    def _candidates(self, latency_us: Array) -> Iterator[Candidate]:
        written = self.declared.written
        fastest, typical, slowest = (float(np.quantile(latency_us, q)) for q in (0.0, 0.5, 1.0))

        def corners(time_us: float, *factors: float) -> list[float]:
            return [1e6 / (2 * np.pi * time_us * factor) for factor in factors]

        if CUTOFF in written:
            start = float(written[CUTOFF])
            yield of_one("low_pass", CUTOFF, start, 0.2 * start, 5 * start)
        elif not self._has_low_pass:
            yield of_one("low_pass", CUTOFF, *corners(slowest, 1.0, 1 / 30, 10.0, 1 / 3))
        if self._has_low_pass:
            yield of_one("low_pass", DARK_CUTOFF, *corners(slowest, 1.0, 10.0))
        least = float(255.0 * self.light.min() / self.white)
        yield of_one("dark_current", DARK_CURRENT, least, 0.1 * least)
        yield of_one("source_follower", FOLLOWER, *corners(typical, 0.3, 2.0))
        if self._has_low_pass:
            yield of_one("slew_limit", SLEW, *(2e5 / (typical * factor) for factor in (0.3, 1.0)))
        offset = FitParameter(OFFSET, 1e-4 * fastest, slowest)
        yield Candidate("clock_offset", (offset,), ((0.3 * fastest,), (0.9 * fastest,)))
        changed = [k for k in range(len(self._labels)) if self._threshold_key(k) in written]
        if changed:
            yield self._thresholds(changed)


def _title(polarity: int, bias: str) -> str:
    return ("ON" if polarity == 1 else "OFF") + (f", bias {bias}" if bias else "")
