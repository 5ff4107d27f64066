"""Each effect of the camera's pixel does what its equation says."""

import numpy as np
import pytest
from scipy.optimize import brentq

from camera.drive import log_response
from camera.helpers import QUIET, SHARP, intervals, of_pixel, ramp, seen, step, still
from camera.photoreceptor import Photoreceptor, frame_coupling, gain_of
from camera.scene import Flat, Still
from camera.scenes import patchwork
from camera.settings import merged

pytestmark = pytest.mark.thorough

GRID = (30, 20)


def pixel(**sections):
    return {"pixel": sections}


def test_events_of_a_ramp_come_whenever_it_has_risen_by_the_threshold():
    time, polarity = of_pixel(seen(ramp(10.0, 12.0), SHARP, hidden=pixel(thresholds={"on": 0.25})))
    np.testing.assert_allclose(time, 0.25 / 12.0 * np.arange(1, len(time) + 1), atol=1e-9)
    assert len(time) == 9
    assert np.all(polarity == 1)


def test_off_events_follow_their_own_threshold():
    given = pixel(thresholds={"on": 0.25, "off": 0.4})
    time, polarity = of_pixel(seen(ramp(200.0, -12.0), SHARP, hidden=given))
    np.testing.assert_allclose(time, 0.4 / 12.0 * np.arange(1, len(time) + 1), atol=1e-9)
    assert len(time) == 5
    assert np.all(polarity == -1)


def test_mismatch_spreads_the_thresholds_of_both_polarities_independently():
    given = pixel(thresholds={"mismatch": 0.03})
    first = {}
    for slope, start in ((8.0, 5.0), (-8.0, 200.0)):
        stream = seen(ramp(start, slope), SHARP, hidden=given, size=GRID, duration_s=0.05)
        _, at = np.unique(stream.pixel, return_index=True)
        first[slope] = stream.time[at] * abs(slope)
        assert first[slope].mean() == pytest.approx(0.2, abs=0.005)
        assert first[slope].std() == pytest.approx(0.03, rel=0.12)
    assert abs(np.corrcoef(first[8.0], first[-8.0])[0, 1]) < 0.15


def test_thresholds_stay_above_their_least_value():
    given = pixel(thresholds={"on": 0.02, "mismatch": 0.5})
    stream = seen(ramp(10.0, 1.0), SHARP, hidden=given, size=GRID, duration_s=0.03)
    assert intervals(stream).min() == pytest.approx(0.01, rel=1e-6)


def test_drift_stretches_the_thresholds_in_time():
    given = pixel(thresholds={"drift_per_s": 2.0})
    time, _ = of_pixel(seen(ramp(10.0, 10.0), SHARP, hidden=given))
    due = [0.0]
    while (at := (due[-1] + 0.02) / (1 - 2.0 * 0.02)) < 0.2:  # 10 (t - due) = 0.2 (1 + 2 t)
        due.append(at)
    np.testing.assert_allclose(time, due[1:], atol=3e-5)


@pytest.mark.parametrize(("low", "high"), [(20.0, 200.0), (200.0, 12.0), (3.0, 6.0)])
def test_low_pass_reaches_63_per_cent_after_one_time_constant(low, high):
    level = (1 - np.exp(-1.0)) * abs(np.log(high / low))
    given = pixel(thresholds={"on": level, "off": level})
    time, polarity = of_pixel(seen(step(low, high, 0.01), QUIET, hidden=given))
    corner = 20.0 + 280.0 * high / 255.0
    assert time[0] - 0.01 == pytest.approx(1 / (2 * np.pi * corner), rel=2e-3)
    assert polarity[0] == np.sign(high - low)


def test_dark_current_raises_level_and_corner_of_the_pixel():
    level = (1 - np.exp(-1.0)) * np.log(40 / 20)
    given = pixel(dark_current={"dn": 10.0}, thresholds={"on": level})
    time, _ = of_pixel(seen(step(10.0, 30.0, 0.01), QUIET, hidden=given))
    assert time[0] - 0.01 == pytest.approx(1 / (2 * np.pi * (20 + 280 * 40 / 255)), rel=2e-3)


def test_source_follower_is_a_second_pole():
    w, v = 2 * np.pi * (20 + 280 * 200 / 255), 2 * np.pi * 90.0
    given = pixel(source_follower={"cutoff_hz": 90.0}, thresholds={"on": 0.5})
    time, _ = of_pixel(seen(step(20.0, 200.0, 0.01), QUIET, hidden=given))

    def response(t):
        return np.log(10) * (1 - (v * np.exp(-w * t) - w * np.exp(-v * t)) / (v - w)) - 0.5

    assert time[0] - 0.01 == pytest.approx(brentq(response, 0.0, 0.05), rel=2e-3)


