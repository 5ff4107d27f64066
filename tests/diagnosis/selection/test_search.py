"""The search for what is missing, on a sampler without simulations."""

import dataclasses
import math

import numpy as np
import pytest
from made_up.sampler import (
    EFFECTS,
    GONE,
    HINTS,
    RECORDING,
    STATISTICS,
    MadeUpSampler,
    candidates,
    error,
    fits_of,
    outside,
    refitted,
    search_of,
    searched,
)

from adv2e.config import Config, load_config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.fitter import threshold_nuisance, thresholds_of
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.outcome.findings import finding_of
from adv2e.diagnosis.outcome.verdict import detectable, verdict_of
from adv2e.diagnosis.selection import joint_fits as joint_fits_module
from adv2e.diagnosis.selection.acceptance import BY_CHANCE, objections
from adv2e.diagnosis.selection.reference import Rejections
from adv2e.diagnosis.selection.search import LEVEL
from adv2e.diagnosis.selection.shortlist import best_forms, shortlisted
from adv2e.diagnosis.statistics.summary import BOTH, VIEWS
from adv2e.diagnosis.statistics.uncertainty import FrameError


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_missing_is_consistent(seed):
    search, outcome = searched(seed=RECORDING + seed)
    assert verdict_of(outcome, GONE) == "consistent"
    assert outcome.state is search.declared
    assert outcome.state.names == ()
    assert outcome.probability >= LEVEL
    assert (outcome.alternatives, outcome.rejected) == ([], {})


@pytest.mark.parametrize(
    ("name", "sets", "value"),
    [
        ("refractory", "pixel.refractory.period_us=1500", 1500.0),
        ("leak", "pixel.leak.rate_hz=2.5", 2.5),
        ("dark_current", "pixel.dark_current.dn=2", 2.0),
        ("event_loss", "readout.loss.fraction=0.2", 0.2),
        ("thresholds", "pixel.thresholds.off=0.26", 0.26),
    ],
)
def test_one_effect_is_named(name, sets, value):
    _, outcome = searched([sets])
    assert outcome.state.names == (name,)
    assert verdict_of(outcome, GONE) == "explained"
    finding = finding_of(outcome.state.fits[0], 100, outcome.state.config)
    (key,) = (key for key in finding.parameters if key == sets.partition("=")[0])
    low, high = finding.interval[key]
    assert low < finding.parameters[key] < high
    assert finding.parameters[key] == pytest.approx(value, rel=0.15)
    assert low * 0.9 < value < high * 1.1
    assert outcome.explained == pytest.approx(1.0, abs=0.1)
    assert name not in outcome.rejected
    assert set(outcome.rejected) <= set(EFFECTS)
    assert all(one.reason for one in outcome.rejected.values())


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [(9.0, 3.0, 1.0), (9.0, 6.0, 0.5), (3.0, 2.0, 0.0), (2.0, 2.5, 0.0), (2.0, 1.0, 0.0)],
)
def test_below_the_floor_there_is_nothing_to_explain(monkeypatch, before, after, share):
    search, outcome = searched(["pixel.leak.rate_hz=2.5"])
    floor = outcome.state.ensembles[BOTH].floor
    misfits = {id(search.declared): before, id(outcome.state): after}

    def misfit(reference, state, view=BOTH):
        return floor + (misfits[id(state)] - 3.0)

    monkeypatch.setattr(type(search.reference), "misfit", misfit)
    assert search.explained(outcome.state) == pytest.approx(share)


def test_of_the_forms_of_an_effect_the_plainest_that_does_is_taken():
    _, outcome = searched(["pixel.thresholds.on=0.27"])
    (fit,) = outcome.state.fits
    assert [parameter.key for parameter in fit.candidate.parameters] == ["pixel.thresholds.on"]
    _, outcome = searched(["pixel.thresholds.on=0.27", "pixel.thresholds.off=0.15"])
    (fit,) = outcome.state.fits
    assert len(fit.candidate.parameters) == 2


