"""Which of several models explains most, and which others cannot be told from it.

A likelihood by simulations is itself uncertain: the more is left of the residual, the more it hangs
on which simulations it was made of.  Models that chance may have parted are simulated more often;
what that does not tell, nobody knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.selection.reference import MANY, Bench, State
from adv2e.diagnosis.selection.shortlist import scored
from adv2e.diagnosis.statistics import BOTH
from adv2e.diagnosis.statistics.metric import Model

Array = NDArray[np.float64]

CLOSE = 5.0
"""Log likelihood that tells two models apart where simulations tell it: a factor of 150."""
_DEVIATIONS = 2.0
_OFTEN = (*range(1, MANY + 1), *range(2 * MANY + 1, 4 * MANY + 1))
"""Seeds, where the first are too few; between them are those of the scales."""


@dataclass(frozen=True)
class Ranking:
    """What several models explain.

    Attributes
    ----------
    scores : (models,)
        Log likelihood of the data for fitting and judging, less the number of knobs.
    best : int
        The model with the highest.
    alike : frozenset of int
        Others that cannot be told from it.
    """

    scores: Array
    best: int
    alike: frozenset[int]

    @property
    def behind(self) -> Array:
        """How far each is behind the best, (models,)."""
        return np.asarray(self.scores[self.best] - self.scores)


def ranked(bench: Bench, states: Sequence[State], knobs: Sequence[int]) -> Ranking:
    """Rank models; where chance may have parted some of them, by more simulations.

    Parameters
    ----------
    bench : Bench
    states : sequence of State
        One at least.
    knobs : sequence of int
        That each adds.
    """
    ranking = _ranked(bench, [state.models for state in states], knobs)
    near = sorted({ranking.best} | ranking.alike)
    if not np.any(ranking.behind[near] > CLOSE):
        return ranking
    configs = [states[k].config for k in near]
    models = [bench.models(one, bench.laboratory.ensemble(one, _OFTEN)) for one in configs]
    again = _ranked(bench, models, [knobs[k] for k in near])
    scores = ranking.scores.copy()
    scores[near] = again.scores
    return Ranking(scores, near[again.best], frozenset(near[k] for k in again.alike))


def _ranked(bench: Bench, models: Sequence[Sequence[Model]], knobs: Sequence[int]) -> Ranking:
    """Rank models, of which each has one a view."""
    scores = np.array([scored(bench, *each) for each in zip(models, knobs, strict=True)])
    best, observed = int(np.argmax(scores)), bench.observed[BOTH]
    first = models[best][BOTH]
    chance = np.array([of_views[BOTH].parted_by_chance(first, observed) for of_views in models])
    alike = np.flatnonzero(scores[best] - scores <= CLOSE + _DEVIATIONS * chance)
    return Ranking(scores, best, frozenset(alike.tolist()) - {best})
