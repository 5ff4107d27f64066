"""The size of each effect that would have been seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate, neutral_value
from adv2e.diagnosis.hints.readouts import DRIFT
from adv2e.diagnosis.selection.reference import OF_RECORDINGS, Reference, State
from adv2e.diagnosis.selection.search import PER_LOOK
from adv2e.diagnosis.statistics.metric import Ensemble, expanded
from adv2e.diagnosis.statistics.summary import BOTH
from adv2e.reports.keys import known_keys
from adv2e.reports.result import Detectable

_SEEN = 0.8
_ROUNDS = (range(1, 3), range(301, 305), range(305, 315))
"""Seeds of the recordings that are simulated at each size; first those of the starts."""
_FARTHEST = 10.0
_SETTLED = 2.0
"""Factor by which the last round may still change a size that is told."""


def detectable(
    reference: Reference, declared: State, candidates: Sequence[Candidate]
) -> list[Detectable]:
    """Return the size of each effect that would have been seen about 8 times in 10.

    Recordings with the effect are simulated, from a mild start on, and judged as the real one is;
    how much more or less of it would just have been seen, as if what it changes grew in proportion,
    is tried in the next round.  Where no size within the physical range would have been seen, or
    none was settled on, there is none.
    """
    reference.begin("finding what could have been seen")
    mildest: dict[str, Candidate] = {}
    for candidate in candidates:
        if candidate.parameters:
            # how fast the clock of the frames is would be seen by itself
            extra = tuple((key, value) for key, value in candidate.extra if key != DRIFT)
            mildest.setdefault(candidate.name, replace(candidate, extra=extra))
    every = [_Size.of(candidate, declared.config) for candidate in mildest.values()]
    sizes, ensemble = every, declared.ensembles[BOTH]
    for seeds in _ROUNDS:
        if not sizes:
            break
        configs = [size.config(declared.config) for size in sizes]
        is_last = seeds == _ROUNDS[-1]
        sampler = reference.sampler if is_last else reference.sampler.rough
        sample = sampler.samples(configs, seeds)[:, :, BOTH]
        for size, rows in zip(sizes, sample, strict=True):
            recordings = reference.error.blurred(rows, BOTH, OF_RECORDINGS)
            factors = [_missing(ensemble, row) for row in recordings]
            size.change_by(float(np.quantile(factors, _SEEN)))
        sizes = [size for size in sizes if math.isfinite(size.factor)]
    return [size.found(declared.config) for size in every]


@dataclass
class _Size:
    """An effect, the value of its first key where it does nothing, that now, and other keys'.

    `factor`: by which the last round changed it; infinite: it left the physical range.
    """

    candidate: Candidate
    neutral: float
    value: float
    rest: tuple[float, ...]
    factor: float = 1.0

    @classmethod
    def of(cls, candidate: Candidate, config: Config) -> _Size:
        """Return the first start that the physical range leaves room to grow from, if any."""
        neutral = neutral_value(config, candidate.parameters[0])
        made = [cls(candidate, neutral, start[0], start[1:]) for start in candidate.starts]
        return next((one for one in made if one._is_physical(one._changed(_FARTHEST))), made[0])

    def config(self, declared: Config) -> Config:
        values = (self.value, *self.rest)
        return self.candidate.applied(declared, self.candidate.scaled(values))

    def change_by(self, factor: float) -> None:
        wanted = self._changed(factor)
        self.factor = factor if self._is_physical(wanted) else math.inf
        self.value = wanted

    def _changed(self, factor: float) -> float:
        if math.isinf(self.neutral):
            return self.value / factor
        return self.neutral + factor * (self.value - self.neutral)

    def _is_physical(self, value: float) -> bool:
        return self.candidate.parameters[0].low <= value <= self.candidate.parameters[0].high

    def found(self, declared: Config) -> Detectable:
        key = self.candidate.parameters[0].key
        is_settled = 1.0 / _SETTLED <= self.factor <= _SETTLED
        unit = known_keys(type(declared))[key].unit
        return Detectable(self.candidate.name, key, self.value if is_settled else None, unit)


def _missing(ensemble: Ensemble, recording: NDArray[np.float64]) -> float:
    """Return by which factor an effect must be larger to be seen in a recording with it."""
    misfit_limit, largest_limit = ensemble.limits(PER_LOOK)
    # squares add up, single deviations grow in proportion
    misfit = (ensemble.misfit(recording) - ensemble.floor) / (misfit_limit - ensemble.floor)
    loudest = expanded(np.abs(ensemble.z(recording)).max())
    usual = expanded(ensemble.typical_largest)
    deviation = float((loudest - usual) / (expanded(largest_limit) - usual))
    factor = min(max(misfit, 1e-6) ** -0.5, 1.0 / max(deviation, 1e-6))
    return float(min(max(factor, 1.0 / _FARTHEST), _FARTHEST))
