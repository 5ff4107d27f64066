"""What a model gains by chance over the one before it, and whether its own marker is quiet."""

import numpy as np
import pytest
from made_up.sampler import MadeUpSampler, searched

from adv2e.config import Config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.selection.acceptance import chance_gain, gain, loudness
from adv2e.diagnosis.statistics.metric import Ensemble, Scale


def test_chance_alone_gains_less_than_it_may():
    sampler = MadeUpSampler()
    search, outcome = searched(["pixel.leak.rate_hz=1"], sampler)
    reference = search.reference
    before, after = (
        reference.tried(one.config)[splits.VALIDATION] for one in (search.declared, outcome.state)
    )
    limit = chance_gain(after, before, search.declared.ensembles[splits.VALIDATION].scale.mean)
    gains = [
        after.log_likelihood(row[splits.VALIDATION]) - before.log_likelihood(row[splits.VALIDATION])
        for row in sampler.sample(Config(), range(80_000, 80_300))
    ]
    assert np.mean(np.array(gains) > limit) < 0.02


@pytest.mark.parametrize("misfit", [0.0, 10.0, 30.0])
@pytest.mark.parametrize("shared", [0, 32])
@pytest.mark.quick_cases(1)
def test_a_model_that_does_nothing_gains_what_chance_may(misfit, shared):
    """Also where much is left, which multiplies the chance of the simulations."""
    draw = np.random.default_rng([int(misfit), shared])
    mixing = 0.25 * draw.normal(size=(5, 200))

    def sample(count):
        return draw.normal(size=(count, 5)) @ mixing + 0.8 * draw.normal(size=(count, 200))

    passed = 0
    for _ in range(150):
        scale = Scale.of(sample(100), np.full(200, 0.01))
        rows = sample(32)
        others = np.concatenate([rows[:shared], sample(32 - shared)]) + 1e-9
        before, after = Ensemble.of(scale, rows), Ensemble.of(scale, others)
        observed = sample(1)[0] + draw.normal(size=200) * np.sqrt(misfit)
        passed += gain(after, before, observed) >= chance_gain(after, before, observed)
    assert passed <= 3


def test_one_fact_that_many_statistics_tell_counts_as_one():
    """As how many hot pixels lie in the data for judging: nothing to tell in the declared model."""
    draw = np.random.default_rng(3)
    declared = draw.normal(size=(100, 60))
    changed = np.where(np.arange(60) < 12, 10.0, 0.0)
    hidden = draw.normal(size=(32, 1)) * np.where(np.arange(60) < 4, 1.0, 0.0)
    scale = Scale.of(declared, np.full(60, 0.01))
    before = Ensemble.of(scale, declared[:32])
    after = Ensemble.of(scale, declared[:32] + changed + hidden)
    together, against = np.zeros(60), np.zeros(60)
    together[:4] = 1.0
    against[:4] = [1.0, -1.0, 1.0, -1.0]

    def loud(direction):
        at = after.mean + 4.0 * after.sd * direction
        return loudness(after, before, scale.values_of(at))

    alone = 4.0 * np.sqrt(4.0 / 12.0)
    assert loud(together) < 0.85 * alone
    assert loud(against) > alone
