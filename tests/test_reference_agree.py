"""The reference solvers against closed forms and each other."""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache

import numpy as np
import pytest
from reference import stimuli
from reference.agreement import count_and_time_errors, split_by_pixel
from reference.circuit import PURE, Circuit, Draws, merge_injected
from reference.dense_ode import as_lists, dense_truth, find_events
from reference.dense_signal import solve_signal
from reference.stimuli import Stimulus
from reference.twin import simulate_twin
from scipy.special import expi

pytestmark = pytest.mark.thorough

AGREE_US = 1.0

UNFILTERED = Circuit(cutoff_hz=None, linear_below=0.0)
RISE_PER_S = 25.0


def rising(seconds=0.039):
    """One pixel whose log intensity rises by 25 a second from 2 DN on."""
    times = np.array([0.0, seconds])
    return Stimulus(2.0 * np.exp(RISE_PER_S * times)[:, None], times)


def at_rest(dn, seconds):
    return Stimulus(np.full((2, len(dn)), dn, float), np.array([0.0, seconds]))


def both(stimulus, circuit, draws=None, step_us=20.0):
    """Event lists of the dense ODE and of the twin; without low-pass any step is exact."""
    truth, _ = as_lists(dense_truth(*stimulus, circuit, draws))
    return truth, simulate_twin(*stimulus, circuit, draws, step_us=step_us)


def random_draws(pixels, seconds, seed=3):
    rng = np.random.default_rng(seed)
    shot = []
    for _ in range(pixels):
        n = rng.poisson(50 * seconds)
        at = np.sort(rng.uniform(0, seconds, n))
        shot.append(np.column_stack([at, rng.random(n), rng.choice([-1.0, 1.0], n)]))
    hot = [np.sort(rng.uniform(0, seconds, 5 * (i % 7 == 0))) for i in range(pixels)]
    return Draws(
        injected=merge_injected(shot, hot),
        leak_factors=[1 / (1 + 0.1 * rng.uniform(-3, 3, 2000)) for _ in range(pixels)],
        reference_offset=rng.uniform(-0.1, 0.1, pixels),
    )


# ---------------------------------------------------------------------------------- closed forms


def test_truth_lies_on_the_exponential_integral_solution():
    # x linear in t from ln 10 to ln 255 in one sub-frame, corner proportional to e^x; then rest
    stimulus = stimuli.edge()
    events = dense_truth(*stimulus, PURE)[0].events
    h, wait = 1 / 240, 3 / 240
    x0, x1 = math.log(10), math.log(255)
    r, w1 = (x1 - x0) / h, 2 * math.pi * 300
    w0 = w1 * 10 / 255

    def g(z):
        return np.exp(-z) * expi(z)

    def y(t):
        s = np.minimum(t - wait, h)
        x = x0 + r * s
        a, b = w0 / r, w0 / r * np.exp(r * s)
        ramp = x - (g(b) - np.exp(a - b) * g(a))
        return x1 + (ramp - x1) * np.exp(-w1 * (t - wait - s))

    assert len(events) == 16
    np.testing.assert_allclose(y(events[:, 0]), x0 + 0.2 * np.arange(1, 17), rtol=0, atol=1e-10)


def test_two_constant_poles_respond_to_a_ramp_as_on_paper():
    # equal at every brightness: dark corner = corner at white
    circuit = Circuit(
        linear_below=0.0, cutoff_hz=200.0, dark_cutoff_hz=200.0, follower_hz=500.0, on=0.1
    )
    a, b = 2 * math.pi * 200, 2 * math.pi * 500
    truth, twin = both(rising(), circuit, step_us=4.0)
    t = truth[0][:, 0]
    lag = 1 / a + 1 / b
    tail = (b / a * np.exp(-a * t) - a / b * np.exp(-b * t)) / (b - a)
    risen = RISE_PER_S * (t - lag + tail)
    np.testing.assert_allclose(risen, 0.1 * np.arange(1, len(t) + 1), rtol=0, atol=1e-10)
    assert len(t) == 9
    assert count_and_time_errors(twin, truth).max_dt_us < 0.01


def test_without_low_pass_events_are_evenly_spaced_on_a_log_ramp():
    for events in both(rising(), UNFILTERED):
        np.testing.assert_allclose(
            events[0][:, 0], np.arange(1, 5) * 0.2 / RISE_PER_S, rtol=0, atol=1e-9
        )


def test_reference_is_taken_again_at_the_end_of_the_dead_time():
    dead = 700e-6
    circuit = dataclasses.replace(UNFILTERED, dead_time_us=700.0)
    for events in both(rising(), circuit):
        expected = np.arange(1, 5) * 0.2 / RISE_PER_S + np.arange(4) * dead
        np.testing.assert_allclose(events[0][:, 0], expected, rtol=0, atol=1e-9)