def test_slew_limit_makes_a_step_a_ramp():
    given = pixel(slew_limit={"per_s": 40.0}, low_pass={"cutoff_hz": 3000.0})
    time, _ = of_pixel(seen(step(2.0, 200.0, 0.01), QUIET, hidden=given))
    np.testing.assert_allclose(np.diff(time[:20]), 0.2 / 40.0, rtol=1e-6)


def test_refractory_period_parts_events_and_then_takes_the_signal():
    given = pixel(refractory={"period_us": 3330.0})
    stream = seen(ramp(5.0, 20.0), SHARP, hidden=given)
    np.testing.assert_allclose(intervals(stream), 0.00333 + 0.2 / 20.0, rtol=1e-6)


def test_dead_time_shorter_than_a_step():
    given = pixel(refractory={"period_us": 7.0}, thresholds={"on": 0.01})
    stream = seen(ramp(5.0, 900.0), SHARP, hidden=given, duration_s=0.004)
    np.testing.assert_allclose(intervals(stream), 7e-6 + 0.01 / 900.0, rtol=1e-6)


@pytest.mark.parametrize("dead_us", [None, 2000.0])
def test_reset_overshoot_carries_the_reference_on(dead_us):
    dead = None if dead_us is None else {"period_us": dead_us}
    given = pixel(reset_overshoot={"fraction": 0.3}, refractory=dead)
    stream = seen(ramp(5.0, 20.0), SHARP, hidden=given)
    due = (dead_us or 0.0) * 1e-6 + 1.3 * 0.2 / 20.0
    np.testing.assert_allclose(intervals(stream), due, rtol=1e-6)


def test_leak_fires_on_at_its_rate():
    stream = seen(still(80.0), QUIET, hidden=pixel(leak={"rate_hz": 37.0}), size=(2, 1))
    assert np.all(stream.polarity == 1)
    for i in range(2):
        np.testing.assert_allclose(of_pixel(stream, i)[0], np.arange(1, 8) / 37.0, atol=1e-9)


@pytest.mark.parametrize("noise_hz", [0.0, 10.0])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_leak_has_gone_on_before_the_recording(noise_hz, jitter):
    given = pixel(
        leak={"rate_hz": 20.0, "jitter": jitter},
        shot_noise={"rate_hz": noise_hz},
        refractory={"period_us": 500.0},
        initial_reference="running",
    )
    stream = seen(still(0.0), QUIET, hidden=given, size=(60, 50), duration_s=0.12)
    counts = np.histogram(stream.time[stream.polarity == 1], 8, (0.0, 0.12))[0]
    cycle = 0.0005 + (-np.expm1(-noise_hz / 20.0) / noise_hz if noise_hz else 1 / 20.0)
    due = 3000 * 0.015 * (1 / cycle - 0.5 * noise_hz / (1 + noise_hz * 0.0005))
    assert np.all(np.abs(counts - due) < 4 * np.sqrt(due) + 0.03 * due)


def test_leak_through_the_switch_waits_for_the_dead_time():
    given = pixel(leak={"rate_hz": 50.0}, refractory={"period_us": 4321.0})
    apart = intervals(seen(still(80.0), QUIET, hidden=given))
    np.testing.assert_allclose(apart, 1 / 50.0 + 0.004321, rtol=1e-6)


def test_leak_by_light_is_linear_in_it():
    scene = Still(lambda x, y: 51.0 * (x + 1))
    given = pixel(leak={"rate_hz": 0.0, "photo_rate_hz": 100.0})
    stream = seen(scene, QUIET, hidden=given, size=(5, 1), duration_s=0.505)
    assert np.bincount(stream.pixel).tolist() == [10, 20, 30, 40, 50]


def test_jitter_of_the_leak_spreads_its_periods_about_the_same_mean():
    given = pixel(leak={"rate_hz": 100.0, "jitter": 0.1})
    apart = intervals(seen(still(80.0), QUIET, hidden=given, size=GRID))
    assert apart.mean() == pytest.approx(0.01, rel=0.01)
    assert apart.std() == pytest.approx(0.001, rel=0.05)


@pytest.mark.parametrize("dn", [0.0, 100.0, 255.0])
def test_shot_noise_is_poisson_and_falls_with_light(dn):
    given = pixel(shot_noise={"rate_hz": 100.0}, log_response={"linear_below": 0})
    stream = seen(still(dn), QUIET, hidden=given, size=GRID)
    due = 100.0 * (1 - 0.75 * dn / 255.0) * 0.2 * 600
    assert len(stream.time) == pytest.approx(due, abs=4.5 * np.sqrt(due))
    assert np.mean(stream.polarity == 1) == pytest.approx(0.5, abs=2.25 / np.sqrt(due))
    apart = intervals(stream)
    assert apart.std() == pytest.approx(apart.mean(), rel=0.15)