def test_effects_that_look_alike_are_alternatives():
    sampler = MadeUpSampler(alike={"pixel.leak.rate_hz": "pixel.shot_noise.rate_hz"})
    _, outcome = searched(["pixel.leak.rate_hz=4"], sampler)
    found = {*outcome.state.names, *outcome.alternatives}
    assert found == {"leak", "shot_noise"}
    assert len(outcome.state.names) == len(outcome.alternatives) == 1
    assert verdict_of(outcome, GONE) == "not_identifiable"


def test_what_no_effect_makes_is_not_explained():
    _, outcome = searched(beyond=outside(25.0))
    assert outcome.probability < LEVEL
    assert verdict_of(outcome, GONE) == "unexplained"
    assert set(outcome.rejected) | set(outcome.state.names) == set(EFFECTS)


@pytest.mark.thorough
def test_patches_on_something_unknown_are_not_laid_one_on_another(monkeypatch):
    monkeypatch.setattr(joint_fits_module, "objections", lambda *of_what: [])
    told = []
    _, outcome = searched(
        ["pixel.refractory.period_us=3000"], beyond=outside(60.0), log=told.append
    )
    assert outcome.state.names == ()
    assert sum("too little" in line for line in told) == 1
    assert sum("of what is left" in one.reason for one in outcome.rejected.values()) == 1
    # an effect that is large beside what is unknown goes in, and nothing on top of it
    told.clear()
    _, outcome = searched(
        ["pixel.refractory.period_us=8000"], beyond=outside(12.0), log=told.append
    )
    assert outcome.state.names == ("refractory",)
    assert "too little" in told[-1]


def test_an_effect_beside_something_unknown_is_a_part():
    _, outcome = searched(["pixel.refractory.period_us=8000"], beyond=outside(12.0))
    assert outcome.state.names[0] == "refractory"
    assert outcome.probability < LEVEL
    assert outcome.explained >= 0.8
    assert verdict_of(outcome, GONE) == "partly_explained"
    # the statistics alone do not make a name: the events have to come where they were measured
    assert verdict_of(outcome, error(0.8, 0.48, 0.4)) == "unexplained"
    assert verdict_of(outcome, error(0.8, 0.43, 0.4)) == "partly_explained"
    # nor does chance, where the recording has none
    assert verdict_of(outcome, error(0.3, 0.32, 0.35)) == "unexplained"
    # but where the error tells nothing, they decide
    assert verdict_of(outcome, error(0.41, 0.41, 0.4)) == "partly_explained"
    assert verdict_of(outcome, error(math.nan, math.nan, math.nan)) == "partly_explained"


@pytest.mark.thorough
def test_what_cannot_be_undone_in_full_leaves_more_that_is_put_down_to_the_fit():
    library = [
        dataclasses.replace(one, left=0.2 if one.name == "refractory" else one.left)
        for one in candidates()
    ]
    told = ["pixel.refractory.period_us=8000"]
    _, outcome = searched(told, library=library, beyond=outside(12.0))
    assert outcome.state.names == ("refractory",)
    assert outcome.probability < LEVEL
    assert 0.8 <= outcome.explained < 0.98
    assert verdict_of(outcome, GONE) == "explained"
    _, outcome = searched(told, library=library, beyond=outside(40.0))
    assert verdict_of(outcome, GONE) != "explained"


@pytest.mark.thorough
def test_a_small_effect_beside_a_large_one_is_found():
    """It is less than what a fit may leave, but no fit leaves it."""
    truth = ["pixel.refractory.period_us=8000", "pixel.leak.rate_hz=0.3"]
    _, outcome = searched(truth, MadeUpSampler(strength=60.0))
    search, alone = searched(truth, MadeUpSampler(strength=60.0), candidates("refractory"))
    assert alone.state.names == ("refractory",)
    assert alone.probability < LEVEL / 100
    assert not search._is_something_left(alone.state)
    assert set(outcome.state.names) == {"refractory", "leak"}
    assert verdict_of(outcome, GONE) == "explained"