def test_leak_fires_regularly_at_rest_and_follows_light_and_jitter():
    circuit = Circuit(leak_hz=100.0, photo_leak_hz=200.0, on=np.array([0.2, 0.1]))
    factors = [np.array([1.0, 0.5, 2.0, 1.0] * 20)] * 2
    for events in both(at_rest([0.0, 127.5], 0.052), circuit, Draws(leak_factors=factors)):
        for one, rate in zip(events, (100.0, 200.0), strict=True):
            cycles = np.cumsum(1 / factors[0])[: len(one)] / rate
            np.testing.assert_allclose(one[:, 0], cycles, rtol=0, atol=1e-8)
            assert np.all(one[:, 1] == 1)
        assert len(events[0]) == 4
        assert len(events[1]) == 9


def test_a_noise_event_moves_the_reference_to_the_signal():
    # the reference would be passed at 8 ms; an event at 5 ms puts the next at 13 ms
    draws = Draws(injected=[np.array([[5e-3, 0.0, -1.0]])])
    for events in both(rising(0.015), UNFILTERED, draws):
        np.testing.assert_allclose(events[0], [[5e-3, -1], [13e-3, 1]], rtol=0, atol=1e-9)


def test_noise_candidates_are_lost_in_the_dead_time_and_thinned_by_light():
    circuit = Circuit(dead_time_us=1000.0)
    candidates = np.array(
        [
            [1.0e-3, 0.26, 1.0],
            [1.9e-3, 0.24, 1.0],  # 0.9 ms after the first: lost where that one fired
            [2.5e-3, 0.0, -1.0],
        ]
    )
    hot = [np.empty(0), np.empty(0), np.array([1.2e-3])]
    draws = Draws(injected=merge_injected([candidates] * 3, hot))
    dark, bright, bright_and_hot = [1e-3, 2.5e-3], [1.9e-3], [1.2e-3, 2.5e-3]
    for events in both(at_rest([0.0, 255.0, 255.0], 5e-3), circuit, draws):
        np.testing.assert_allclose(events[0][:, 0], dark, rtol=0, atol=1e-12)
        # at white a quarter is kept: the first is thinned out, the second fires
        np.testing.assert_allclose(events[1][:, 0], bright, rtol=0, atol=1e-12)
        np.testing.assert_allclose(events[2][:, 0], bright_and_hot, rtol=0, atol=1e-12)


def test_offset_of_the_first_reference_shifts_the_first_event_only():
    draws = Draws(reference_offset=np.array([-0.15]))
    for events in both(rising(), UNFILTERED, draws):
        expected = (0.05 + 0.2 * np.arange(5)) / RISE_PER_S
        np.testing.assert_allclose(events[0][:, 0], expected, rtol=0, atol=1e-9)


def test_noise_on_the_signal_adds_to_the_low_pass_output():
    # up by 0.5 in 10 ms and back: two ON on the way, then OFF at 0.2 and 0 ... of the reference 0.4
    path = (np.array([0.0, 0.01, 0.02]), np.array([0.0, 0.5, 0.0]))
    draws = Draws(signal_noise=[path])
    for update in ("exact", "first_order_hold"):
        circuit = Circuit(update=update, K=20, on=0.2, off=0.25)
        events = simulate_twin(*at_rest([100.0], 0.02), circuit, draws)[0]
        expected = [[4e-3, 1], [8e-3, 1], [17e-3, -1]]
        np.testing.assert_allclose(events, expected, rtol=0, atol=1e-7)


# -------------------------------------------------------------------------------- one and the other


CIRCUITS = {
    "pure": PURE,
    "lin-log, dark corner": Circuit(),
    "log, dark corner": Circuit(linear_below=0.0),
    "dead time": Circuit(dead_time_us=500.0),
    "two poles, leak, dead time": Circuit(
        follower_hz=500.0, leak_hz=5.0, photo_leak_hz=20.0, dead_time_us=1000.0
    ),
    "no low-pass, unequal thresholds": Circuit(cutoff_hz=None, on=0.15, off=0.3),
}


CASES = [
    *((1000.0, 13, name) for name in CIRCUITS),
    *((240.0, 6, name) for name in CIRCUITS),
    (24.0, 2, "two poles, leak, dead time"),
    (10.0, 2, "dead time"),
]


@pytest.mark.parametrize(("fps", "frames", "name"), CASES)
def test_twin_and_dense_ode_agree_on_a_moving_texture(fps, frames, name):
    circuit = CIRCUITS[name]
    stimulus = stimuli.texture(50, frames, fps=fps, speed=120.0)
    truths = dense_truth(*stimulus, circuit)
    found = count_and_time_errors(simulate_twin(*stimulus, circuit, step_us=4.0), *as_lists(truths))
    assert found.differing == []
    assert found.left_out == 0
    assert found.count_b >= 50
    assert found.max_dt_us < AGREE_US