def test_noise_in_the_dead_time_is_lost():
    given = pixel(shot_noise={"rate_hz": 400.0}, refractory={"period_us": 5000.0})
    stream = seen(still(1e-9), QUIET, hidden=given, size=GRID)
    assert intervals(stream).min() >= 0.005
    due = 400.0 / (1 + 400.0 * 0.005) * 0.2 * 600
    assert len(stream.time) == pytest.approx(due, rel=0.06)


def test_noise_events_reset_the_reference_to_the_signal():
    given = pixel(shot_noise={"rate_hz": 50.0})
    stream = seen(ramp(1.0, 20.0), SHARP, hidden=given, size=GRID)
    by_pixel = [of_pixel(stream, i) for i in range(600)]
    regular = 0.2 / 20.0
    after_noise = [
        time[n + 1] - time[n]
        for time, polarity in by_pixel
        for n in range(len(time) - 1)
        if polarity[n] == -1 and polarity[n + 1] == 1
    ]
    assert np.max(after_noise) <= regular * (1 + 1e-9)
    assert np.mean(np.isclose(after_noise, regular, rtol=1e-6)) > 0.5


def test_hot_pixels_fire_on_at_their_rate():
    given = pixel(hot_pixels={"fraction": 0.1, "rate_hz": 150.0})
    stream = seen(still(80.0), QUIET, hidden=given, size=GRID)
    hot = len(np.unique(stream.pixel))
    assert hot == pytest.approx(60, abs=30)
    assert len(stream.time) == pytest.approx(150 * 0.2 * hot, rel=0.12)
    assert np.all(stream.polarity == 1)


def test_two_noise_events_of_one_step_both_happen():
    given = pixel(hot_pixels={"fraction": 1.0, "rate_hz": 4000.0})
    stream = seen(still(80.0), QUIET, hidden=given, size=(20, 1), duration_s=0.02, step_us=50.0)
    assert len(stream.time) == pytest.approx(20 * 80, abs=160)


def test_dead_pixels_do_nothing():
    given = pixel(dead_pixels={"fraction": 0.3}, hot_pixels={"fraction": 1.0, "rate_hz": 100.0})
    stream = seen(ramp(5.0, 10.0), QUIET, hidden=given, size=GRID)
    assert len(np.unique(stream.pixel)) == pytest.approx(420, abs=50)


def test_photoreceptor_noise_has_its_deviation_and_the_time_of_the_pole():
    w, h = 2 * np.pi * 200.0, 25e-6
    given = merged(QUIET, pixel(photoreceptor_noise={"rms": 0.05}))
    x = np.zeros(2000)
    poles = Photoreceptor(given, x, h, np.random.default_rng(1))
    gain = np.full(2000, gain_of(w, h))
    first = poles.signal.copy()
    for _ in range(32):
        poles.advance(x, gain)
    assert first.std() == pytest.approx(0.05, rel=0.06)
    assert poles.signal.std() == pytest.approx(0.05, rel=0.06)
    assert np.corrcoef(first, poles.signal)[0, 1] == pytest.approx(np.exp(-32 * w * h), abs=0.07)


def test_photoreceptor_noise_events_alternate():
    given = pixel(photoreceptor_noise={"rms": 0.06})
    stream = seen(still(120.0), QUIET, hidden=given, size=GRID)
    pairs = [np.diff(of_pixel(stream, i)[1]) != 0 for i in range(600)]
    assert len(stream.time) > 1000
    assert np.mean(np.concatenate(pairs)) > 0.8


def test_flicker_is_a_line_in_the_events_and_not_in_averaged_frames():
    given = {"frames": {"flicker": {"frequency_hz": 100.0, "depth": 0.35}}}
    stream = seen(still(120.0), QUIET, hidden=given, size=(6, 4))
    phase = np.exp(2j * np.pi * 100.0 * stream.time)
    assert len(stream.time) > 24 * 0.2 * 100 * 2
    for polarity in (1, -1):
        line = phase[stream.polarity == polarity]
        assert abs(line.mean()) > 0.8
        others = [stream.time[stream.polarity == polarity] * f for f in (37.0, 73.0, 130.0)]
        assert all(abs(np.exp(2j * np.pi * other).mean()) < 0.2 for other in others)


