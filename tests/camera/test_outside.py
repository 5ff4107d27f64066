"""The effects that no library has do what they say, too."""

import numpy as np
import pytest

from camera.helpers import QUIET, SHARP, intervals, of_pixel, ramp, seen, step
from camera.readout import Stream, echo, sign_flips
from camera.scene import Still
from camera.settings import merged

pytestmark = pytest.mark.thorough


def outside(**sections):
    return {"outside": sections}


def test_a_full_surround_takes_uniform_changes_away():
    given = outside(surround={"share": 1.0, "sigma_px": 1.5})
    assert len(seen(ramp(10.0, 20.0), SHARP, hidden=given, size=(9, 7)).time) == 0
    half = outside(surround={"share": 0.5, "sigma_px": 1.5})
    found = seen(ramp(10.0, 20.0), SHARP, hidden=half, size=(9, 7))
    np.testing.assert_allclose(intervals(found), 0.2 / 10.0, rtol=1e-6)


def test_adaptation_brings_the_signal_back():
    given = outside(adaptation={"share": 1.0, "corner_hz": 10.0})
    time, polarity = of_pixel(seen(step(20.0, 60.0, 0.01), SHARP, hidden=given))
    assert polarity.tolist() == [1] * 5 + [-1] * (len(polarity) - 5)
    decay = np.log(3.0) * np.exp(-2 * np.pi * 10.0 * (time[5:] - 0.01))
    left = 5 * 0.2 - 0.2 * np.arange(1, len(decay) + 1)
    np.testing.assert_allclose(decay, left, atol=3e-3)


def test_image_lag_delivers_its_share_late():
    given = outside(image_lag={"share": 0.4, "tau_us": 8000.0})
    low, high = 20.0, 120.0
    time, _ = of_pixel(seen(step(low, high, 0.01), SHARP, hidden=given))
    now = low + 0.6 * (high - low)
    at_once = int(np.log(now / low) / 0.2)
    late = time[at_once:] - 0.01
    level = low * np.exp(0.2 * np.arange(at_once + 1, len(time) + 1))
    np.testing.assert_allclose(high - 40.0 * np.exp(-late / 0.008), level, rtol=2e-3)


def test_gain_of_columns_is_that_of_whole_columns():
    given = outside(column_gain={"rms": 0.2})
    stream = seen(ramp(10.0, 12.0), SHARP, hidden=given, size=(8, 5))
    gains = [0.2 / 12.0 / np.diff(of_pixel(stream, i)[0]).mean() for i in range(40)]
    table = np.reshape(gains, (5, 8))
    np.testing.assert_allclose(table, np.broadcast_to(table[0], (5, 8)), rtol=1e-9)
    assert 0.05 < table[0].std() < 0.4


def test_corner_ramp_slows_later_steps():
    given = outside(corner_ramp={"per_s": -4.0})
    level = (1 - np.exp(-1.0)) * np.log(2.0)
    late = []
    for at in (0.01, 0.1):
        base = merged(QUIET, {"pixel": {"thresholds": {"on": level}}})
        time, _ = of_pixel(seen(step(60.0, 120.0, at), base, hidden=given))
        late.append(time[0] - at)
    assert late[1] / late[0] == pytest.approx(np.exp(4.0 * 0.09), rel=0.02)


def test_threshold_vignette_rises_to_the_corners():
    given = outside(threshold_vignette={"rise": 0.5})
    stream = seen(ramp(10.0, 12.0), SHARP, hidden=given, size=(5, 3))
    due = {0: 0.3, 7: 0.2, 4: 0.3, 5: 0.25}
    for pixel, level in due.items():
        np.testing.assert_allclose(np.diff(of_pixel(stream, pixel)[0]), level / 12.0, rtol=1e-6)


def test_threshold_wobble_is_a_line_in_the_intervals():
    given = outside(threshold_wobble={"depth": 0.2, "frequency_hz": 37.0})
    time, _ = of_pixel(seen(ramp(1.0, 100.0), SHARP, hidden=given))
    found = np.diff(time) * 100.0 / 0.2 - 1.0
    np.testing.assert_allclose(found, 0.2 * np.sin(2 * np.pi * 37.0 * time[1:]), atol=0.02)


def test_dead_time_after_off_events_is_its_own():
    given = merged(
        outside(off_dead_time={"factor": 5.0}), {"pixel": {"refractory": {"period_us": 400.0}}}
    )
    up = intervals(seen(ramp(5.0, 20.0), SHARP, hidden=given))
    down = intervals(seen(ramp(250.0, -20.0), SHARP, hidden=given))
    np.testing.assert_allclose(up, 0.0004 + 0.01, rtol=1e-6)
    np.testing.assert_allclose(down, 0.0020 + 0.01, rtol=1e-6)


def test_echo_repeats_events_later():
    rng = np.random.default_rng(1)
    once = Stream(np.arange(1000) * 1e-3, np.arange(1000) % 7, np.where(np.arange(1000) % 2, 1, -1))
    both = echo(once, 0.3, 0.0075, rng)
    again = ~np.isin(both.time, once.time)
    assert again.sum() == pytest.approx(300, abs=60)
    index = np.rint((both.time[again] - 0.0075) * 1e3).astype(int)
    assert np.array_equal(both.pixel[again], once.pixel[index])
    assert np.array_equal(both.polarity[again], once.polarity[index])
    assert np.all(np.diff(both.time) >= 0)


def test_sign_flips_turn_their_share():
    stream = Stream(np.arange(4000.0), np.zeros(4000, int), np.ones(4000, int))
    turned = sign_flips(stream, 0.1, np.random.default_rng(1))
    assert np.mean(turned.polarity == -1) == pytest.approx(0.1, abs=0.02)
    assert np.array_equal(turned.time, stream.time)


def test_a_still_scene_stays_still_under_effects_of_the_drive():
    given = outside(
        surround={"share": 0.5, "sigma_px": 1.0},
        adaptation={"share": 0.5, "corner_hz": 2.0},
        image_lag={"share": 0.3, "tau_us": 5000.0},
        column_gain={"rms": 0.2},
    )
    scene = Still(lambda x, y: 10.0 + 9.0 * x + y)
    stream = seen(scene, QUIET, hidden=given, size=(9, 7), duration_s=0.1)
    assert len(stream.time) == 0
