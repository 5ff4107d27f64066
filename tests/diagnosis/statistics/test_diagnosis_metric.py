"""How far a recording is from simulations: calibration on Gaussians that are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from adv2e.diagnosis.statistics.groups import Entry, counted, least_deviations, stabilised
from adv2e.diagnosis.statistics.metric import (
    Ensemble,
    Scale,
    _gumbel,
    _log_normal,
    _tail,
    compressed,
)

STATISTICS, SEEDS = 200, 160


class World:
    """A Gaussian of 200 correlated statistics in units of very different sizes."""

    def __init__(self, seed=0, statistics=STATISTICS, factors=6):
        draw = np.random.default_rng(seed)
        mixing = 0.5 * draw.normal(size=(factors, statistics)) / np.sqrt(factors)
        self.mixing, self.unit = mixing, 10.0 ** draw.uniform(-3, 3, statistics)
        self.mean = draw.normal(size=statistics) * self.unit * 5

    def sample(self, count, draw, shift=0.0):
        n, k = self.mixing.shape
        z = draw.normal(size=(count, n)) @ self.mixing + draw.normal(size=(count, k))
        return self.mean + self.unit * (z + shift)

    def model(self, draw, seeds=SEEDS):
        least = 0.01 * self.unit
        scale = Scale.of(self.sample(seeds, draw), least)
        return scale, Ensemble.of(scale, self.sample(seeds, draw))


@pytest.fixture(scope="module")
def probabilities():
    """Return p-values of 600 draws of worlds that models were made of."""
    found = []
    for seed in range(12):
        draw = np.random.default_rng([seed, 1])
        world = World(seed)
        _, model = world.model(draw)
        found += [model.probability(row) for row in world.sample(50, draw)]
    return np.array(found)


@pytest.mark.parametrize("level", [0.02, 0.05, 0.1, 0.2, 0.5])
def test_what_chance_makes_is_taken_for_chance(probabilities, level):
    seen = int(np.count_nonzero(probabilities <= level))
    n = len(probabilities)
    # two tests at half the level each: at most the level, and at least half of it
    assert seen <= stats.binom.ppf(0.9995, n, level * 1.1)
    assert seen >= stats.binom.ppf(0.0005, n, level * 0.4)


def test_far_probabilities_are_not_too_small(probabilities):
    assert np.count_nonzero(probabilities < 1e-3) <= stats.binom.ppf(0.9999, 600, 2e-3)
    assert probabilities.min() > 1e-7


def test_shifts_are_less_probable_the_larger_they_are():
    draw = np.random.default_rng(3)
    world = World(3)
    _, model = world.model(draw)
    base = world.sample(1, draw)[0]
    direction = world.unit * np.sign(base - world.mean)
    found = [model.probability(base + k * direction) for k in (0.0, 0.5, 1.0, 2.0, 4.0)]
    misfits = [model.misfit(base + k * direction) for k in (0.0, 0.5, 1.0, 2.0, 4.0)]
    assert misfits == sorted(misfits)
    assert found == sorted(found, reverse=True)
    assert found[0] > 0.01
    assert found[-1] < 1e-6


def test_one_statistic_alone_is_seen():
    draw = np.random.default_rng(4)
    world = World(4)
    _, model = world.model(draw)
    quiet = world.sample(1, draw)[0]
    loud = quiet.copy()
    loud[17] = world.mean[17] + 30 * world.unit[17]
    assert model.probability(loud) < 0.01 < model.probability(quiet)


def test_a_broad_shift_is_seen_that_no_statistic_shows_alone():
    draw = np.random.default_rng(5)
    world = World(5, factors=1)
    _, model = world.model(draw)
    quiet = world.sample(1, draw)[0]
    signs = np.where(np.arange(STATISTICS) % 2, 1.0, -1.0)
    broad = quiet + 1.5 * world.unit * signs
    assert np.abs(model.z(broad)).max() < 6
    assert model.probability(broad) < 1e-3 < model.probability(quiet)


# --- scale ---------------------------------------------------------------------------------------


def test_whitening_takes_the_correlation_away():
    scale, _ = World(6).model(np.random.default_rng(6))
    found = scale.whitening @ scale.correlation @ scale.whitening.T
    np.testing.assert_allclose(found, np.eye(STATISTICS), atol=1e-9)


def test_correlations_are_shrunk_by_half():
    draw = np.random.default_rng(7)
    base = draw.normal(size=(4000, 1))
    sample = np.hstack(
        [base, base + 0.01 * draw.normal(size=(4000, 1)), draw.normal(size=(4000, 1))]
    )
    correlation = Scale.of(sample, np.full(3, 1e-6)).correlation
    np.testing.assert_allclose(np.diag(correlation), 1.0)
    assert correlation[0, 1] == pytest.approx(0.5, abs=0.01)
    assert abs(correlation[0, 2]) < 0.03


def test_what_hardly_varies_has_the_least_deviation():
    sample = np.column_stack([np.full(20, 7.0), np.linspace(0, 1e-6, 20), np.arange(20.0)])
    scale = Scale.of(sample, np.full(3, 0.5))
    assert scale.sd.tolist()[:2] == [0.5, 0.5]
    assert scale.sd[2] == pytest.approx(np.arange(20.0).std(ddof=1))
    assert np.all(np.isfinite(scale.whitening))


def test_fewer_seeds_than_statistics_will_do():
    scale, model = World(8).model(np.random.default_rng(8), seeds=16)
    assert np.all(np.isfinite(scale.whitening))
    assert np.isfinite(model.floor)


@settings(deadline=None)
@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_compression_keeps_the_order_and_small_values(a, b):
    low, high = sorted((a, b))
    assert compressed(np.array(low)) <= compressed(np.array(high))
    assert compressed(np.array(-a)) == pytest.approx(-compressed(np.array(a)))
    assert abs(compressed(np.array(a))) <= abs(a) + 1e-12


def test_compression_is_none_for_small_values():
    z = np.linspace(-0.3, 0.3, 7)
    np.testing.assert_allclose(compressed(z), z, rtol=2e-3)
    assert compressed(np.array(1000.0)) == pytest.approx(3 * np.arcsinh(1000 / 3))


# --- likelihood ----------------------------------------------------------------------------------


def test_log_likelihood_is_that_of_a_gaussian():
    draw = np.random.default_rng(9)
    k = 6
    sample = 0.2 * draw.normal(size=(300, k))
    scale = Scale(np.zeros(k), np.ones(k), np.array(np.eye(k) * 0.6 + 0.4))
    model = Ensemble(scale, sample)
    inflation = np.sqrt(1 + 1 / 300)
    gaussian = stats.multivariate_normal(
        model.mean, inflation**2 * np.outer(model.sd, model.sd) * scale.correlation
    )
    values = 0.05 * draw.normal(size=(4, k))
    found = np.array([model.log_likelihood(row) for row in values])
    expected = np.array([gaussian.logpdf(scale.of_values(row)) for row in values])
    # constant: the same for every model of as many simulations on the same scale
    np.testing.assert_allclose(found - expected, found[0] - expected[0], atol=1e-9)
    other = Ensemble(scale, 3.0 * sample + 0.1)
    broad = stats.multivariate_normal(
        other.mean, inflation**2 * np.outer(other.sd, other.sd) * scale.correlation
    )
    assert other.log_likelihood(values[0]) - found[0] == pytest.approx(
        broad.logpdf(scale.of_values(values[0])) - expected[0], abs=1e-9
    )


def test_misfit_is_the_mean_square_of_uncorrelated_deviations():
    scale, model = World(10).model(np.random.default_rng(10))
    values = scale.mean + 0.7 * scale.sd
    z = model.z(values)
    expected = z @ np.linalg.solve(scale.correlation, z) / len(z)
    assert model.misfit(values) == pytest.approx(expected)


def test_deviations_are_in_those_of_the_model():
    scale, model = World(11).model(np.random.default_rng(11))
    at_mean = scale.mean + scale.sd * 3 * np.sinh(model.mean / 3)
    np.testing.assert_allclose(model.z(at_mean), 0.0, atol=1e-9)
    one = scale.mean + scale.sd * 3 * np.sinh((model.mean + model.sd) / 3)
    np.testing.assert_allclose(model.z(one), 1 / np.sqrt(1 + 1 / SEEDS))


def test_the_floor_is_of_simulations_left_out():
    draw = np.random.default_rng(12)
    world = World(12)
    scale, model = world.model(draw)
    k = 7
    rest = Ensemble(scale, np.delete(model.sample, k, axis=0))
    values = scale.mean + scale.sd * 3 * np.sinh(model.sample[k] / 3)
    assert model._left_out[0][k] == pytest.approx(rest.misfit(values))
    assert model._left_out[1][k] == pytest.approx(np.abs(rest.z(values)).max())
    fresh = [model.misfit(row) for row in world.sample(200, draw)]
    assert model.floor == pytest.approx(np.mean(fresh), rel=0.1)


def test_sd_is_not_taken_for_less_than_half():
    scale = Scale(np.zeros(2), np.ones(2), np.eye(2))
    model = Ensemble(scale, np.column_stack([np.zeros(10), np.arange(10.0)]))
    assert model.sd[0] == 0.5
    assert model.sd[1] == pytest.approx(np.arange(10.0).std(ddof=1))


# --- tail ----------------------------------------------------------------------------------------


def test_within_the_sample_the_rank_decides():
    sample = np.arange(1.0, 100.0)
    assert _tail(sample, 0.5, None) == 1.0
    assert _tail(sample, 50.0, None) == pytest.approx(51 / 100)
    assert _tail(sample, 99.0, None) == pytest.approx(2 / 100)


def test_beyond_the_sample_the_tail_falls_on():
    sample = np.exp(0.1 * np.random.default_rng(1).normal(size=160))
    values = sample.max() * np.array([1.0, 1.001, 1.1, 1.3, 2.0, 10.0])
    found = [_tail(sample, value, _log_normal) for value in values]
    assert found == sorted(found, reverse=True)
    assert found[1] <= 1 / 161
    assert found[4] < 1e-6
    assert found[5] < 1e-50


def test_the_tail_of_the_largest_is_that_of_the_largest_of_many():
    draw = np.random.default_rng(2)
    sample = np.abs(draw.normal(size=(4000, 300))).max(axis=1)
    for value in (4.0, 4.5, 5.0):
        exact = -np.expm1(300 * np.log1p(-2 * stats.norm.sf(value)))
        assert exact <= _gumbel(sample, value) < 20 * exact
    assert _gumbel(sample, 30.0) < 1e-20
    assert _gumbel(np.full(5, 3.0), 3.1) < 1e-20


def test_one_loud_statistic_of_heavy_tails_is_not_called_impossible():
    draw = np.random.default_rng(6)
    rows = draw.standard_t(6, size=(2000, STATISTICS))
    model = Ensemble.of(Scale.of(rows[:100], np.full(STATISTICS, 1e-3)), rows[100:200])
    found = np.array([model.probability(row) for row in rows[200:]])
    assert np.count_nonzero(found < 1e-3) <= stats.binom.ppf(0.999, 1800, 2e-3)
    assert found.min() > 1e-6


def test_a_model_without_chance_is_not_what_makes_other_recordings():
    sample = np.tile(np.arange(5.0), (SEEDS, 1))
    scale = Scale.of(sample, np.full(5, 0.3))
    model = Ensemble.of(scale, sample)
    assert model.probability(np.arange(5.0)) == 1.0
    assert model.probability(np.arange(5.0) + 3.0) < 1e-6


def test_events_that_hardly_ever_happen_are_counted_and_not_read_off_a_curve():
    """A pair of events that one recording in seventy holds makes none of them stand out."""
    draw = np.random.default_rng(5)
    world = World(5)

    def sample(count, rate=0.015):
        rare = draw.poisson(rate, (count, 1)).astype(float)
        return np.hstack([world.sample(count, draw), rare])

    least = np.append(0.01 * world.unit, 0.1)
    scale = Scale.of(sample(100, 0), least)
    model = Ensemble.of(scale, sample(100, 0))  # by chance, none of these has one
    further = scale.of_values(sample(1000))
    level, rows = 0.005, sample(2000)
    by_curve = np.array([model.probability(row) for row in rows]) < level
    counted = np.array([model.rank(row, further) for row in rows[by_curve]])
    assert by_curve.mean() > 2 * level
    assert np.mean(counted < level) * by_curve.mean() < level


def test_two_events_where_none_is_expected_stand_for_themselves_and_ten_do_not():
    draw = np.random.default_rng(7)
    world = World(7)
    entries = [Entry("", "", "")] * STATISTICS + [Entry("", "", "events", counted)]

    def rows(count, events):
        number = stabilised(np.full((count, 1), float(events)))
        return np.hstack([world.sample(count, draw), number])

    sample = rows(100, 0)
    least = least_deviations(entries, np.append(0.01 * world.unit, 0.6), sample.mean(axis=0))
    model = Ensemble.of(Scale.of(sample, least), rows(100, 0))
    alarms = {
        events: np.mean([model.probability(row) < 0.005 for row in rows(400, events)])
        for events in (0, 1, 2, 10)
    }
    assert alarms[2] < 0.05
    assert alarms[0] == pytest.approx(alarms[1], abs=0.02)
    assert alarms[10] == 1.0


def test_what_no_simulation_makes_stays_beyond_chance_when_counted():
    draw = np.random.default_rng(6)
    world = World(6)
    scale, model = world.model(draw)
    further = scale.of_values(world.sample(1000, draw))
    shifted = world.sample(1, draw, shift=2.0)[0]
    assert model.probability(shifted) < 0.005
    assert model.rank(shifted, further) == pytest.approx(2 / 1001)
