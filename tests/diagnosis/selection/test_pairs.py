"""Two effects that are missing together, where neither holds alone."""

import numpy as np
import pytest
from made_up.sampler import GONE, RECORDING, MadeUpSampler, candidates, searched

from adv2e.config import Config, load_config
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.selection import joint_fits as joint_fits_module
from adv2e.diagnosis.selection.acceptance import BY_CHANCE
from adv2e.diagnosis.selection.acceptance import objections as real_objections
from adv2e.diagnosis.selection.joint_fits import likely_pairs
from adv2e.diagnosis.selection.reference import Reference
from adv2e.diagnosis.selection.shortlist import best_forms, shortlisted

BOTH_MISSING = ["pixel.refractory.period_us=3000", "readout.loss.fraction=0.2"]


def pairs_of(truth, sampler=None):
    """Return the names of the likely pairs for a recording, the best first."""
    sampler = sampler or MadeUpSampler()
    observed = sampler.measure(load_config([], truth), RECORDING)
    reference = Reference(sampler, observed, Config())
    declared = reference.state(Config(), ())
    trials = best_forms(shortlisted(reference, declared, candidates()))
    pairs = likely_pairs(reference, declared, trials)
    return [{one.name for one in pair} for pair in pairs]


@pytest.fixture
def nothing_holds_alone(monkeypatch):
    """Let no model with a single effect gain anything on the data that judges it."""

    def objections(fit, grown, ground, reference):
        if len(grown.fits) == 1:
            return [BY_CHANCE]
        return real_objections(fit, grown, ground, reference)

    monkeypatch.setattr(joint_fits_module, "objections", objections)


def test_the_two_that_are_missing_are_the_likeliest_pair():
    assert pairs_of(BOTH_MISSING)[0] == {"refractory", "event_loss"}


def test_one_effect_alone_leaves_too_little_for_a_pair():
    assert pairs_of(["pixel.refractory.period_us=3000"]) == []


def test_an_effect_that_would_be_turned_round_makes_no_pair():
    """Two that move the statistics alike explain no more together than one."""
    sampler = MadeUpSampler(alike={"pixel.leak.rate_hz": "pixel.shot_noise.rate_hz"})
    found = pairs_of([*BOTH_MISSING, "pixel.leak.rate_hz=3"], sampler)
    assert {"leak", "shot_noise"} not in found


@pytest.mark.thorough
def test_two_effects_are_found_where_neither_gains_alone(nothing_holds_alone):
    told = []
    _, outcome = searched(BOTH_MISSING, log=told.append)
    assert set(outcome.state.names) == {"refractory", "event_loss"}
    assert verdict_of(outcome, GONE) == "explained"
    assert not any("on trial" in line for line in told)
    config = outcome.state.config
    assert config.pixel.refractory.period_us == pytest.approx(3000.0, rel=0.1)
    assert config.readout.loss.fraction == pytest.approx(0.2, rel=0.1)
    # what was said of them before is no reason any more, and others have theirs
    assert not {"refractory", "event_loss"} & set(outcome.rejected)
    assert {"leak", "shot_noise"} <= set(outcome.rejected)


@pytest.mark.thorough
def test_two_that_do_as_well_are_alternatives(nothing_holds_alone):
    sampler = MadeUpSampler(alike={"pixel.leak.rate_hz": "pixel.shot_noise.rate_hz"})
    truth = ["pixel.refractory.period_us=3000", "pixel.leak.rate_hz=4"]
    _, outcome = searched(truth, sampler)
    assert {*outcome.state.names, *outcome.alternatives} == {"refractory", "leak", "shot_noise"}
    assert len(outcome.state.names) == 2
    assert verdict_of(outcome, GONE) == "not_identifiable"


def test_nothing_is_named_where_no_pair_explains_it(nothing_holds_alone):
    beyond = np.random.default_rng(8).normal(size=40)
    _, outcome = searched(beyond=25.0 * beyond / np.linalg.norm(beyond))
    assert outcome.state.names == ()
    assert verdict_of(outcome, GONE) == "unexplained"
