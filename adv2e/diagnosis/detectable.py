"""The size of each effect that would have been seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adv2e.diagnosis.bench import Bench, State
from adv2e.diagnosis.candidates import Candidate, neutral_value
from adv2e.diagnosis.keys import about_key
from adv2e.diagnosis.markers import BOTH
from adv2e.reports.result import Detectable

_POWER = 3.2  # deviations: 99 % below without the effect, 80 % above with it
_SEEDS = (1, 2)  # those of the probes


def detectable(bench: Bench, declared: State, candidates: Sequence[Candidate]) -> list[Detectable]:
    """Return the size of each effect that would have been seen 8 times in 10.

    From the mildest probe, as if what an effect changes grew in proportion to it.  Effects of which
    no size within the physical range would have been seen are left out.
    """
    mildest: dict[str, Candidate] = {}
    for candidate in candidates:
        if candidate.knobs:
            mildest.setdefault(candidate.name, candidate)
    if not mildest:
        return []
    config = declared.config
    configs = [one.applied(config, one.inner(one.probes[0])) for one in mildest.values()]
    idle, *means = bench.fitter(BOTH).whites([config, *configs], _SEEDS)
    seen = _POWER * declared.models[BOTH].spread * len(idle)
    result = []
    for candidate, mean in zip(mildest.values(), means, strict=True):
        knob, value = candidate.knobs[0], candidate.probes[0][0]
        strength = max(float(np.sum((mean - idle) ** 2)), 1e-9)
        factor = float(np.sqrt(seen / strength))
        neutral = neutral_value(config, knob)
        size = value / factor if np.isinf(neutral) else neutral + factor * (value - neutral)
        if knob.low <= size <= knob.high:
            unit = about_key(config, knob.key).unit
            result.append(Detectable(candidate.name, knob.key, size, unit))
    return result