def test_frame_coupling_fires_after_frames_only():
    given = merged(
        {"readout": {"frame_coupling": {"amplitude": 0.29, "tau_us": 500.0}}},
        pixel(thresholds={"on": 0.1, "off": 0.08}),
    )
    stream = seen(still(120.0), QUIET, hidden=given, size=(3, 2), fps=100.0)
    since = np.mod(stream.time, 0.01)
    assert len(stream.time) >= 6 * 20 * 2
    assert np.all(since[stream.polarity == 1] < 60e-6)
    assert since.max() < 5 * 500e-6
    first = of_pixel(stream)[0][of_pixel(stream)[1] == -1][0]
    assert first == pytest.approx(500e-6 * np.log(0.29 / 0.12), abs=1e-6)


def test_disturbance_by_frames_decays_and_adds_up():
    times = np.array([0.0, 0.001, 0.002, 0.003, 0.004])
    found = frame_coupling(0.2, 0.001, np.array([0.0, 0.0021]), times)
    # the leap of the second is in the step before 3 ms
    expected = [0, 1, np.exp(-2), np.exp(-3) + 1, np.exp(-4) + np.exp(-1.9)]
    np.testing.assert_allclose(found, 0.2 * np.array(expected))
    before = frame_coupling(0.2, 0.001, np.array([-0.003]), times)
    np.testing.assert_allclose(before[:2], 0.2 * np.exp([-3.0, -4.0]))


def test_log_response_with_and_without_knee():
    light = np.array([0.0, 0.05, 5.0, 20.0, 100.0])
    np.testing.assert_allclose(
        log_response(light, 20.0, 0.1),
        [0, np.log(20) / 400, np.log(20) / 4, np.log(20), np.log(100)],
    )
    np.testing.assert_allclose(log_response(light, 0, 0.1), np.log([0.1, 0.1, 5, 20, 100]))


def test_random_references_lie_uniformly_between_the_thresholds():
    given = pixel(initial_reference="random", thresholds={"on": 0.1, "off": 0.3})
    stream = seen(ramp(10.0, 10.0), SHARP, hidden=given, size=GRID, duration_s=0.05)
    _, at = np.unique(stream.pixel, return_index=True)
    risen = stream.time[at] * 10.0
    assert risen.max() <= 0.4
    assert risen.mean() == pytest.approx(0.2, abs=0.02)
    assert risen.std() == pytest.approx(0.4 / np.sqrt(12), rel=0.1)


def test_event_times_refine_with_the_step():
    scene = patchwork((12, 9), seed=4, speed=2.0)
    given = pixel(source_follower={"cutoff_hz": 200.0}, refractory={"period_us": 500.0})

    def times(step_us):
        stream = seen(scene, QUIET, hidden=given, size=(12, 9), duration_s=0.1, step_us=step_us)
        return [of_pixel(stream, i) for i in range(108)]

    best = times(6.25)
    errors = []
    for step_us in (200.0, 100.0, 50.0):
        apart = [
            np.abs(a[0] - b[0])
            for a, b in zip(times(step_us), best, strict=True)
            if np.array_equal(a[1], b[1])
        ]
        assert len(apart) > 100
        errors.append(np.concatenate(apart).mean())
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]
    assert errors[2] < 10e-6


def test_the_same_seed_gives_the_same_events_and_another_one_others():
    scene = patchwork((12, 9), seed=4)
    noisy = pixel(
        shot_noise={"rate_hz": 20.0},
        photoreceptor_noise={"rms": 0.04},
        thresholds={"mismatch": 0.03},
    )
    a, b, c = (
        seen(scene, QUIET, hidden=noisy, size=(12, 9), duration_s=0.05, seed=seed)
        for seed in (7, 7, 8)
    )
    assert all(np.array_equal(p, q) for p, q in zip(a, b, strict=True))
    assert not np.array_equal(a.time, c.time)


def test_switching_one_noise_on_leaves_the_draws_of_the_others():
    shot = pixel(shot_noise={"rate_hz": 20.0})
    hot = merged(shot, pixel(hot_pixels={"fraction": 0.05, "rate_hz": 50.0}))
    a = seen(still(80.0), QUIET, hidden=shot, size=GRID)
    b = seen(still(80.0), QUIET, hidden=hot, size=GRID)
    both = np.isin(a.time, b.time)
    assert both.all()
    assert len(b.time) > len(a.time)


def test_low_pass_follows_a_light_that_swings():
    scene = Flat(lambda t: 60.0 * np.exp(0.5 * np.sin(2 * np.pi * 300.0 * t)))
    slow = seen(scene, merged(QUIET, pixel(low_pass={"cutoff_hz": 30.0})))
    quick = seen(scene, merged(QUIET, pixel(low_pass={"cutoff_hz": 3000.0})))
    assert len(slow.time) <= 2
    assert len(quick.time) > 100
