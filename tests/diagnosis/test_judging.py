"""What a model gains by chance over the one before it."""

import numpy as np
import pytest
from made_up_laboratory import MadeUpLaboratory, searched

from adv2e.config import Config
from adv2e.diagnosis import parts
from adv2e.diagnosis.judging import chance_gain, gain
from adv2e.diagnosis.metric import Model, Scale


def test_chance_alone_gains_less_than_it_may():
    laboratory = MadeUpLaboratory()
    search, outcome = searched(["pixel.leak.rate_hz=1"], laboratory)
    bench = search.bench
    before, after = (
        bench.tried(one.config)[parts.JUDGE] for one in (search.declared, outcome.state)
    )
    limit = chance_gain(after, before, search.declared.models[parts.JUDGE].scale.mean)
    gains = [
        after.log_likelihood(row[parts.JUDGE]) - before.log_likelihood(row[parts.JUDGE])
        for row in laboratory.ensemble(Config(), range(80_000, 80_300))
    ]
    assert np.mean(np.array(gains) > limit) < 0.02


@pytest.mark.parametrize("misfit", [0.0, 10.0, 30.0])
@pytest.mark.parametrize("shared", [0, 32])
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
        before, after = Model.of(scale, rows), Model.of(scale, others)
        observed = sample(1)[0] + draw.normal(size=200) * np.sqrt(misfit)
        passed += gain(after, before, observed) >= chance_gain(after, before, observed)
    assert passed <= 3
