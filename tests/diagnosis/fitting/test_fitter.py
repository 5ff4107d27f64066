"""Fits on statistics that are smooth functions of the keys: truth, borders, covariance."""

import dataclasses

import numpy as np
import pytest
from made_up.sampler import (
    STATISTICS,
    MadeUpSampler,
    QuickThresholds,
    candidates,
    fitter_of,
    only,
)

from adv2e.config import Config, load_config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.statistics.summary import BOTH

VIEW = splits.TRAIN


def fitted(sampler, truth, candidate, seed=5000, steps=5, seeds=(1, 2, 3, 4)):
    fitter = fitter_of(sampler, sampler.measure(truth, seed)[VIEW])
    (fit,) = fitter.at_best_starts([candidate], Config(), seeds)
    for _ in range(steps):
        fitter.improve([fit], seeds)
    return fit


@pytest.mark.parametrize("curvature", [0.0, 0.3])
@pytest.mark.parametrize(
    ("name", "sets", "value"),
    [
        ("refractory", "pixel.refractory.period_us=2600", 2600.0),
        ("leak", "pixel.leak.rate_hz=3.4", 3.4),
        ("dark_current", "pixel.dark_current.dn=1.2", 1.2),
        ("event_loss", "readout.loss.fraction=0.31", 0.31),
    ],
)
def test_the_truth_is_found(name, sets, value, curvature):
    candidate = only(name)
    fit = fitted(MadeUpSampler(curvature=curvature), load_config([], [sets]), candidate)
    (parameter,), (place,) = candidate.parameters, fit.point
    sd = float(np.sqrt(fit.covariance[0, 0]))
    assert abs(place - parameter.scaled(value)) < 4 * sd
    assert parameter.value_at(place) == pytest.approx(value, rel=0.15)
    assert fit.misfit < 2 * STATISTICS
    assert not fit.at_border


def test_two_knobs_are_found_together():
    truth = load_config([], ["pixel.thresholds.on=0.26", "pixel.thresholds.off=0.17"])
    fit = fitted(MadeUpSampler(), truth, only("thresholds", 2))
    assert fit.config.pixel.thresholds.on == pytest.approx(0.26, rel=0.05)
    assert fit.config.pixel.thresholds.off == pytest.approx(0.17, rel=0.05)
    assert fit.covariance.shape == (2, 2)


@pytest.mark.parametrize("view", [splits.VALIDATION, BOTH])
def test_a_fit_sees_its_view_only(view):
    sampler = MadeUpSampler()
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=3"]), 5000)
    fitter = fitter_of(sampler, observed[view], view)
    (fit,) = fitter.at_best_starts([only("leak")], Config(), (1, 2))
    for _ in range(4):
        fitter.improve([fit], (1, 2))
    assert fit.config.pixel.leak.rate_hz == pytest.approx(3.0, rel=0.15)


@pytest.mark.thorough
def test_the_covariance_is_that_of_repeated_draws():
    sampler = MadeUpSampler()
    truth = load_config([], ["pixel.thresholds.on=0.25", "pixel.thresholds.off=0.22"])
    slow = only("thresholds", 2)
    candidate = QuickThresholds(slow.name, slow.parameters, slow.starts)
    place = candidate.scaled((0.3, 0.1))
    assert candidate.applied(truth, place) == slow.applied(truth, place)
    places, spreads = [], []
    for k in range(40):
        seeds = range(100 + 3 * k, 103 + 3 * k)
        fit = fitted(sampler, truth, candidate, 6000 + k, steps=3, seeds=seeds)
        places.append(fit.point)
        spreads.append(np.diag(fit.covariance))
    stated = np.sqrt(np.mean(spreads, axis=0))
    seen = np.std(places, axis=0, ddof=1)
    # the deviation of forty draws is itself known to a ninth
    np.testing.assert_allclose(seen / stated, 1.0, atol=0.3)
    off = np.mean(places, axis=0) - candidate.scaled((0.25, 0.22))
    assert np.all(np.abs(off) < 4 * stated / np.sqrt(40))


