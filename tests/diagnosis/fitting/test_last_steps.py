"""The last steps of fits: where they end, along what, and how precise that is."""

import dataclasses
import zlib

import numpy as np
import pytest
from made_up.sampler import (
    MadeUpSampler,
    QuickThresholds,
    fitter_of,
    only,
)

from adv2e.config import Config, load_config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Fitted, Slope
from adv2e.diagnosis.fitting.fitter import Fitter

VIEW = splits.TRAIN


class LeapingLaboratory(MadeUpSampler):
    """One whose simulations leap as keys move: by other chance at every place."""

    def measure(self, config, seed, beyond=0.0):
        views = super().measure(config, seed, beyond)
        leaps = np.random.default_rng([seed, zlib.crc32(repr(config).encode())])
        return views + leaps.normal(size=views.shape)


def rounds(count, seeds=6):
    return [range(21 + k * seeds, 21 + (k + 1) * seeds) for k in range(count)]


@pytest.mark.parametrize("alike", [0.0, 0.9])
@pytest.mark.thorough
def test_where_simulations_leap_the_end_of_a_fit_and_its_covariance_are_right(alike):
    """Two parameters, the one of which can be taken for the other in nine parts of ten."""
    sampler = LeapingLaboratory()
    on, off = (sampler.patterns[f"pixel.thresholds.{side}"] for side in ("on", "off"))
    sampler.patterns["pixel.thresholds.off"] = alike * on + np.sqrt(1.0 - alike**2) * off
    truth = load_config([], ["pixel.thresholds.on=0.25", "pixel.thresholds.off=0.22"])
    slow = only("thresholds", 2)
    candidate = QuickThresholds(slow.name, slow.parameters, slow.starts)
    start, goal = (np.array(candidate.scaled(at)) for at in ((0.27, 0.24), (0.25, 0.22)))
    apart, stated = [], []
    for k in range(30):
        fitter = fitter_of(sampler, sampler.measure(truth, 6000 + k)[VIEW])
        fit = Fitted(candidate, Config(), start.copy())
        for _ in range(2):
            fitter.improve([fit], range(11, 17))
        fitter.refine(fit, rounds(6))
        sample = sampler.sample(fit.config, range(3000, 3100))[:, VIEW]
        fitter.set_covariance(fit, fitter.scale.of_values(sample))
        apart.append(fit.point - goal)
        stated.append(fit.deviation)
    seen = np.std(apart, axis=0, ddof=1)
    np.testing.assert_allclose(seen / np.mean(stated, axis=0), 1.0, atol=0.3)
    assert np.all(np.abs(np.mean(apart, axis=0)) < 4.0 * seen / np.sqrt(30))


def test_the_last_steps_reach_the_end_from_far_off():
    sampler = MadeUpSampler(strength=60.0)
    truth = load_config([], ["pixel.refractory.period_us=4000"])
    fitter = fitter_of(sampler, sampler.measure(truth, 5000)[VIEW])
    candidate = only("refractory")
    fit = Fitted(candidate, Config(), np.array(candidate.scaled((2600.0,))))
    fitter.improve([fit], (1, 2))
    fit.point = np.array(candidate.scaled((2600.0,)))
    fitter.refine(fit, rounds(8))
    assert fit.config.pixel.refractory.period_us == pytest.approx(4000.0, rel=0.05)
    assert fit.simulations == 18  # those of the way there do not count
    assert fit.moved < 1.0


def test_the_last_steps_end_where_the_mean_is_known_and_stay_in_the_range():
    parameter = FitParameter("pixel.refractory.period_us", 200.0, 1500.0)
    candidate = Candidate("refractory", (parameter,), ((1000.0,),))
    sampler = MadeUpSampler()
    for truth, told_by in ((1000.0, 18), (4000.0, 6)):
        config = load_config([], [f"pixel.refractory.period_us={truth}"])
        fitter = fitter_of(sampler, sampler.measure(config, 5000)[VIEW])
        (fit,) = fitter.at_best_starts([candidate], Config(), (1, 2))
        fitter.improve([fit], (1, 2))
        fitter.refine(fit, rounds(5))
        assert fit.at_border == (truth > 1500.0)
        assert fit.simulations == told_by


class ToldFitter(Fitter):
    """One that is told what is left, and where it falls, instead of simulating."""

    def __init__(self, told):
        self._told, self.seen = iter(told), []

    def _slopes(self, fit, axes, seeds):
        downhill, left = next(self._told)
        self.seen.append(float(fit.point[0]))
        slope = Slope(np.ones((1, 3)), np.array([[400.0]]), np.array([downhill]), left)
        return slope, slope


