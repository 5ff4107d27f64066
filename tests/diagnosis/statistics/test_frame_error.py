"""What the frames do not tell: how it follows from a change, and what it does to simulations."""

import numpy as np
import pytest

from adv2e.diagnosis.statistics.uncertainty import Change, FrameError

GROUPS = ["a", "a", "a", "b", "b", "b"]
LEAST = np.full(6, 1.0)


def repeated(value, noise=0.0, seed=0):
    """Return simulations, (8, 4, 6), of statistics that are all `value` but for noise."""
    return value + noise * np.random.default_rng(seed).normal(size=(8, 4, 6))


def changed(by):
    """Return simulations of which the first statistic has changed by so many deviations."""
    sample = repeated(10.0)
    sample[:, :, 0] += by
    return sample


def error_of(plain, less, least=LEAST):
    return Change.of(plain, less, GROUPS, least).error(0.25, 0.7)


def test_shares_of_the_change_are_known_and_uncertain():
    error = error_of(repeated(10.0), changed(0.4))
    np.testing.assert_allclose(error.bias[:, 0], 0.1, rtol=0.01)
    np.testing.assert_array_equal(error.bias[:, 1:], 0.0)
    np.testing.assert_allclose(error.sd[:, 0], 0.7 * 0.4, rtol=0.01)
    np.testing.assert_array_equal(error.sd[:, 1:], 0.0)


def test_others_of_its_kind_tell_what_to_expect_of_one_that_changes_by_chance_alone():
    """It feels the frames, as each simulation is another with them; the mean happens to be none."""
    other, quiet = repeated(10.0), repeated(10.0)
    other[:, :, 0] += 3.0
    other[:, :, 1] += np.tile([[-1.5], [1.5]], (4, 1))
    felt = error_of(repeated(10.0), other).sd[0]
    assert felt[1] == pytest.approx(0.5 * felt[0], rel=0.3)
    np.testing.assert_array_equal(felt[2:], 0.0)  # each simulation is what it was
    # the less it is another, the less is expected of it
    quiet[:, :, 0] += 3.0
    quiet[:, :, 1] += np.tile([[-0.75], [0.75]], (4, 1))
    assert 0.3 * felt[1] < error_of(repeated(10.0), quiet).sd[0, 1] < 0.75 * felt[1]


def test_the_error_grows_with_the_unit_of_a_statistic():
    one, ten = (
        error_of(unit * repeated(5.0, 1.0), unit * (2.0 + repeated(5.0, 1.0)), least=0.01 * LEAST)
        for unit in (1.0, 10.0)
    )
    np.testing.assert_allclose(ten.bias, 10.0 * one.bias)
    np.testing.assert_allclose(ten.sd, 10.0 * one.sd)


def test_of_far_more_than_chance_less_is_known():
    """What is that large says that the frames tell little."""
    error = error_of(repeated(0.0), repeated(100.0))
    assert np.all((error.bias > 2.0) & (error.bias < 10.0))
    assert np.all((error.sd > 20.0) & (error.sd < 40.0))


def test_chance_is_no_change():
    found = error_of(repeated(5.0, 1.0, 1), repeated(5.0, 1.0, 2))
    assert np.median(np.abs(found.bias)) == 0.0
    assert np.median(found.sd) < 0.2


def test_what_is_uncertain_spreads_simulations_and_moves_none():
    error = FrameError(np.zeros((4, 6)), np.tile([0.0, 0.0, 1.0, 1.0, 3.0, 3.0], (4, 1)))
    sample = np.random.default_rng(1).normal(size=(400, 6))
    spread = error.blurred(sample, 2, 1)
    np.testing.assert_allclose(spread.mean(axis=0), sample.mean(axis=0), atol=1e-12)
    np.testing.assert_array_equal(spread[:, :2], sample[:, :2])
    np.testing.assert_allclose(spread.std(axis=0)[2:], np.sqrt([2, 2, 10, 10]), rtol=0.2)
    # far more often far off than normal numbers, and some simulations more than others
    apart = (spread - sample)[:, 2:] / error.sd[2, 2:]
    assert np.mean(apart**4) > 6.0
    each = np.log(np.mean(apart**2, axis=1))
    shuffled = np.random.default_rng(2).permuted(apart, axis=0)
    assert each.std() > 1.1 * np.log(np.mean(shuffled**2, axis=1)).std()
    np.testing.assert_array_equal(spread, error.blurred(sample, 2, 1))
    for view, stream in ((1, 1), (2, 2)):
        assert not np.array_equal(spread, error.blurred(sample, view, stream))


def test_two_errors_are_uncertain_as_their_squares():
    one, other = (
        FrameError(np.full((4, 6), bias), np.full((4, 6), sd)) for bias, sd in ((1, 3), (2, 4))
    )
    both = one + other
    np.testing.assert_array_equal(both.bias, 3.0)
    np.testing.assert_allclose(both.sd, 5.0)
    nothing = FrameError.none((4, 6))
    np.testing.assert_array_equal((one + nothing).sd, one.sd)


def test_the_doubt_is_in_deviations_of_chance_alone():
    error = FrameError(np.zeros((4, 6)), np.full((4, 6), 4.0))
    chance = error.chance(np.full(6, 5.0), 2)
    np.testing.assert_allclose(chance, 3.0)
    assert error.doubt(chance, 2) == pytest.approx(4.0 / 3.0)
