"""Acceptance of a model in place of the one before it, and choice of the best of several.

Both are judged on data that the model was not fitted to.  A likelihood by simulations is itself
uncertain: the larger the residual, the more it depends on the seeds of the simulations.  Models
whose difference may be chance are simulated more often; a difference that is still within chance
stays undecided.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.selection.reference import MANY, Reference, State
from adv2e.diagnosis.selection.shortlist import scored
from adv2e.diagnosis.statistics.metric import Ensemble, shrunk_correlation, whitening
from adv2e.diagnosis.statistics.summary import BOTH

Array = NDArray[np.float64]

_QUIET = 2.5
_SIGNATURE = 12
_WORSE = 9.0
"""Deviations by which a statistic gets worse that is not put down to details of a simulation."""

_OF_FRAMES = 60.0
"""Log likelihood that what is made up between frames may give to an effect: on data that it was not
fitted to, up to 59 in one part and 41 in another, never in both, of frames at 60 a second."""
_MOST_TURNS = 3.0
"""Error of interpolation that may be left, as a multiple of the bias that was subtracted."""

BORDER = "its fit runs to the end of the physical range"
BY_CHANCE = "what it gains on data it was not fitted to, chance could gain"

BY_FRAMES = "what it gains, light that is made up between the frames could gain"

CLOSE = 5.0
"""Log likelihood that tells two models apart where simulations tell it: a factor of 150."""
_DEVIATIONS = 2.0
_OF_ONE = 2.0
"""Deviations above the mean of chance gains, for an effect that other data chose."""
_OFTEN = (*range(1, MANY + 1), *range(2 * MANY + 1, 4 * MANY + 1))
"""Seeds, where the first are too few; between them are those of the scales."""


def objections(fit: Fitted, grown: State, ground: State, reference: Reference) -> list[str]:
    """Return the reasons to reject a fitted model in favour of the one before it; none: accept it.

    `grown` is simulated as by :meth:`~adv2e.diagnosis.selection.reference.Reference.tried`.
    """
    observed = reference.observed[splits.VALIDATION]
    after, before = grown.ensembles[splits.VALIDATION], ground.ensembles[splits.VALIDATION]
    # as often as what is tried, by the same seeds: most of chance falls out of the difference
    as_often = reference.tried(ground.config, grown.config)[splits.VALIDATION]
    found = []
    if gain(after, as_often, observed) < chance_gain(after, as_often, observed):
        found.append(BY_CHANCE)
    if fit.at_border:
        found.append(BORDER)
    loud = loudness(after, before, observed)
    if loud > _QUIET:
        found.append(f"what it changes most still stands out by {loud:.1f} deviations")
    for view in (splits.VALIDATION, BOTH):
        worst = _worse(grown.ensembles[view], ground.ensembles[view], reference.observed[view])
        if worst is not None:
            name, deviations = reference.sampler.statistics.entries[worst[0]].name, worst[1]
            found.append(
                f"makes '{name}' worse, which then stands out by {deviations:.0f} deviations"
            )
            break
    return found


def gain(after: Ensemble, before: Ensemble, observed: Array) -> float:
    """Return the gain in log likelihood of the model `after` over the model `before`."""
    return after.log_likelihood(observed) - before.log_likelihood(observed)


def chance_gain(
    after: Ensemble, before: Ensemble, observed: Array, deviations: float = 3.0
) -> float:
    """Return the largest gain in log likelihood that chance makes, `deviations` above its mean.

    On recordings that `before` simulates, and with the chance of the simulations of both models
    (same seeds), which grows with the residual.
    """
    rows = before.sample
    gains = after.likelihood_of_others(rows) - before.likelihood_of_others(rows)
    deviation = np.hypot(gains.std(), after.parted_by_chance(before, observed))
    return float(max(gains.mean() + deviations * deviation, 3.0))


def gain_held_out(state: State, without: State, reference: Reference) -> tuple[float, float]:
    """Return the gain of a model over itself `without` one of its effects, and the most by chance.

    On the test data, to which neither was fitted.  The effect was chosen by other data, so that its
    gain here is not the best of many.
    """
    observed = reference.observed[splits.TEST]
    after, before = state.ensembles[splits.TEST], without.ensembles[splits.TEST]
    return gain(after, before, observed), chance_gain(after, before, observed, _OF_ONE)


def stands_out(grown: State, ground: State, reference: Reference, view: int) -> bool:
    """Tell whether the gain in log likelihood is larger than interpolation error alone could make.

    In one view of the data.  The error of interpolation is systematic, and the same in direction
    for many statistics.  Leaving out frames gives that direction: the gain must exceed that with
    the largest error along it, either way.
    """
    after, before = grown.ensembles[view], reference.compared(ground, grown).ensembles[view]
    least = _OF_FRAMES
    for turns in (-_MOST_TURNS, _MOST_TURNS):
        values = before.scale.values_of(before.sample) + turns * reference.error.bias[view]
        rows = before.scale.of_values(values)
        gains = after.likelihood_of_others(rows) - before.likelihood_of_others(rows)
        least = max(least, float(gains.mean() + 3.0 * gains.std()))
    gained = gain(after, before, reference.observed[view])
    part = "held-out data" if view == splits.TEST else "data for validation"
    told = f"{gained:.0f} more likely on {part} (frames may make {least:.0f})"
    reference.log(f"  {' and '.join(grown.names)}: {told}")
    return gained >= least


def loudness(after: Ensemble, before: Ensemble, observed: Array) -> float:
    """Return the RMS residual of the statistics that a model changes most [deviations].

    Whitened by their correlations under the model itself, so that one fact that many of them show
    (few hot pixels in the test data, for example) counts once.  The correlations of the declared
    model, which all else uses, may not contain that fact.
    """
    change = np.abs(before.scale.whitening @ (after.mean - before.mean))
    own = np.argsort(-change)[:_SIGNATURE]
    apart = (after.sample[:, own] - after.mean[own]) / after.sd[own]
    white = whitening(shrunk_correlation(apart))
    z = white @ after.z(observed)[own]
    return float(np.sqrt(np.mean(z * z)))


def _worse(after: Ensemble, before: Ensemble, observed: Array) -> tuple[int, float] | None:
    """Return the index of the statistic that a model makes worst, and its residual [deviations].

    None if no statistic gets worse by more than details of a simulation make, or its residual is
    not larger than the largest was before.
    """
    now, then = np.abs(after.z(observed)), np.abs(before.z(observed))
    worst = int(np.argmax(now - then))
    much = now[worst] > max(then[worst] + _WORSE, 2.0 * then[worst], then.max())
    return (worst, float(now[worst])) if much else None


@dataclass(frozen=True)
class Ranking:
    """Scores of several models, the best of them, and others that cannot be told from it."""

    scores: Array
    best: int
    alike: frozenset[int]


def ranked(reference: Reference, states: Sequence[State], parameters: Sequence[int]) -> Ranking:
    """Rank models by :func:`scored`; where chance may have parted some, by more simulations.

    `parameters`: how many each adds.
    """
    ranking = _ranked(reference, [state.ensembles for state in states], parameters)
    near = sorted({ranking.best} | ranking.alike)
    if not np.any(ranking.scores[ranking.best] - ranking.scores[near] > CLOSE):
        return ranking
    configs = [states[k].config for k in near]
    often = [reference.ensembles(one, _OFTEN) for one in configs]
    again = _ranked(reference, often, [parameters[k] for k in near])
    scores = ranking.scores.copy()
    scores[near] = again.scores
    return Ranking(scores, near[again.best], frozenset(near[k] for k in again.alike))


def _ranked(
    reference: Reference, models: Sequence[Sequence[Ensemble]], parameters: Sequence[int]
) -> Ranking:
    each = zip(models, parameters, strict=True)
    scores = np.array([scored(reference, *one) for one in each])
    best, observed = int(np.argmax(scores)), reference.observed[BOTH]
    first = models[best][BOTH]
    chance = np.array([of_views[BOTH].parted_by_chance(first, observed) for of_views in models])
    alike = np.flatnonzero(scores[best] - scores <= CLOSE + _DEVIATIONS * chance)
    return Ranking(scores, best, frozenset(alike.tolist()) - {best})
