"""The size of each effect that would have been seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate, neutral_value
from adv2e.diagnosis.fitting.keys import about_key
from adv2e.diagnosis.hints.pulses import DRIFT
from adv2e.diagnosis.selection.reference import OF_RECORDINGS, Bench, State
from adv2e.diagnosis.selection.search import PER_LOOK
from adv2e.diagnosis.statistics import BOTH
from adv2e.diagnosis.statistics.metric import Model, expanded
from adv2e.reports.result import Detectable

_SEEN = 0.8
_ROUNDS = (range(1, 3), range(301, 305), range(305, 315))
"""Seeds of the recordings that are simulated at each size; first those of the probes."""
_FARTHEST = 10.0
LIKELY = sum(map(len, _ROUNDS))
"""Simulations of each effect."""
_SETTLED = 2.0
"""Factor by which the last round may still change a size that is told."""


def detectable(bench: Bench, declared: State, candidates: Sequence[Candidate]) -> list[Detectable]:
    """Return the size of each effect that would have been seen about 8 times in 10.

    Recordings with the effect are simulated, from a mild probe on, and judged as the real one is;
    how much more or less of it would just have been seen, as if what it changes grew in proportion,
    is tried in the next round.  Where no size within the physical range would have been seen, or
    none was settled on, there is none.
    """
    mildest: dict[str, Candidate] = {}
    for candidate in candidates:
        if candidate.knobs:
            # how fast the clock of the frames is would be seen by itself
            extra = tuple((key, value) for key, value in candidate.extra if key != DRIFT)
            mildest.setdefault(candidate.name, replace(candidate, extra=extra))
    every = [_Size.of(candidate, declared.config) for candidate in mildest.values()]
    sizes = every
    model = declared.models[BOTH]
    limits = _Limits.of(model)
    bench.laboratory.simulator.expect(LIKELY * len(sizes), after_the_search=0)
    for seeds in _ROUNDS:
        if not sizes:
            break
        configs = [size.config(declared.config) for size in sizes]
        last = seeds == _ROUNDS[-1]
        laboratory = bench.laboratory if last else bench.laboratory.for_a_first_look
        sample = laboratory.many(configs, seeds)[:, :, BOTH]
        for size, rows in zip(sizes, sample, strict=True):
            recordings = bench.error.blurred(rows, BOTH, OF_RECORDINGS)
            factors = [limits.missing(model, row) for row in recordings]
            size.change_by(float(np.quantile(factors, _SEEN)))
        sizes = [size for size in sizes if math.isfinite(size.factor)]
    return [size.found(declared.config) for size in every]


@dataclass
class _Size:
    """An effect, and how far its first key is from where it does nothing.

    Attributes
    ----------
    candidate : Candidate
    neutral : float
        The first key's value where the effect does nothing.
    value, rest : float and tuple of float
        Of the first key and the others.
    factor : float
        By which the last round changed it; infinite: it left the physical range.
    """

    candidate: Candidate
    neutral: float
    value: float
    rest: tuple[float, ...]
    factor: float = 1.0

    @classmethod
    def of(cls, candidate: Candidate, config: Config) -> _Size:
        """Return the first probe that the physical range leaves room to grow from, if any."""
        neutral = neutral_value(config, candidate.knobs[0])
        made = [cls(candidate, neutral, probe[0], probe[1:]) for probe in candidate.probes]
        return next((one for one in made if one._is_physical(one._changed(_FARTHEST))), made[0])

    def config(self, declared: Config) -> Config:
        values = (self.value, *self.rest)
        return self.candidate.applied(declared, self.candidate.inner(values))

    def change_by(self, factor: float) -> None:
        wanted = self._changed(factor)
        self.factor = factor if self._is_physical(wanted) else math.inf
        self.value = wanted

    def _changed(self, factor: float) -> float:
        if math.isinf(self.neutral):
            return self.value / factor
        return self.neutral + factor * (self.value - self.neutral)

    def _is_physical(self, value: float) -> bool:
        return self.candidate.knobs[0].low <= value <= self.candidate.knobs[0].high

    @property
    def is_settled(self) -> bool:
        return 1.0 / _SETTLED <= self.factor <= _SETTLED

    def found(self, declared: Config) -> Detectable:
        key = self.candidate.knobs[0].key
        value = self.value if self.is_settled else None
        return Detectable(self.candidate.name, key, value, about_key(declared, key).unit)


@dataclass(frozen=True)
class _Limits:
    """From where on chance is not believed to make a misfit, or a largest deviation."""

    misfit: float
    largest: float

    @classmethod
    def of(cls, model: Model) -> _Limits:
        return cls(*model.limits(PER_LOOK))

    def missing(self, model: Model, recording: NDArray[np.float64]) -> float:
        """Return by which factor an effect must be larger to be seen in a recording with it."""
        # squares add up, single deviations grow in proportion
        misfit = (model.misfit(recording) - model.floor) / (self.misfit - model.floor)
        loudest = expanded(np.abs(model.z(recording)).max())
        usual = expanded(model.typical_largest)
        deviation = float((loudest - usual) / (expanded(self.largest) - usual))
        factor = min(max(misfit, 1e-6) ** -0.5, 1.0 / max(deviation, 1e-6))
        return float(min(max(factor, 1.0 / _FARTHEST), _FARTHEST))