@pytest.mark.parametrize(("rate", "size"), [(0.1, 12.0), (0.17, 11.0)])
@pytest.mark.quick_cases(1)
def test_what_a_fit_may_leave_is_given_no_name_but_that_of_most_of_it(rate, size):
    truth = ["pixel.refractory.period_us=8000", f"pixel.leak.rate_hz={rate}"]
    told = []
    sampler = MadeUpSampler(strength=60.0)
    _, outcome = searched(truth, sampler, beyond=outside(size), log=told.append)
    assert outcome.state.names == ("refractory",)
    assert outcome.probability < LEVEL / 2
    assert verdict_of(outcome, GONE) == "explained"
    held = rate > 0.1
    assert told[-1].endswith("too little") is held
    assert ("of what is left" in outcome.rejected["leak"].reason) is held


@pytest.mark.parametrize(("period", "rate"), [(5000.0, 1.0), (900.0, 1.0), (15_000.0, 0.7)])
def test_two_effects_are_both_found(period, rate):
    truth = [f"pixel.refractory.period_us={period}", f"pixel.leak.rate_hz={rate}"]
    _, outcome = searched(truth)
    assert set(outcome.state.names) == {"refractory", "leak"}
    assert verdict_of(outcome, GONE) == "explained"
    config = outcome.state.config
    assert config.pixel.refractory.period_us == pytest.approx(period, rel=0.1)
    assert config.pixel.leak.rate_hz == pytest.approx(rate, rel=0.2)
    for fit in outcome.state.fits:
        assert fit.covariance.shape == (1, 1)
        assert finding_of(fit, 100, fit.config).interval


def test_what_holds_is_no_name_where_what_does_not_explains_far_more(monkeypatch):
    def objecting(fit, grown, ground, reference):
        return [] if grown.names == ("leak",) else ["something else stands out"]

    monkeypatch.setattr(joint_fits_module, "objections", objecting)
    truth = ["pixel.refractory.period_us=1900", "pixel.leak.rate_hz=1.2"]
    library = [*candidates("refractory"), *candidates("leak")]
    _, outcome = searched(truth, library=library)
    assert outcome.state.names == ()
    assert verdict_of(outcome, GONE) == "unexplained"
    assert "refractory, which does not, explains far more" in outcome.rejected["leak"].reason
    assert outcome.rejected["refractory"].reason == "something else stands out"
    _, outcome = searched(["pixel.leak.rate_hz=4"], library=library)
    assert outcome.state.names == ("leak",)


def test_backward_drops_what_the_others_do_without():
    sampler = MadeUpSampler()
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=4"]), RECORDING)
    search = search_of(sampler, observed, Config(), candidates())
    fits = fits_of(("dark_current", 0.05), ("leak", 4.0))
    state = refitted(search, fits)
    assert state.names == ("dark_current", "leak")
    assert search._backward(state).names == ("leak",)
    assert "not needed" in search.reference.rejections.held["dark_current"].reason


@pytest.mark.parametrize("last", [True, False])
@pytest.mark.parametrize(
    ("dark_dn", "in_test_dn", "reason"),
    [
        (1.0, 0.0, "on data that nothing was fitted to, the others do as well without it"),
        (0.2, 0.2, "without it, the others leave nothing that chance could not make"),
        (1.0, 1.0, None),
    ],
)
def test_a_name_earns_its_place_by_what_it_explains_alone(dark_dn, in_test_dn, reason, last):
    """Not where all that it gains is in the data fitted to, nor where the others leave nothing."""
    sampler, leak = MadeUpSampler(), "pixel.leak.rate_hz=4"
    truth, of_test = (
        load_config([], [leak, f"pixel.dark_current={{dn: {dn}}}"]) for dn in (dark_dn, in_test_dn)
    )
    observed = sampler.measure(truth, RECORDING)
    observed[splits.TEST] = sampler.measure(of_test, RECORDING)[splits.TEST]
    search = search_of(sampler, observed, Config(), candidates())
    effects = [("leak", 4.0), ("dark_current", dark_dn)]
    state = refitted(search, fits_of(*(effects if last else effects[::-1])))
    found = search._backward(state)
    if reason is None:
        assert found is state
    else:
        assert found.names == ("leak",)
        assert search.reference.rejections.held["dark_current"].reason == reason


