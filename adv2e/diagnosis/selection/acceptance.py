"""Whether a model is to be taken for the one before it, on data that it was not fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.fitting.fit import Fitted
from adv2e.diagnosis.selection.reference import Bench, State
from adv2e.diagnosis.statistics import BOTH
from adv2e.diagnosis.statistics.metric import Model, shrunk_correlation, whitening

Array = NDArray[np.float64]

_QUIET = 2.5
_SIGNATURE = 12
_WORSE = 9.0
"""Deviations by which a statistic gets worse that is not put down to details of a simulation."""

BORDER = "its fit runs to the end of the physical range"
BY_CHANCE = "what it gains on data it was not fitted to, chance could gain"


def objections(fit: Fitted, grown: State, ground: State, bench: Bench) -> list[str]:
    """Return why a model is not to be taken for the one before it; none: it holds.

    Parameters
    ----------
    fit : Fitted
        Of the model.
    grown, ground : State
        The two, the first as :meth:`~adv2e.diagnosis.selection.reference.Bench.tried`.
    bench : Bench
    """
    observed = bench.observed[parts.JUDGE]
    after, before = grown.models[parts.JUDGE], ground.models[parts.JUDGE]
    # as often as what is tried, by the same seeds: most of chance falls out of the difference
    as_often = bench.tried(ground.config)[parts.JUDGE]
    found = []
    if gain(after, as_often, observed) < chance_gain(after, as_often, observed):
        found.append(BY_CHANCE)
    if fit.at_border:
        found.append(BORDER)
    loud = loudness(after, before, observed)
    if loud > _QUIET:
        found.append(f"what it changes most still stands out by {loud:.1f} deviations")
    for view in (parts.JUDGE, BOTH):
        worst = _worse(grown.models[view], ground.models[view], bench.observed[view])
        if worst is not None:
            name, deviations = bench.laboratory.markers.entries[worst[0]].name, worst[1]
            found.append(
                f"makes '{name}' worse, which then stands out by {deviations:.0f} deviations"
            )
            break
    return found


def gain(after: Model, before: Model, observed: Array) -> float:
    """Return what a model gains over the one before it in log likelihood."""
    return after.log_likelihood(observed) - before.log_likelihood(observed)


def chance_gain(after: Model, before: Model, observed: Array) -> float:
    """Return what a model gains by chance over the one before it, at most.

    On recordings of the one before it, and as far as the gain hangs on which simulations the two
    were made of: where much is left, their chance is multiplied by it.

    Parameters
    ----------
    after, before : Model
        Of simulations with the same seeds.
    observed : (statistics,)
    """
    rows = before.sample
    gains = after.likelihood_of_others(rows) - before.likelihood_of_others(rows)
    deviation = np.hypot(gains.std(), after.parted_by_chance(before, observed))
    return float(max(gains.mean() + 3.0 * deviation, 3.0))


def loudness(after: Model, before: Model, observed: Array) -> float:
    """Return how far the statistics that a model changes most are still off [deviations].

    By the correlations that they have under the model itself: one fact that many of them tell, as
    that few of its hot pixels lie where they were looked for, counts as one.  Under the declared
    model, from which those of all others are taken, there may have been nothing to tell.

    Parameters
    ----------
    after, before : Model
    observed : (statistics,)
    """
    change = np.abs(before.scale.whitening @ (after.mean - before.mean))
    own = np.argsort(-change)[:_SIGNATURE]
    apart = (after.sample[:, own] - after.mean[own]) / after.sd[own]
    white = whitening(shrunk_correlation(apart))
    z = white @ after.z(observed)[own]
    return float(np.sqrt(np.mean(z * z)))


def _worse(after: Model, before: Model, observed: Array) -> tuple[int, float] | None:
    """Return which statistic a model makes worst, and how far it stands out then [deviations].

    None if no statistic gets worse by more than details of a simulation make, or none then stands
    out more than anything did before.
    """
    now, then = np.abs(after.z(observed)), np.abs(before.z(observed))
    worst = int(np.argmax(now - then))
    much = now[worst] > max(then[worst] + _WORSE, 2.0 * then[worst], then.max())
    return (worst, float(now[worst])) if much else None
