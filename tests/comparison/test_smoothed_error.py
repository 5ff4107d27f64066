from __future__ import annotations

import math

import numpy as np
import pytest

from adv2e.comparison.distances import smoothed_errors, smoothed_norms
from adv2e.events import empty_events, make_events

WIDTH, HEIGHT = 12, 9
SIGMAS = (1_000, 4_000)


def slow_trains(events, sigma, times):
    """The smoothed trains of all pixels, sampled."""
    trains = np.zeros((HEIGHT, WIDTH, len(times)))
    for event in events:
        sign = 1 if event["p"] else -1
        pulse = np.exp(-((times - int(event["t"])) ** 2) / (2 * sigma**2))
        trains[event["y"], event["x"]] += sign * pulse
    return trains


def test_the_error_is_the_distance_of_the_smoothed_trains(random_events):
    measured, simulated = random_events(1, 300), random_events(2, 280)
    for sigma in SIGMAS:
        times = np.arange(-6 * sigma, 100_000 + 6 * sigma, sigma / 10)
        a, b = (slow_trains(stream, sigma, times) for stream in (measured, simulated))
        expected = np.linalg.norm(a - b) / np.linalg.norm(a)
        assert smoothed_errors(measured, simulated, WIDTH, [sigma]) == [
            pytest.approx(expected, rel=1e-6)
        ]


def test_scales_are_independent_of_each_other(random_events):
    streams = random_events(1, 300), random_events(2, 280)
    together = smoothed_errors(*streams, WIDTH, SIGMAS)
    alone = [smoothed_errors(*streams, WIDTH, [sigma])[0] for sigma in SIGMAS]
    assert together == pytest.approx(alone, rel=1e-12)
    assert smoothed_errors(*streams, WIDTH, SIGMAS[::-1]) == pytest.approx(alone[::-1], rel=1e-12)


@pytest.mark.parametrize("shift", [100, 2_000, 30_000])
def test_a_shifted_event_is_as_far_as_the_closed_form_says(shift):
    one, other = (make_events([t], [3], [4], [1]) for t in (0, shift))
    expected = math.sqrt(2 - 2 * math.exp(-((shift / 2_000) ** 2) / 4))
    assert smoothed_errors(one, other, WIDTH, [2_000]) == [pytest.approx(expected, abs=1e-7)]


def test_identical_streams_are_at_zero(events):
    assert smoothed_errors(events, events, WIDTH, SIGMAS) == [0, 0]


def test_no_simulated_events_are_at_one(events):
    assert smoothed_errors(events, empty_events(), WIDTH, SIGMAS) == [1, 1]


def test_no_measured_events_have_no_error(events):
    assert smoothed_errors(empty_events(), events, WIDTH, SIGMAS) is None


def test_events_of_neighbouring_pixels_do_not_meet():
    one, other = (make_events([50], [x], [4], [1]) for x in (3, 4))
    assert smoothed_errors(one, other, WIDTH, [2_000]) == [pytest.approx(math.sqrt(2))]


def test_on_and_off_at_one_time_cancel():
    both = make_events([5, 5], [1, 1], [1, 1], [1, 0])
    assert smoothed_norms([(both, 1.0)], WIDTH, SIGMAS).tolist() == [0, 0]


def test_epoch_times_change_nothing(random_events):
    streams = random_events(1, 300), random_events(2, 280)
    later = [stream.copy() for stream in streams]
    for stream in later:
        stream["t"] += 1_468_941_032_229_165
    assert smoothed_errors(*later, WIDTH, SIGMAS) == smoothed_errors(*streams, WIDTH, SIGMAS)