def test_alternatives_of_what_is_dropped_go_with_it():
    sampler = MadeUpSampler()
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=4"]), RECORDING)
    search = search_of(sampler, observed, Config(), candidates())
    fits = fits_of(("dark_current", 0.05), ("leak", 4.0))
    alike = {"dark_current": frozenset({"refractory"}), "leak": frozenset({"event_loss"})}
    state = dataclasses.replace(refitted(search, fits), alternatives=alike)
    assert search._backward(state).alternatives == {"leak": frozenset({"event_loss"})}


def test_backward_keeps_what_is_needed():
    truth = load_config([], ["pixel.leak.rate_hz=4", "pixel.refractory.period_us=2500"])
    sampler = MadeUpSampler()
    search = search_of(sampler, sampler.measure(truth, RECORDING), Config(), candidates())
    fits = fits_of(("refractory", 2500.0), ("leak", 4.0))
    state = refitted(search, fits)
    assert search._backward(state) is state


def test_thresholds_that_are_not_known_are_fitted_with_what_is_found():
    """Matched to the totals first, they have taken some of what is missing."""
    wrong = load_config([], ["pixel.thresholds={on: 0.22, off: 0.19}"])
    sampler = MadeUpSampler()
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=4"]), RECORDING)
    search = search_of(sampler, observed, wrong, candidates(), nuisances=threshold_nuisance(wrong))
    outcome = search.run()
    assert outcome.state.names == ("leak",)
    assert outcome.state.config.pixel.leak.rate_hz == pytest.approx(4.0, rel=0.1)
    levels = thresholds_of(outcome.state.config)
    assert list(levels.values()) == pytest.approx([0.2, 0.2], rel=0.02)
    (fit,) = outcome.state.fits
    assert fit.covariance.shape == (1, 1)
    assert "thresholds" not in outcome.rejected


def test_what_is_left_out_of_the_library_is_not_named():
    library = [one for one in candidates() if one.name != "refractory"]
    _, outcome = searched(["pixel.refractory.period_us=6000"], library=library)
    assert "refractory" not in (*outcome.state.names, *outcome.rejected)
    assert verdict_of(outcome, GONE) == "unexplained"


def test_an_empty_library_explains_nothing():
    search, outcome = searched(["pixel.refractory.period_us=6000"], library=[])
    assert verdict_of(outcome, GONE) == "unexplained"
    assert outcome.rejected == {}
    assert detectable(search.reference, search.declared, []) == []


def test_a_fit_at_the_end_of_its_range_is_not_taken():
    parameter = FitParameter("pixel.leak.rate_hz", 1e-3, 2.0)
    library = [Candidate("leak", (parameter,), ((0.5,), (1.0,)))]
    _, outcome = searched(["pixel.leak.rate_hz=2.6"], library=library)
    assert outcome.state.names == ()
    assert "end of the physical range" in outcome.rejected["leak"].reason
    assert verdict_of(outcome, GONE) == "unexplained"


def test_the_declared_model_is_the_ground():
    declared = load_config([], ["pixel.leak.rate_hz=2"])
    _, outcome = searched(["pixel.leak.rate_hz=2"], declared=declared)
    assert verdict_of(outcome, GONE) == "consistent"
    _, outcome = searched(["pixel.leak.rate_hz=0.2"], declared=declared)
    assert outcome.state.names == ("leak",)
    assert outcome.state.config.pixel.leak.rate_hz == pytest.approx(0.2, rel=0.4)


def test_the_same_recording_has_the_same_result():
    one, two = (searched(["pixel.leak.rate_hz=4"])[1] for _ in range(2))
    assert one.state.config == two.state.config
    assert one.probability == two.probability
    assert one.rejected == two.rejected


