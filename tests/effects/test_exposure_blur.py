"""Exposure: frames are means over it, and its blur is undone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from through_hooks import run, still

from adv2e.effects.frames.exposure_blur import ExposureBlurHooks, means


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(0.2, 3.0), min_size=3, max_size=30),
    st.floats(0.05, 20.0),
)
def test_means_keep_what_is_constant_and_widen_as_the_exposure_does(gaps, exposure):
    times = np.cumsum(gaps)
    matrix = means(times, exposure)
    assert matrix.min() >= -1e-12
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    apart = times[None, :] - times[:, None]
    width = np.minimum(exposure, 2 * np.minimum(times - times[0], times[-1] - times))
    variance = (matrix * apart**2).sum(axis=1)
    cells = np.max(gaps) ** 2  # what a mixture of the two can miss
    assert np.all(np.abs(variance - width**2 / 12) <= cells)


def test_means_have_the_variance_of_the_exposure_on_even_times():
    times = np.arange(60.0)
    # at even multiples of the step the mixture comes near it only
    for exposure, near in ((0.5, 1e-9), (1.0, 1e-9), (3.0, 1e-9), (8.0, 0.04)):
        matrix = means(times, exposure)[20:40]
        apart = times[None, :] - times[20:40, None]
        np.testing.assert_allclose((matrix * apart**2).sum(axis=1), exposure**2 / 12, rtol=near)
        np.testing.assert_allclose((matrix * apart).sum(axis=1), 0.0, atol=1e-9)


def exposed(light, exposure, count=120):
    """Return frames 2 ms apart, light at their times, and its means over an exposure [us]."""
    t = np.arange(count) * 2000.0
    inside = exposure * ((np.arange(400) + 0.5) / 400 - 0.5)
    blurred = light(t[:, None] + inside).mean(axis=1)
    frames = [(int(a * 1000), np.full((1, 2), v)) for a, v in zip(t, blurred, strict=True)]
    return frames, light(t), blurred


def swinging(period):
    """Return light that swings by an e-fold."""
    return lambda at: 60.0 * np.exp(0.5 * np.sin(2 * np.pi * at / period))


def bars(at):
    """Return light that rises by a factor of 3.3, and falls again, within 4 ms."""
    place = (at / 2000.0) % 40.0
    up, down = (1.0 / (1.0 + np.exp(-2.0 * (place - edge))) for edge in (10.0, 25.0))
    return 20.0 * np.exp(1.2 * (up - down))


def distances_in_log(light, exposure):
    """Return how far frames are from the light, before and after, and both lights in log."""
    frames, sharp, blurred = exposed(light, exposure)
    times, found = run(ExposureBlurHooks(exposure), frames)
    assert times == [t for t, _ in frames]
    assert np.array_equal(found[:, 0, 0], found[:, 0, 1])
    inside = slice(20, -20)
    sharp, blurred, made = (np.log(one)[inside] for one in (sharp, blurred, found[:, 0, 0]))
    return (blurred - sharp).std(), (made - sharp).std(), sharp, made


@pytest.mark.parametrize(
    ("period", "exposure", "most"), [(20e3, 5e3, 0.8), (40e3, 15e3, 0.4), (60e3, 30e3, 0.3)]
)
@pytest.mark.quick_cases(1)
def test_what_an_exposure_takes_away_comes_back(period, exposure, most):
    lost, left, *_ = distances_in_log(swinging(period), exposure)
    assert lost > 0.03
    assert left < most * lost


@pytest.mark.parametrize(("exposure", "most"), [(5e3, 0.4), (15e3, 0.25), (30e3, 0.3)])
def test_edges_that_passed_come_back_as_steps_without_ringing(exposure, most):
    lost, left, sharp, made = distances_in_log(bars, exposure)
    assert left < most * lost
    ways = [np.abs(np.diff(light)).sum() for light in (sharp, made)]
    assert ways[1] == pytest.approx(ways[0], rel=0.13)


def test_what_does_not_change_stays():
    found = run(ExposureBlurHooks(9000.0), still(*[7.0] * 30))[1]
    np.testing.assert_allclose(found, 7.0, rtol=1e-5)


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_exposure_keeps_every_frame_of_short_sequences(count):
    frames = exposed(swinging(20e3), 5e3, count)[0]
    assert run(ExposureBlurHooks(5000.0), frames)[0] == [t for t, _ in frames]


def test_exposure_holds_few_frames():
    taken = 0

    def source():
        nonlocal taken
        for k in range(300):
            taken += 1
            yield k * 2_000_000, np.full((1, 1), 50.0)

    for number, _ in enumerate(ExposureBlurHooks(10_000.0).light(source())):
        assert taken - number < 60