@pytest.mark.thorough
def test_the_covariance_of_simulations_does_not_depend_on_weights():
    """Chance moves statistics together, and by twice as much as they are weighed by."""
    pattern = MadeUpSampler().patterns["pixel.thresholds.on"]
    sampler = MadeUpSampler(common=2.0 * pattern / np.linalg.norm(pattern))
    sd = np.full(STATISTICS, 0.5)
    truth = load_config([], ["pixel.thresholds.on=0.25", "pixel.thresholds.off=0.22"])
    slow = only("thresholds", 2)
    candidate = QuickThresholds(slow.name, slow.parameters, slow.starts)
    places, plain, known = [], [], []
    for k in range(40):
        seeds = range(100 + 3 * k, 103 + 3 * k)
        fitter = fitter_of(sampler, sampler.measure(truth, 6000 + k)[VIEW], sd=sd)
        (fit,) = fitter.at_best_starts([candidate], Config(), seeds)
        for _ in range(3):
            fitter.improve([fit], seeds)
        places.append(fit.point)
        plain.append(np.diag(fit.covariance))
        sample = sampler.sample(fit.config, range(3000, 3100))[:, VIEW]
        fitter.set_covariance(fit, fitter.scale.of_values(sample))
        known.append(np.diag(fit.covariance))
    seen = np.std(places, axis=0, ddof=1)
    np.testing.assert_allclose(seen / np.sqrt(np.mean(known, axis=0)), 1.0, atol=0.3)
    assert np.all(seen > 1.2 * np.sqrt(np.mean(plain, axis=0)))


@pytest.mark.parametrize(("truth", "end"), [(4000.0, "high"), (30.0, "low")])
def test_a_fit_stays_in_its_range(truth, end):
    parameter = FitParameter("pixel.refractory.period_us", 200.0, 1500.0)
    candidate = Candidate("refractory", (parameter,), ((300.0,), (1000.0,)))
    config = load_config([], [f"pixel.refractory.period_us={truth}"])
    fit = fitted(MadeUpSampler(), config, candidate, steps=6)
    assert fit.at_border
    assert fit.config.pixel.refractory.period_us == pytest.approx(getattr(parameter, end))
    low, high = map(parameter.scaled, (parameter.low, parameter.high))
    assert low - 1e-9 <= fit.point[0] <= high + 1e-9


def test_a_fit_leaves_the_end_of_its_range():
    parameter = FitParameter("pixel.refractory.period_us", 200.0, 8000.0)
    for start in (200.0, 8000.0):
        candidate = Candidate("refractory", (parameter,), ((start,),))
        truth = load_config([], ["pixel.refractory.period_us=1200"])
        fit = fitted(MadeUpSampler(), truth, candidate, steps=7)
        assert fit.config.pixel.refractory.period_us == pytest.approx(1200.0, rel=0.1)


def test_a_negative_end_is_a_border():
    parameter = FitParameter("frames.clock_offset_us", -2000.0, 2000.0, False, 500.0)
    candidate = Candidate("clock_offset", (parameter,), ((0.0,),))
    for place, there in ((-4.0, True), (4.0, True), (-3.9, False), (0.0, False)):
        assert Fitted(candidate, Config(), np.array([place])).at_border == there


def test_a_probe_beyond_the_range_starts_at_its_end():
    parameter = FitParameter("pixel.thresholds.mismatch", 1e-3, 0.5)
    candidate = Candidate("threshold_mismatch", (parameter,), ((1.2,),))
    sampler = MadeUpSampler()
    truth = load_config([], ["pixel.thresholds.mismatch=0.3"])
    fitter = fitter_of(sampler, sampler.measure(truth, 5000)[VIEW])
    (fit,) = fitter.at_best_starts([candidate], Config(), (1, 2))
    assert parameter.value_at(fit.point[0]) == pytest.approx(0.5)
    assert fit.point[0] == parameter.scaled(0.5)