@pytest.mark.parametrize("circuit", [PURE, Circuit(dead_time_us=500.0)], ids=["pure", "dead time"])
def test_twin_and_dense_ode_agree_on_edges(circuit):
    stimulus = stimuli.side_by_side(
        stimuli.edge(10.0, 255.0, fps=240.0),
        stimuli.edge(255.0, 10.0, fps=240.0),
        stimuli.edge(10.0, 255.0, fps=240.0, sub_frames=10),
        stimuli.edge(255.0, 10.0, fps=240.0, sub_frames=10),
        stimuli.edge(5.0, 60.0, fps=240.0, sub_frames=4),
    )
    truth = as_lists(dense_truth(*stimulus, circuit))[0]
    found = count_and_time_errors(simulate_twin(*stimulus, circuit, step_us=4.0), truth)
    assert found.differing == []
    assert found.count_b >= 39
    assert found.max_dt_us < AGREE_US


def test_twin_and_dense_ode_agree_with_all_noise():
    pixels = 40
    circuit = Circuit(leak_hz=2.0, photo_leak_hz=5.0, off=np.linspace(0.1, 0.3, pixels))
    for changed in (circuit, dataclasses.replace(circuit, dead_time_us=1000.0, follower_hz=300.0)):
        stimulus = stimuli.texture(pixels, 5, fps=240.0, speed=60.0)
        draws = random_draws(pixels, stimulus.times[-1])
        truths = dense_truth(*stimulus, changed, draws)
        twin = simulate_twin(*stimulus, changed, draws, step_us=4.0)
        found = count_and_time_errors(twin, *as_lists(truths))
        assert found.differing == []
        assert found.left_out == 0
        assert found.count_b > 80
        assert found.max_dt_us < AGREE_US


def test_tighter_tolerance_of_the_solver_changes_nothing():
    stimulus = stimuli.texture(30, 5, fps=240.0, speed=120.0)
    circuit = Circuit(follower_hz=500.0, leak_hz=1.0, dead_time_us=500.0)
    loose, tight = (
        find_events(solve_signal(*stimulus, circuit, rtol=rtol), circuit) for rtol in (1e-11, 1e-13)
    )
    found = count_and_time_errors(as_lists(loose)[0], as_lists(tight)[0])
    assert found.differing == []
    assert found.count_b > 80
    assert found.max_dt_us < 1e-3


# ------------------------------------------------------------------------------------------- ties


FAST = Circuit(cutoff_hz=1500.0, dark_cutoff_hz=100.0)
"""Settles in the 10 ms for which the blinking pixels rest."""


@lru_cache
def blinking():
    return stimuli.blinking(60, 20, fps=400.0, L=1, hold=4, darkest=50)


def test_answers_that_hang_by_a_thread_are_flagged_and_the_rest_agrees():
    truths = dense_truth(*blinking(), FAST)
    events, until = as_lists(truths)
    twin = simulate_twin(*blinking(), FAST, step_us=4.0)
    assert sum(len(t.ties) for t in truths) > 10
    assert count_and_time_errors(twin, events).max_dt_us > 100
    found = count_and_time_errors(twin, events, until)
    assert found.differing == []
    assert found.count_b > 200
    assert found.max_dt_us < AGREE_US


def test_only_flagged_crossings_depend_on_a_tiny_shift_of_the_thresholds():
    paths = solve_signal(*blinking(), FAST)
    events, until = as_lists(find_events(paths, FAST))
    for shift in (-3e-11, 3e-11):
        # ON and OFF apart, so that the way up and the way down no longer cancel
        shifted = dataclasses.replace(FAST, on=0.2 + shift, off=0.2 - shift)
        other, _ = as_lists(find_events(paths, shifted))
        assert count_and_time_errors(other, events).differing != []
        found = count_and_time_errors(other, events, until)
        assert found.differing == []
        assert found.max_dt_us < AGREE_US


def test_a_peak_just_short_of_a_level_or_just_past_it_is_a_tie():
    # without low-pass the signal peaks exactly where the light does
    for excess, ties, count in (
        (-1e-6, 0, 0),
        (-5e-8, 1, 0),
        (5e-8, 1, 2),
        (1e-6, 0, 2),
    ):
        peak = 50 * math.exp(0.2 + excess)
        light = np.array([50.0, peak, 50.0 * math.exp(-0.1)])[:, None]
        circuit = dataclasses.replace(UNFILTERED, off=0.25)
        truth = dense_truth(light, [0.0, 0.01, 0.03], circuit)[0]
        assert len(truth.ties) == ties, excess
        assert len(truth.events) == count, excess
        if ties:
            assert 0.009 < truth.valid_until < 0.01


