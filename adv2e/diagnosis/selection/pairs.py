"""Two effects that are missing together, where neither alone makes the recording more likely.

Each of two strong effects may leave so much of the other that its own fit goes astray, and nothing
holds that could be built on.  What each changes by itself tells which two could explain most
together; those are fitted together.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.selection.reference import Bench, State
from adv2e.diagnosis.selection.shortlist import Trial

Array = NDArray[np.float64]

_FITTED = 4
_MOST_LEFT = 0.5
"""Part of what the best effect alone would leave that two may, to be worth a fit."""
_FARTHEST = 3.0
"""Most by which what an effect changes is stretched, or it is not taken to go on in proportion."""


def likely_pairs(bench: Bench, state: State, trials: Sequence[Trial]) -> list[tuple[Trial, Trial]]:
    """Return pairs of effects that together would leave the least, the best first.

    As if each changed the statistics by itself, in proportion to its size.  Those that would not
    leave far less than the best effect alone are left out.

    Parameters
    ----------
    bench : Bench
    state : State
        What they would be added to.
    trials : sequence of Trial
        Effects alone on top of it, each in one form.
    """
    ground, observed = state.models[parts.FIT], bench.observed[parts.FIT]
    white = ground.scale.whitening / ground.sd
    missing = white @ (ground.scale.of_values(observed) - ground.mean)
    changes = [white @ (trial.models[parts.FIT].mean - ground.mean) for trial in trials]
    alone = min((_left(missing, [one]) for one in changes), default=0.0)
    found = []
    for a, b in combinations(range(len(trials)), 2):
        least = _left(missing, [changes[a], changes[b]])
        if least < _MOST_LEFT * alone:
            found.append((least, a, b))
    return [(trials[a], trials[b]) for _, a, b in sorted(found)[:_FITTED]]


def _left(missing: Array, changes: Sequence[Array]) -> float:
    """Return the square of what is left when changes are stretched to fit what is missing.

    All of it where one would be turned round, or stretched too far.
    """
    columns = np.transpose(changes)
    stretch, *_ = np.linalg.lstsq(columns, missing, rcond=None)
    if stretch.min() < 0.0 or stretch.max() > _FARTHEST:
        return float(missing @ missing)
    rest = missing - columns @ stretch
    return float(rest @ rest)
