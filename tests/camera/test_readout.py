"""Arbiter, losses and stamps."""

import numpy as np
import pytest

from camera.helpers import SHARP, ramp, seen, still
from camera.readout import Stream, arbiter, double_read, loss, tick

pytestmark = pytest.mark.thorough

US = 1e-6


def stream_of(*events, width=10):
    """Events given as (time [us], column, row)."""
    time, column, row = np.array(events, float).T
    pixel = (row * width + column).astype(int)
    return Stream(time * US, pixel, np.ones(len(time), int))


def test_arbiter_takes_the_row_that_has_waited_longest_and_its_pixels_together():
    events = stream_of((0, 5, 2), (1, 3, 7), (2, 1, 2), (3, 8, 1), (4, 0, 7))
    out = arbiter(events, 10, 1 * US, 10 * US)
    # row 2 is latched at 10 with both its pixels; row 7 at 22 with both of its; then row 1
    assert out.pixel.tolist() == [21, 25, 70, 73, 18]
    np.testing.assert_allclose(out.time / US, [11, 12, 23, 24, 35])


def test_arbiter_at_rest_only_delays():
    events = stream_of((0, 5, 2), (100, 3, 7), (200, 1, 2))
    out = arbiter(events, 10, 1 * US, 10 * US)
    assert np.array_equal(out.pixel, events.pixel)
    np.testing.assert_allclose(out.time - events.time, 11 * US)


def test_a_pixel_that_waits_cannot_ask_again():
    events = stream_of((0, 5, 2), (5, 5, 2), (10.5, 5, 2), (11.5, 5, 2))
    out = arbiter(events, 10, 1 * US, 10 * US)
    np.testing.assert_allclose(out.time / US, [11, 22.5])


def test_arbiter_saturates_at_what_the_channel_can_carry():
    given = {"readout": {"arbiter": {"event_ns": 2000.0, "row_ns": 5000.0}}}
    scene, size = ramp(1.0, 200.0), (30, 20)  # 1000 events a second from 600 pixels, in bursts
    free = seen(scene, SHARP, size=size, duration_s=0.02)
    held = seen(scene, SHARP, size=size, duration_s=0.02, hidden=given)
    assert len(free.time) == 600 * 19 or len(free.time) == 600 * 20
    assert np.diff(held.time).min() >= 2000e-9 * (1 - 1e-6)
    assert len(held.time) < 0.85 * len(free.time)
    carried = 30 / (30 * 2000e-9 + 5000e-9)
    assert len(held.time) / np.ptp(held.time) == pytest.approx(carried, rel=0.02)


def test_loss_takes_its_share_at_random():
    whole = Stream(np.arange(5000.0), np.arange(5000), np.ones(5000, int))
    kept = loss(whole, 0.25, np.random.default_rng(3))
    assert len(kept.time) == pytest.approx(3750, abs=130)
    assert np.array_equal(kept.time, kept.pixel)


def test_each_polarity_has_its_share_of_events_that_are_read_twice():
    polarity = np.tile([1, -1], 20_000)
    whole = Stream(np.arange(40_000.0), np.arange(40_000), polarity)
    found = double_read(whole, (0.1, 0.3), True, np.random.default_rng(3))
    order = np.lexsort([found.time, found.pixel])
    place, time, sign = found.pixel[order], found.time[order], found.polarity[order]
    second = np.flatnonzero(np.diff(place) == 0) + 1
    assert np.all(time[second] - time[second - 1] < 1.1e-6)
    assert np.all((sign[second] > 0) | (sign[second - 1] > 0))
    both = np.bincount(polarity[place[second]] + 1, minlength=3)
    assert both[[2, 0]] == pytest.approx([2000, 6000], rel=0.06)


def test_stamps_are_multiples_of_the_tick_and_never_early():
    given = {"pixel": {"shot_noise": {"rate_hz": 100.0}}}
    fine = seen(still(30.0), hidden=given, size=(20, 10))
    coarse = seen(still(30.0), hidden={**given, "readout": {"tick_us": 250.0}}, size=(20, 10))
    late = coarse.time - fine.time
    assert np.array_equal(coarse.pixel, fine.pixel)
    np.testing.assert_allclose(coarse.time / 250e-6, np.rint(coarse.time / 250e-6), atol=1e-6)
    assert late.min() > -1e-12
    assert late.max() < 250e-6


def test_a_time_on_the_tick_stays():
    at = Stream(np.array([0.003, 0.0030001]), np.zeros(2, int), np.ones(2, int))
    np.testing.assert_allclose(tick(at, 1e-3).time, [0.003, 0.004])