@pytest.mark.parametrize(
    ("told", "seen", "last"),
    [
        # far worse: taken back, and a shorter step from there
        ([(400.0, 900.0), (0.0, 1500.0), (200.0, 880.0)], [0.0, 0.3, 0.0], 0.0),
        # not far enough to be sure
        ([(400.0, 900.0), (-20.0, 950.0), (0.0, 900.0)], [0.0, 0.3, 0.25], 0.25),
        # still on its way at the end: not as far as the last step, which nobody has seen
        ([(400.0, 900.0), (400.0, 700.0), (400.0, 500.0)], [0.0, 0.3, 0.6], 0.6),
        # one that is near: steps of whole, half and third weight
        ([(20.0, 30.0), (20.0, 20.0), (20.0, 25.0)], [0.0, 0.05, 0.075], 0.05 * 11 / 6),
    ],
)
def test_last_steps(told, seen, last):
    fitter = ToldFitter(told)
    fit = Fitted(only("leak"), Config(), np.zeros(1), normal=np.array([[400.0]]))
    fitter.refine(fit, rounds(len(told)))
    assert fitter.seen == pytest.approx(seen)
    assert fit.point == pytest.approx([last])


class FormulaFitter(Fitter):
    """One whose two statistics are a formula of the arbiter's times, with chance."""

    def __init__(self, formula, truth):
        self.formula, self.asked = formula, []
        self._whitening = np.eye(2)
        self._observed = np.array(formula(*np.log(truth)))

    def _white_of_seeds(self, configs, seeds, names=()):
        times = [np.log([c.readout.arbiter.event_ns, c.readout.arbiter.row_ns]) for c in configs]
        self.asked.append(np.array(times))
        chance = [np.random.default_rng(seed).normal(size=len(self._observed)) for seed in seeds]
        return np.array([[self.formula(*of) + one for one in chance] for of in times])


def arbiter_at(event_ns, row_ns, normal):
    candidate = only("readout")
    point = np.array(candidate.scaled((event_ns, row_ns)))
    return Fitted(candidate, Config(), point, normal=normal)


def test_keys_that_go_together_are_refined_along_what_is_known():
    def formula(event, row):  # a statistic is as far off as it can be where the sum is by 10 %
        return [30.0 * np.tanh(20.0 * (event + row - 17.0)), 4.0 * (event - row)]

    both, one = np.array([1.0, 1.0]), np.array([1.0, -1.0])
    known = 400.0**2 * np.outer(both, both) + 4.0**2 * np.outer(one, one)
    truth = np.exp([8.6, 8.4])
    fitter, fit = FormulaFitter(formula, truth), arbiter_at(1.02 * truth[0], 0.99 * truth[1], known)
    fitter.refine(fit, rounds(6))
    assert fit.point.sum() == pytest.approx(17.0, abs=0.005)
    assert fit.point == pytest.approx([8.6, 8.4], abs=0.1)
    asked = np.concatenate(fitter.asked)
    # far along the difference, and no farther along the sum than it is known
    assert np.abs(np.diff(asked)).max() > 0.5
    assert np.abs(asked.sum(axis=1) - 17.0).max() < 0.1


def test_beside_a_cliff_the_gentler_side_tells_how_precise_a_fit_is():
    def formula(event, row):
        beyond = event - 8.5
        return [5.0 * beyond + (300.0 * beyond if beyond > 0 else 0.0), 50.0 * (row - 9.0)]

    truth = np.exp([8.5, 9.0])
    fitter, fit = FormulaFitter(formula, truth), arbiter_at(*truth, np.diag([25.0, 2500.0]))
    fitter.refine(fit, rounds(3))
    assert 0.1 < fit.deviation[0] < 0.3  # one by five on this side, by 155 for both
    assert fit.deviation[1] == pytest.approx(1 / 50.0, rel=0.1)


def test_what_is_known_besides_counts_as_a_measurement_of_its_own():
    def formula(event, row):  # says where the first is, to 0.1, and little of the second
        return [10.0 * event, 0.01 * row]

    place = np.array([8.5, 9.0])
    known = ((8.7, 0.1), (9.3, 0.05))
    candidate = dataclasses.replace(only("readout"), known=known)
    fit = Fitted(candidate, Config(), place, normal=np.diag([200.0, 400.0]))
    fitter = FormulaFitter(formula, np.exp(place))
    fitter.refine(fit, rounds(6))
    assert fit.point == pytest.approx([8.6, 9.3], abs=0.03)
    assert fit.deviation == pytest.approx([0.1 / np.sqrt(2.0), 0.05], rel=0.15)
    chance = np.random.default_rng(1).normal(size=(4000, 2))
    fitter.set_covariance(fit, chance)
    told = 0.1 * np.sqrt((1.0 + 1.0 / fit.simulations) / 2.0)
    assert fit.deviation == pytest.approx([told, 0.05], rel=0.05)


def test_no_step_goes_far_from_what_is_known_for_nothing():
    def formula(event, row):
        return [event, row]

    candidate = dataclasses.replace(only("readout"), known=((8.5, 0.01), (9.0, 0.01)))
    fitter = FormulaFitter(formula, np.exp([9.5, 8.0]))
    (fit,) = fitter.at_best_starts([candidate], Config(), (1, 2))
    assert fit.misfit > 1e3  # far from what is known, where every start is
    for _ in range(6):
        fitter.improve([fit], (1, 2))
    assert fit.point == pytest.approx([8.5, 9.0], abs=0.02)