def test_the_best_probe_is_where_a_fit_begins():
    sampler = MadeUpSampler()
    truth = load_config([], ["pixel.refractory.period_us=14000"])
    fitter = fitter_of(sampler, sampler.measure(truth, 5000)[VIEW])
    leak, refractory = only("leak"), only("refractory")
    fits = fitter.at_best_starts([leak, refractory], Config(), (1, 2))
    assert [fit.candidate for fit in fits] == [leak, refractory]
    assert fits[1].point.tolist() == refractory.scaled((15000.0,))
    assert fits[1].misfit < fits[0].misfit
    assert fits[1].misfit == pytest.approx(fitter.misfit(fits[1].config, (1, 2)))


def test_a_step_never_makes_it_worse():
    sampler = MadeUpSampler(curvature=0.5)
    truth = load_config([], ["pixel.leak.rate_hz=8", "pixel.shot_noise.rate_hz=0.5"])
    fitter = fitter_of(sampler, sampler.measure(truth, 5000)[VIEW])
    fits = fitter.at_best_starts(candidates(), Config(), (1, 2))
    for _ in range(4):
        before = [(fit.misfit, fit.point, fit.damping) for fit in fits]
        fitter.improve(fits, (1, 2))
        for fit, (misfit, place, damping) in zip(fits, before, strict=True):
            assert fit.misfit <= misfit + 1e-6
            assert fit.misfit == pytest.approx(fitter.misfit(fit.config, (1, 2)))
            # whichever share of the step was taken, it is one step
            assert fit.moved == pytest.approx(np.max(np.abs(fit.point - place) / fit.deviation))
            factor = 0.25 if fit.moved else 4.0
            assert fit.damping == pytest.approx(max(factor * damping, 1e-3))


def test_many_fits_move_as_one_alone():
    sampler = MadeUpSampler()
    truth = load_config([], ["pixel.leak.rate_hz=4"])
    fitter = fitter_of(sampler, sampler.measure(truth, 5000)[VIEW])
    together = fitter.at_best_starts(candidates(), Config(), (1, 2))
    alone = [dataclasses.replace(fit) for fit in together]
    fitter.improve(together, (1, 2))
    for fit, single in zip(together, alone, strict=True):
        fitter.improve([single], (1, 2))
        np.testing.assert_allclose(fit.point, single.point)
        assert fit.misfit == pytest.approx(single.misfit)


def test_what_has_no_knob_is_probed_and_stays():
    sampler = MadeUpSampler()
    candidate = Candidate("timestamp_tick", (), ((),), (("readout.tick_us", 10.0),))
    fitter = fitter_of(sampler, sampler.measure(Config(), 5000)[VIEW])
    (fit,) = fitter.at_best_starts([candidate], Config(), (1, 2))
    fitter.improve([fit], (1, 2))
    assert fit.point.shape == (0,)
    assert fit.config.readout.tick_us == 10.0
    assert np.isfinite(fit.misfit)
    assert not fit.at_border


def test_deviations_given_weigh_the_statistics():
    sampler = MadeUpSampler()
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=1"]), 5000)[VIEW]
    plain, half = (
        fitter_of(sampler, observed),
        fitter_of(sampler, observed, sd=np.full(STATISTICS, 2.0)),
    )
    assert half.misfit(Config(), (1, 2)) == pytest.approx(plain.misfit(Config(), (1, 2)) / 4)


def test_the_same_seeds_give_the_same_fit():
    truth = load_config([], ["pixel.leak.rate_hz=4"])
    one, two = (fitted(MadeUpSampler(), truth, only("leak")) for _ in range(2))
    np.testing.assert_array_equal(one.point, two.point)
    np.testing.assert_array_equal(one.covariance, two.covariance)
