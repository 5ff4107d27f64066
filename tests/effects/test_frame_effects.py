"""Equations of the effects on frames, on examples done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import shift as spline_shift

from adv2e.effects.frames.black_level import BlackLevelHooks
from adv2e.effects.frames.clock_drift import ClockDriftHooks
from adv2e.effects.frames.clock_offset import ClockOffsetHooks
from adv2e.effects.frames.exposure_blur import ExposureBlurHooks, means
from adv2e.effects.frames.flicker import Flicker, FlickerHooks
from adv2e.effects.frames.misregistration import MisregistrationHooks
from adv2e.effects.pixel.dark_current import DarkCurrent, DarkCurrentHooks


def run(hook, frames):
    """Return times [ns] and light that come out of `hook`."""
    found = list(hook.light(iter(frames)))
    return [t for t, _ in found], np.stack([light for _, light in found])


def still(*values, dtype=np.float32):
    return [(1000 * k, np.full((2, 3), v, dtype)) for k, v in enumerate(values)]


def test_black_level_is_added_and_light_stays_at_or_above_zero():
    assert run(BlackLevelHooks(2.5), still(0, 10))[1][:, 0, 0].tolist() == [2.5, 12.5]
    assert run(BlackLevelHooks(-4.0), still(3, 10))[1][:, 0, 0].tolist() == [0.0, 6.0]


def test_light_falls_on_where_frames_are_clipped():
    light = np.full((9, 12), 20.0, np.float32)
    light[2:7, 3:10] = 0.0
    below = 9.0 - run(BlackLevelHooks(9.0, 6.0), [(0, light)])[1][0]
    clipped = light == 0.0
    assert np.all(below[~clipped] == -20.0)
    # one, two and three pixels from what is not clipped
    expected = 6.0 * (1.0 - np.exp(-np.array([1.0, 2.0, 3.0]) / 1.5))
    np.testing.assert_allclose(below[4, 3:6], expected, rtol=1e-5)
    np.testing.assert_allclose(below[2, 3:10], expected[0], rtol=1e-5)
    everywhere = run(BlackLevelHooks(9.0, 6.0), [(0, np.zeros_like(light))])[1][0]
    np.testing.assert_allclose(everywhere, 3.0)
    assert run(BlackLevelHooks(2.0, 6.0), [(0, light)])[1].min() == 0.0


def test_dark_current_is_added():
    found = run(DarkCurrentHooks(DarkCurrent(dn=1.5)), still(0, 10, dtype=np.float64))[1]
    assert found[:, 1, 1].tolist() == [1.5, 11.5]
    assert found.dtype == np.float64


def test_clock_offset_moves_and_drift_stretches_from_the_first_frame():
    frames = [(5_000_000_000 + 1_000_000_000 * k, np.zeros((1, 1))) for k in range(3)]
    later = run(ClockOffsetHooks(-250.5), frames)[0]
    assert later == [t - 250_500 for t, _ in frames]
    slow = run(ClockDriftHooks(100.0), frames)[0]
    assert [t - 5_000_000_000 for t in slow] == [0, 1_000_100_000, 2_000_200_000]


def test_shift_by_whole_pixels_takes_from_the_right_and_below():
    light = np.arange(12, dtype=np.float32).reshape(3, 4) + 1
    found = run(MisregistrationHooks((1.0, 0.0)), [(0, light)])[1][0]
    assert found.tolist() == light[:, [1, 2, 3, 3]].tolist()
    found = run(MisregistrationHooks((0.0, -1.0)), [(0, light)])[1][0]
    assert found.tolist() == light[[0, 0, 1]].tolist()


@pytest.mark.parametrize("shift", [(0.4, -0.7), (-2.5, 0.0), (0.0, 3.1)])
def test_shift_by_parts_of_a_pixel_is_exact_for_smooth_contrast(shift):
    x, y = np.meshgrid(np.arange(40.0), np.arange(36.0))

    def light(x, y):
        return 20.0 * np.exp(0.04 * x + 0.5 * np.sin(0.5 * x + 0.3 * y))

    right, below = shift
    found = run(MisregistrationHooks(shift), [(0, light(x - right, y - below))])[1][0]
    inside = (slice(12, -12), slice(12, -12))
    np.testing.assert_allclose(found[inside], light(x, y)[inside], rtol=4e-4)
    assert np.all(found > 0)


def test_shift_is_that_of_quintic_splines():
    x, y = np.meshgrid(np.arange(50.0), np.arange(46.0))
    contrast = 0.6 * np.sin(0.9 * x + 0.2 * y)
    by = spline_shift(contrast, (-0.3, -0.45), order=5, mode="nearest")
    found = run(MisregistrationHooks((0.45, 0.3)), [(0, np.exp(3.0 + contrast))])[1][0]
    np.testing.assert_allclose(np.log(found[18:-18, 18:-18]) - 3.0, by[18:-18, 18:-18], atol=1e-5)


@pytest.mark.parametrize("part", [0.2, 0.5, 0.85])
def test_shifted_edges_do_not_ring(part):
    x = np.arange(30.0)
    edge = 5.0 + 195.0 * (0.5 + 0.5 * np.tanh(1.5 * (x - 15.3)))
    rows = np.tile(edge, (6, 1))
    for light, way in ((rows, (part, 0.0)), (rows[:, ::-1], (part, 0.0)), (rows.T, (0.0, part))):
        found = np.log(run(MisregistrationHooks(way), [(0, light)])[1][0])
        assert found.max() <= np.log(light.max()) + 0.02
        assert found.min() >= np.log(light.min()) - 0.02


def test_shift_keeps_black_beside_white_above_zero():
    light = np.zeros((5, 9), np.float32)
    light[:, 5:] = 255.0
    found = run(MisregistrationHooks((0.5, 0.5)), [(0, light)])[1][0]
    assert found.min() > 0
    assert found.dtype == np.float32


def test_flicker_is_a_sine_on_the_light_at_the_phase_given():
    hook = FlickerHooks(Flicker(frequency_hz=100.0, depth=0.4, phase_rad=math.pi / 6))
    times = np.array([0.0, 0.0025, 0.005, 1e6 + 0.0075])
    expected = [1 + 0.4 * math.sin(math.pi / 6 + a * math.pi / 2) for a in range(4)]
    np.testing.assert_allclose(hook.gain(times), expected, atol=1e-6)
    assert hook.step_us == 100.0


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
