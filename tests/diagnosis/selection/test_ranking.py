"""Which of several models explains most, where their likelihoods hang on chance."""

import numpy as np
import pytest

from adv2e.diagnosis.selection.acceptance import CLOSE, ranked
from adv2e.diagnosis.selection.reference import MANY, State
from adv2e.diagnosis.statistics.metric import Ensemble, Scale
from adv2e.diagnosis.statistics.summary import VIEWS

STATISTICS = 30
AMISS = 6.0
"""So far from all models that their likelihoods hang on chance [deviations]."""


class Means:
    """A reference whose models are named by the mean of their statistics.

    Parameters
    ----------
    amiss : float
        By how much the recording is off from a mean of 0, in deviations of each statistic.
    """

    def __init__(self, amiss):
        unit = np.ones(STATISTICS)
        self.scale = Scale(0.0 * unit, unit, np.eye(STATISTICS))
        self.observed = np.full((VIEWS, STATISTICS), amiss)
        self.simulated_again = []

    def _sample(self, mean, seeds):
        self.simulated_again.append(mean)
        draws = [np.random.default_rng([seed, hash(mean) % 2**32]) for seed in seeds]
        return mean + np.array([draw.normal(size=STATISTICS) for draw in draws])

    def ensembles(self, mean, seeds):
        return (Ensemble.of(self.scale, self._sample(mean, seeds)),) * VIEWS

    def state(self, mean):
        ensembles = self.ensembles(mean, range(1, MANY + 1))
        self.simulated_again.clear()
        return State(mean, (), ensembles)


def ranked_means(means, amiss, parameters=None):
    """Return the ranking of models with these means, and which were simulated more often."""
    reference = Means(amiss)
    states = [reference.state(mean) for mean in means]
    return ranked(reference, states, parameters or [1] * len(means)), reference.simulated_again


def parted_by_chance(amiss):
    """Return two means with the same likelihood that few simulations rank far apart."""
    for k in range(1, 200):
        reference = Means(amiss)
        means = (0.0, k * 1e-9)
        of_views = [reference.state(mean).ensembles for mean in means]
        scores = [models[0].log_likelihood(reference.observed[0]) for models in of_views]
        if CLOSE + 1.0 < abs(scores[0] - scores[1]) < CLOSE + 3.0:
            return means
    raise AssertionError


def test_what_only_chance_has_parted_is_alike():
    means = parted_by_chance(AMISS)
    ranking, again = ranked_means(means, AMISS)
    assert sorted({ranking.best} | ranking.alike) == [0, 1]
    assert sorted(again) == sorted(means)
    assert abs(np.subtract(*ranking.scores)) < 2.0 * CLOSE


def test_more_simulations_tell_what_is_worse_from_what_chance_has_parted():
    """And what is far behind is not simulated again."""
    means = parted_by_chance(AMISS)
    ranking, again = ranked_means((*means, -0.1, -0.5), AMISS)
    assert sorted(again) == [-0.1, *means]
    assert sorted({ranking.best} | ranking.alike) == [0, 1]


def test_what_is_as_good_is_alike_at_once():
    ranking, again = ranked_means((0.0, 0.001), 0.0)
    assert len(ranking.alike) == 1
    assert not again


def test_what_is_clearly_worse_is_told_apart_at_once():
    ranking, again = ranked_means((0.0, -1.0), 1.0)
    assert (ranking.best, ranking.alike) == (0, frozenset())
    assert not again
    assert ranking.scores[0] - ranking.scores[1] > CLOSE


def test_each_knob_counts():
    fewer, _ = ranked_means((0.0, 0.0), 0.0, [1, 3])
    assert fewer.best == 0
    assert fewer.scores[0] - fewer.scores[1] == pytest.approx(2.0)


def test_one_alone_is_the_best():
    ranking, again = ranked_means((0.0,), 2.0)
    assert (ranking.best, ranking.alike) == (0, frozenset())
    assert not again