def test_a_filtered_peak_between_two_steps_of_the_solver_is_not_missed():
    # constant corner a: up by r for 5 ms, then down as fast; y turns where it meets x
    circuit = Circuit(linear_below=0.0, cutoff_hz=200.0, dark_cutoff_hz=200.0)
    a, r, up = 2 * math.pi * 200, 40.0, 0.005
    light = 50 * np.exp(r * np.array([0.0, up, 0.0]))[:, None]
    top = r * (up - 1 / a + math.exp(-a * up) / a)  # y at the top of x
    # afterwards y = x + r/a + (top - r up - r/a) e^-as, which turns at e^as = 2 - e^-a up
    s = math.log(2 - math.exp(-a * up)) / a
    peak = r * (up - s) + r / a + (top - r * up - r / a) * math.exp(-a * s)
    for excess, ties, count in ((-1e-6, 0, 0), (-5e-8, 1, 0), (5e-8, 1, 1), (1e-6, 0, 1)):
        one = dataclasses.replace(circuit, on=peak - excess, off=0.5)
        truth = dense_truth(light, [0.0, up, 2 * up], one)[0]
        assert len(truth.ties) == ties, excess
        assert len(truth.events) == count, excess
        if count:
            # y falls short of its peak by r a t^2/2 at a time t before it
            before_us = 1e6 * math.sqrt(2 * excess / (a * r))
            assert (up + s) * 1e6 - truth.events[0, 0] * 1e6 == pytest.approx(before_us, rel=0.02)


def test_a_crossing_at_a_slope_of_a_slow_leak_is_no_tie():
    truth = dense_truth(*at_rest([50.0], 25.0), Circuit(leak_hz=0.1))[0]
    np.testing.assert_allclose(truth.events, [[10, 1], [20, 1]], rtol=0, atol=1e-6)
    assert truth.ties == []
    assert truth.valid_until == math.inf


def test_the_standard_stimuli_have_fewer_ties_than_one_event_in_ten_thousand():
    ties = events = 0
    for fps in stimuli.FRAME_RATES[2:]:
        for circuit in (PURE, Circuit()):
            paths = solve_signal(*stimuli.standard(fps), circuit)
            for dead_time in (None, 1000.0):
                truths = find_events(paths, dataclasses.replace(circuit, dead_time_us=dead_time))
                ties += sum(len(t.ties) for t in truths)
                events += sum(len(t.events) for t in truths)
    assert events > 800
    assert ties * 10_000 <= events


# -------------------------------------------------------------------------------------- comparison


def test_agreement_sees_missing_turned_and_late_events():
    truth = [np.array([[1.0, 1], [2.0, -1]]), np.array([[1.5, 1]]), np.empty((0, 2))]
    same = count_and_time_errors(truth, truth)
    assert (same.count_a, same.count_b, same.differing, same.max_dt_us) == (3, 3, [], 0.0)
    late = [truth[0] + [[0, 0], [3e-6, 0]], truth[1], truth[2]]
    found = count_and_time_errors(late, truth)
    assert found.differing == []
    assert found.max_dt_us == pytest.approx(3)
    assert found.mean_dt_us == pytest.approx(1)
    assert found.worst_pixel == 0
    assert count_and_time_errors([truth[0][:1], truth[1], truth[2]], truth).differing == [0]
    assert count_and_time_errors([truth[0], truth[1] * [1, -1], truth[2]], truth).differing == [1]
    assert count_and_time_errors([truth[0], truth[1], truth[1]], truth).differing == [2]


def test_agreement_leaves_out_what_follows_a_tie():
    truth = [np.array([[1.0, 1], [2.0, -1], [3.0, 1]])]
    found = count_and_time_errors([truth[0][:1]], truth, until=[1.5])
    assert found.differing == []
    assert (found.count_a, found.count_b, found.left_out) == (1, 1, 2)


def test_columns_of_events_are_split_by_pixel_in_order_of_time():
    rows = split_by_pixel([3.0, 1.0, 2.0], [2, 0, 2], [1, 0, 0], 4)
    assert [r.tolist() for r in rows] == [[[1.0, -1.0]], [], [[2.0, -1.0], [3.0, 1.0]], []]


def test_stimuli_are_the_same_each_time_and_linear_in_light():
    a, b = stimuli.standard(240.0), stimuli.standard(240.0)
    assert np.array_equal(a.light, b.light)
    assert a.light.shape == (121, 45)
    assert a.light.min() >= 4.0
    assert a.light.max() <= 255.0
    np.testing.assert_allclose(np.diff(a.light[:121:10, 5:], axis=0), 10 * np.diff(
        a.light[:, 5:], axis=0)[::10], atol=1e-9)  # fmt: skip