@pytest.mark.thorough
def test_two_effects_that_hide_one_another_are_found_together():
    """Alone, either leaves so much of the other that what it changes most stands out."""
    sampler = MadeUpSampler(strength=60.0)
    shared = sampler.patterns["pixel.leak.rate_hz"]
    other = sampler.patterns["pixel.refractory.period_us"]
    sampler.patterns["pixel.refractory.period_us"] = 0.6 * shared + 0.6 * other
    truth = ["pixel.refractory.period_us=4000", "pixel.leak.rate_hz=4"]
    search, outcome = searched(truth, sampler)
    alone = search.reference, search.declared
    trials = best_forms(shortlisted(*alone, search.candidates))
    single = joint_fits_module.with_one_more(*alone, trials, [search.declared])
    assert all(one.objections for one in single)
    assert set(outcome.state.names) == {"refractory", "leak"}
    assert verdict_of(outcome, GONE) == "explained"
    assert outcome.state.config.pixel.refractory.period_us == pytest.approx(4000.0, rel=0.1)


def test_an_effect_that_makes_something_worse_is_not_taken():
    """What is missing moves the others as leak does, and one statistic the other way."""
    sampler = MadeUpSampler()
    pattern = sampler.patterns["pixel.leak.rate_hz"]
    largest = int(np.argmax(np.abs(pattern)))
    beyond = 0.9 * pattern
    beyond[largest] *= -1.0
    _, outcome = searched(sampler=sampler, library=candidates("leak"), beyond=beyond)
    assert f"makes 'statistic {largest}' worse" in outcome.rejected["leak"].reason
    assert verdict_of(outcome, GONE) == "unexplained"


def test_a_look_alike_says_what_it_cannot_be_told_from():
    sampler = MadeUpSampler(alike={"pixel.leak.rate_hz": "pixel.shot_noise.rate_hz"})
    _, outcome = searched(["pixel.leak.rate_hz=4"], sampler)
    (named,), (other,) = outcome.state.names, outcome.alternatives
    assert f"as well as {named}" in outcome.rejected[other].reason


def test_backward_drops_one_after_another():
    sampler = MadeUpSampler()
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=4"]), RECORDING)
    search = search_of(sampler, observed, Config(), candidates())
    fits = fits_of(("dark_current", 0.05), ("event_loss", 0.002), ("leak", 4.0))
    assert search._backward(refitted(search, fits)).names == ("leak",)


def test_the_reason_of_the_best_form_is_kept():
    def fit(value):
        (one, *_) = candidates("leak")
        return Fitted(one, Config(), np.array(one.scaled((value,))))

    reasons = Rejections()
    reasons.add(fit(2.0), "best form")
    reasons.add(fit(3.0), "another form")
    assert reasons.held["leak"].reason == "best form"
    reasons.add(fit(2.0), "validated", final=True)
    assert reasons.held["leak"].reason == "validated"
    reasons.new_round()
    reasons.add(fit(4.0), "next round")
    assert reasons.held["leak"].reason == "next round"
    assert reasons.held["leak"].parameters == {"pixel.leak.rate_hz": pytest.approx(4.0)}


class Doubted:
    """Frames that are shifted by parts of a pixel make all statistics uncertain."""

    def __init__(self, sd):
        self._error = FrameError(np.zeros((VIEWS, STATISTICS)), np.full((VIEWS, STATISTICS), sd))

    def error(self, config):
        return self._error if any(config.frames.shift_px) else None


def test_a_shift_of_the_frames_gains_nothing_by_the_doubt_that_it_brings():
    """Beside what is missing, something stands out that no effect makes, nor a shift."""
    sampler = MadeUpSampler()
    truth = load_config([], ["pixel.leak.rate_hz=4"])
    observed = sampler.measure(truth, RECORDING, outside(12.0))
    shift = next(one for one in library(Config(), HINTS) if one.name == "misregistration")
    search = search_of(sampler, observed, Config(), [*candidates("leak"), shift])
    search.reference._resampling = Doubted(2.0)
    alone = refitted(search, fits_of(("leak", 4.0)))
    moved = Fitted(shift, Config(), np.array(shift.scaled((0.3, 0.1))))
    both = refitted(search, (*alone.fits, moved))
    assert search.reference.likelihood(both) > search.reference.likelihood(alone) + 20.0
    grown = dataclasses.replace(both, ensembles=search.reference.tried(both.config))
    assert BY_CHANCE in objections(moved, grown, alone, search.reference)
    assert search._backward(both).names == ("leak",)
