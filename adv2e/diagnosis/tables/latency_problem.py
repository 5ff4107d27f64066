"""The model of a table of latencies, and the effects it may lack."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.tables.declared import Declared
from adv2e.diagnosis.tables.latency import first_crossing
from adv2e.diagnosis.tables.measurements import Latencies
from adv2e.diagnosis.tables.problem import Candidate, Free, Group, levels_of, row_errors
from adv2e.errors import DataError

Array = NDArray[np.float64]

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

_OUT_OF_REACH = {
    "refractory": "the first event after a step from rest comes before any dead time",
    "leak": "the latency is too short for the reference to move",
    "shot_noise": "moves single latencies, not their median",
}


class LatencyProblem:
    """Latency against light; see :class:`adv2e.diagnosis.tables.problem.Problem`.

    Light is scaled so that `white` is 255 DN.  The corner is 0 at zero light unless the declared
    model writes ``pixel.low_pass.dark_cutoff_hz``; the corner at white is fitted unless it is
    written.  Rows of another polarity or bias have a threshold of their own, that of the first
    group being held, as without steps of several sizes only ratios of thresholds show.

    Parameters
    ----------
    data : Latencies
    declared : Declared
    judged : (rows,) of bool
    white : float, optional
        Light of 255 DN, in the table's unit; default: the highest.
    contrast : float
        Size of the steps [ln] where the table does not say.
    stated_error : float, optional
        Relative error of every row, whatever the table says.
    """

    what = "latency"
    unit = "us"

    def __init__(
        self,
        data: Latencies,
        declared: Declared,
        judged: NDArray[np.bool_],
        white: float | None = None,
        contrast: float = 1.0,
        stated_error: float | None = None,
    ) -> None:
        self.measured = np.log(data.latency_us)
        self.light, self.level, self.judged = data.light, levels_of(data.light), judged
        self.light_unit = data.unit
        self._polarity = data.polarity
        self._white = white or float(data.light.max())
        self._contrast = (
            np.full(data.light.shape, contrast) if data.contrast is None else data.contrast
        )
        self._declared = declared
        labels = list(zip(data.polarity.tolist(), data.bias, strict=True))
        self._groups = sorted(set(labels), key=lambda g: (-g[0], labels.index(g)))
        self._group = np.array([self._groups.index(label) for label in labels])
        self.groups = tuple(
            Group(_title(*group), np.flatnonzero(self._group == k))
            for k, group in enumerate(self._groups)
        )
        cells = list(zip(self._group, self.light, self._contrast, strict=True))
        self.error, self.error_source = row_errors(
            data.error, self.measured, cells, ASSUMED_ERROR, LEAST_ERROR, stated_error
        )
        self.nuisances = self._nuisances()
        self.candidates = self._candidates(data)
        self.out_of_reach: Mapping[str, str] = _OUT_OF_REACH
        self.notes = self._notes(data, contrast)

    def predict(self, values: Mapping[str, float]) -> Array:
        """Return ln of the latency [us], (rows,)."""

        def number(key: str) -> float:
            return self._declared.value(values, key, 0.0) or 0.0

        without = self._without_low_pass and CUTOFF not in values
        cutoff, dark, stray = number(CUTOFF), number(DARK_CUTOFF), number(DARK_CURRENT)
        bright = 255.0 * self.light / self._white
        dim = bright * np.exp(-self._contrast)
        step = np.log((bright + stray) / (dim + stray))
        after = np.where(self._polarity == 1, bright, dim) + stray
        corner = 2.0 * np.pi * (dark + (cutoff - dark) * after / 255.0)
        follower = self._declared.value(values, FOLLOWER, None)
        time = first_crossing(
            step,
            self._thresholds(values),
            np.full(step.shape, _FAST) if without else np.maximum(corner, 1e-9),
            None if follower is None else 2.0 * np.pi * follower,
            self._declared.value(values, SLEW, None),
        )
        latency = np.maximum(1e6 * time + number(OFFSET), _SOONEST_US)
        return np.asarray(np.minimum(np.log(latency), NEVER), dtype=np.float64)

    def completed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the keys as they are: a latency tells all of an effect."""
        return dict(values)

    @property
    def neutral(self) -> dict[str, float]:
        """Keys that this model has at a value other than the default, where not written."""
        known = DARK_CUTOFF in self._declared.written or self._without_low_pass
        return {} if known else {DARK_CUTOFF: 0.0}

    @property
    def _without_low_pass(self) -> bool:
        """Whether the configuration says that there is none."""
        return self._declared.switched_off("pixel.low_pass")

    def check(self, name: str) -> None:
        """Raise DataError for what cannot be fitted, or never makes an event.

        Parameters
        ----------
        name : str
            The table's.
        """
        free = {one.key for one in self.nuisances}
        for k, group in enumerate(self.groups):
            key = self._threshold_key(k)
            if key in free and self.judged[group.rows].all():
                raise DataError(
                    f"{name}: --judge takes all rows of {group.title}: none is left to fit their"
                    f" threshold to; declare {key.partition('[')[0]}, or judge by another column"
                )
            threshold, largest = self._threshold(k, {}), float(self._contrast[group.rows].max())
            if key not in free and threshold >= largest:
                raise DataError(
                    f"{name}: steps of {largest:g} (ln), {group.title}, do not reach the threshold"
                    f" of {threshold:g} ({key}): declare the camera's, or --contrast of the steps"
                )

    def _thresholds(self, values: Mapping[str, float]) -> Array:
        by_group = np.array([self._threshold(k, values) for k in range(len(self._groups))])
        each: Array = by_group[self._group]
        return each

    def _threshold(self, group: int, values: Mapping[str, float]) -> float:
        key = self._threshold_key(group)
        if key in values:
            return values[key]
        thresholds = self._declared.config.pixel.thresholds
        return thresholds.on if self._groups[group][0] == 1 else thresholds.off

    def _threshold_key(self, group: int) -> str:
        """Return the name of a group's threshold: a key, but for further biases."""
        polarity, bias = self._groups[group]
        first = next(k for k, other in enumerate(self._groups) if other[0] == polarity)
        key = THRESHOLD[polarity]
        return key if group == first else f"{key}[bias={bias}]"

    def _nuisances(self) -> tuple[Free, ...]:
        free = []
        written = self._declared.written
        if CUTOFF not in written and not self._without_low_pass:
            share = np.log(2.0) * self._white / (2e-6 * np.pi)  # about half of the step
            start = float(np.median(share / (np.exp(self.measured) * self.light)))
            free.append(Free(CUTOFF, (start, 0.3 * start), 1e-5 * start, 1e5 * start))
        several = np.unique(self._contrast).size > 1
        for group in range(len(self._groups)):
            key = self._threshold_key(group)
            if (group > 0 or several) and key not in written:
                free.append(self._free_threshold(group))
        return tuple(free)

    def _free_threshold(self, group: int) -> Free:
        most = float(self._contrast[self._group == group].min())
        start = self._threshold(group, {})
        if start >= most:
            start = 0.5 * most
        return Free(self._threshold_key(group), (start,), 1e-3 * most, (1 - 1e-6) * most)

    def _candidates(self, data: Latencies) -> tuple[Candidate, ...]:
        written = self._declared.written
        fastest, slowest = float(data.latency_us.min()), float(data.latency_us.max())
        typical = float(np.median(data.latency_us))
        follower = [1e6 / (2 * np.pi * typical * factor) for factor in (0.3, 2.0)]
        slew = [1e6 * 0.2 / (typical * factor) for factor in (0.3, 1.0)]
        floors = (0.3 * fastest, 0.9 * fastest)
        found = []
        if CUTOFF in written:
            start = float(written[CUTOFF])
            free = Free(CUTOFF, (start, 0.2 * start, 5 * start), 1e-5 * start, 1e5 * start)
            found.append(Candidate("low_pass", (free,)))
        dark = [1e6 / (2 * np.pi * slowest * factor) for factor in (1.0, 10.0)]
        if self._without_low_pass:
            white = [factor * start for start in dark for factor in (1.0, 30.0)]
            found.append(Candidate("low_pass", (_free(CUTOFF, white),)))
        else:
            found.append(Candidate("low_pass", (_free(DARK_CUTOFF, dark),)))
        least = float(255.0 * data.light.min() / self._white)
        found += [
            Candidate("dark_current", (_free(DARK_CURRENT, (least, 0.1 * least)),)),
            Candidate("source_follower", (_free(FOLLOWER, follower),)),
            Candidate("slew_limit", (_free(SLEW, slew),)),
            Candidate("clock_offset", (Free(OFFSET, floors, 1e-4 * fastest, slowest),)),
        ]
        changed = tuple(
            self._free_threshold(group)
            for group in range(len(self._groups))
            if self._threshold_key(group) in written
        )
        if changed:
            found.append(Candidate("thresholds", changed))
        return tuple(found)

    def _notes(self, data: Latencies, contrast: float) -> tuple[str, ...]:
        notes = [
            f"255 DN stand for {self._white:g} {data.unit}; corners are stated there.",
            "A constant delay is given as clock_offset; a readout that takes its time makes the"
            " same one, and such a table cannot tell them apart.",
        ]
        if data.contrast is None:
            notes.append(f"The table has no contrast_ln: steps are taken as {contrast:g} (ln).")
        return tuple(notes)


def _free(key: str, starts: list[float] | tuple[float, ...]) -> Free:
    return Free(key, tuple(starts), 1e-5 * min(starts), 1e5 * max(starts))


def _title(polarity: int, bias: str) -> str:
    return ("ON" if polarity == 1 else "OFF") + (f", bias {bias}" if bias else "")
