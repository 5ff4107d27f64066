"""Two effects that are missing together, where neither holds alone."""

import numpy as np
import pytest
from made_up_laboratory import GONE, RECORDING, MadeUpLaboratory, candidates, searched

from adv2e.config import Config, load_config
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.selection import joint_fits as attempts_module
from adv2e.diagnosis.selection.acceptance import BY_CHANCE
from adv2e.diagnosis.selection.acceptance import objections as real_objections
from adv2e.diagnosis.selection.pairs import likely_pairs
from adv2e.diagnosis.selection.reference import Bench
from adv2e.diagnosis.selection.shortlist import finalists

BOTH_MISSING = ["pixel.refractory.period_us=3000", "readout.loss.fraction=0.2"]


def pairs_of(truth, laboratory=None):
    """Return the names of the likely pairs for a recording, the best first."""
    laboratory = laboratory or MadeUpLaboratory()
    observed = laboratory.measure(load_config([], truth), RECORDING)
    bench = Bench.of(laboratory, observed, Config(), None, lambda text: None)
    declared = bench.state(Config(), ())
    best = {}
    for trial in finalists(bench, declared, candidates()):
        best.setdefault(trial.name, trial)
    pairs = likely_pairs(bench, declared, list(best.values()))
    return [{one.name for one in pair} for pair in pairs]


@pytest.fixture
def nothing_holds_alone(monkeypatch):
    """Let no model with a single effect gain anything on the data that judges it."""

    def objections(fit, grown, ground, bench):
        if len(grown.fits) == 1:
            return [BY_CHANCE]
        return real_objections(fit, grown, ground, bench)

    monkeypatch.setattr(attempts_module, "objections", objections)


def test_the_two_that_are_missing_are_the_likeliest_pair():
    assert pairs_of(BOTH_MISSING)[0] == {"refractory", "event_loss"}


def test_one_effect_alone_leaves_too_little_for_a_pair():
    assert pairs_of(["pixel.refractory.period_us=3000"]) == []


def test_an_effect_that_would_be_turned_round_makes_no_pair():
    """Two that move the statistics alike explain no more together than one."""
    laboratory = MadeUpLaboratory(alike={"pixel.leak.rate_hz": "pixel.shot_noise.rate_hz"})
    found = pairs_of([*BOTH_MISSING, "pixel.leak.rate_hz=3"], laboratory)
    assert {"leak", "shot_noise"} not in found


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


def test_two_that_do_as_well_are_alternatives(nothing_holds_alone):
    laboratory = MadeUpLaboratory(alike={"pixel.leak.rate_hz": "pixel.shot_noise.rate_hz"})
    truth = ["pixel.refractory.period_us=3000", "pixel.leak.rate_hz=4"]
    _, outcome = searched(truth, laboratory)
    assert {*outcome.state.names, *outcome.alternatives} == {"refractory", "leak", "shot_noise"}
    assert len(outcome.state.names) == 2
    assert verdict_of(outcome, GONE) == "not_identifiable"


def test_nothing_is_named_where_no_pair_explains_it(nothing_holds_alone):
    beyond = np.random.default_rng(8).normal(size=40)
    _, outcome = searched(beyond=25.0 * beyond / np.linalg.norm(beyond))
    assert outcome.state.names == ()
    assert verdict_of(outcome, GONE) == "unexplained"
