"""Sizes that would have been seen: recordings with them are, about 8 times in 10."""

import numpy as np
from made_up.sampler import EFFECTS, STATISTICS, MadeUpSampler, candidates, searched

from adv2e.config import Config
from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.outcome.verdict import detectable
from adv2e.diagnosis.selection.search import PER_LOOK
from adv2e.diagnosis.statistics.summary import BOTH


def test_what_would_have_been_seen():
    search, _ = searched()
    found = {one.name: one for one in detectable(search.reference, search.declared, candidates())}
    assert list(found) == list(dict.fromkeys(one.name for one in candidates()))
    assert found["refractory"].unit == "us"
    assert found["refractory"].key == "pixel.refractory.period_us"
    model = search.declared.ensembles[BOTH]
    for one in found.values():
        truth = with_keys(Config(), {one.key: one.size})
        rows = search.reference.sampler.sample(truth, range(90_000, 90_200))[:, BOTH]
        seen = np.mean([model.probability(row) < PER_LOOK for row in rows])
        assert 0.5 < seen < 0.99, one  # of ten recordings each


def test_of_what_cannot_be_seen_no_size_is_told():
    sampler = MadeUpSampler()
    sampler.patterns["pixel.refractory.period_us"] = np.zeros(STATISTICS)
    search, _ = searched(sampler=sampler)
    found = detectable(search.reference, search.declared, candidates())
    assert {one.name for one in found} == set(EFFECTS)
    assert [one.name for one in found if one.size is None] == ["refractory"]


def test_an_effect_too_weak_to_be_seen_has_no_size():
    sampler = MadeUpSampler()
    sampler.patterns["readout.loss.fraction"] = 1e-3 * sampler.patterns["pixel.leak.rate_hz"]
    search, _ = searched(sampler=sampler)
    found = detectable(search.reference, search.declared, candidates())
    assert [one.name for one in found if one.size is None] == ["event_loss"]
