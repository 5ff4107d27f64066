"""The compiled pixel against the slow twin, which shares no code with it."""

from dataclasses import replace

import numpy as np
import pytest
from harness import first_draws, quiet, solve
from reference.agreement import count_and_time_errors
from reference.circuit import Circuit, Draws, merge_injected
from reference.twin import simulate_twin

from adv2e.config.model import (
    HotPixels,
    Leak,
    LogResponse,
    LowPass,
    Refractory,
    ShotNoise,
    SourceFollower,
    Thresholds,
)
from adv2e.kernel import rng


def moving_light(knots, pixels, seed=0, step=0.3):
    """Return light that wanders, rests, returns to old values, and crosses the knee both ways."""
    draw = np.random.default_rng(seed)
    walk = np.exp(np.cumsum(draw.normal(0, step, (knots, pixels)), 0) + np.log(50))
    walk = np.clip(walk, 0.3, 255)
    walk[3:5, : pixels // 4] = walk[2, : pixels // 4]
    walk[-2:, pixels // 4 : pixels // 2] = walk[0, pixels // 4 : pixels // 2]
    walk[1, -1], walk[2, -1] = 3.0, 250.0
    return walk.astype(np.float32).astype(np.float64)


def check(
    light, times, pixel, circuit, draws=None, within_us=0.3, step_us=4.0, in_steps=False, **options
):
    """Compare the kernel with the twin; `in_steps`: the solver in steps of time, too."""
    draws = draws or Draws()

    def begin(array):
        nonlocal draws
        first = first_draws(array, draws.leak_factors)
        draws = replace(first, injected=draws.injected)

    kernel = solve(light, times, pixel, begin=begin, **options)
    twin = simulate_twin(light, times, circuit, draws, step_us=step_us)
    solved = [(kernel, within_us)]
    if in_steps:
        solved.append((solve(light, times, pixel, method="stepped", **options), 1.0))
    for events, within in solved:
        found = count_and_time_errors(events, twin)
        assert found.count_b > 50
        assert not found.differing
        assert found.max_dt_us < within


def clock(knots, interval_s):
    return np.round(np.arange(knots) * interval_s * 1e9) * 1e-9


CASES = {
    "lin-log": ({}, {}),
    "knee at e": (
        {"log_response": LogResponse(linear_below=np.e)},
        {"linear_below": float(np.e)},
    ),
    "pure logarithm": (
        {
            "log_response": LogResponse(linear_below=0),
            "low_pass": LowPass(dark_cutoff_hz=0),
        },
        {"linear_below": 0.0, "dark_cutoff_hz": 0.0},
    ),
    "no filter": ({"low_pass": None}, {"cutoff_hz": None}),
    "second pole": (
        {"source_follower": SourceFollower(cutoff_hz=400)},
        {"follower_hz": 400.0},
    ),
    "dead time": ({"refractory": Refractory(period_us=900)}, {"dead_time_us": 900.0}),
    "leak": (
        {"leak": Leak(rate_hz=15, photo_rate_hz=40, jitter=0)},
        {"leak_hz": 15.0, "photo_leak_hz": 40.0},
    ),
    "asymmetric": (
        {"thresholds": Thresholds(on=0.13, off=0.31, mismatch=0)},
        {"on": 0.13, "off": 0.31},
    ),
    "all of these": (
        {
            "source_follower": SourceFollower(cutoff_hz=700),
            "refractory": Refractory(period_us=600),
            "leak": Leak(rate_hz=15, photo_rate_hz=40, jitter=0),
            "thresholds": Thresholds(on=0.13, off=0.31, mismatch=0),
        },
        {
            "follower_hz": 700.0,
            "dead_time_us": 600.0,
            "leak_hz": 15.0,
            "photo_leak_hz": 40.0,
            "on": 0.13,
            "off": 0.31,
        },
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("interval_s", [1 / 240, 1 / 1000])
@pytest.mark.quick_cases(1)
def test_exact_and_in_steps_of_time(name, interval_s):
    sections, circuit = CASES[name]
    light = moving_light(14, 32, seed=len(name))
    check(light, clock(14, interval_s), quiet(**sections), Circuit(**circuit), in_steps=True)


@pytest.mark.parametrize("update", ["first_order_hold", "zero_order_hold", "euler", "paper"])
def test_stepped_forms_behind_a_second_pole_from_rest(update):
    """The paper's form moves at rest, too: its weights do not sum to one."""
    light = np.repeat(moving_light(8, 12, seed=3), 4, axis=0)
    pixel = quiet(low_pass=LowPass(update=update), source_follower=SourceFollower(cutoff_hz=100))
    circuit = Circuit(update=update, K=3, follower_hz=100.0)
    check(light, clock(32, 1 / 240), pixel, circuit, K=3, within_us=0.01)


@pytest.mark.parametrize("L", [1, 10])
@pytest.mark.thorough
def test_exact_with_the_printed_last_interval(L):
    light = moving_light(21, 8, seed=4, step=0.1)
    circuit = Circuit(K=4, L=L, printed_last_interval=True)
    check(light, clock(21, 1 / 240), quiet(), circuit, K=4, L=L, printed=True)


def shot_candidates(pixel, rate_hz, seed, end_s):
    rows, t, draw = [], 0.0, 0
    while True:
        t += rng.exponential(seed, rng.SHOT_TIME, pixel, draw) / rate_hz
        if t >= end_s:
            return np.array(rows).reshape(-1, 3)
        u, v = rng.uniforms(seed, rng.SHOT_KIND, pixel, draw)
        rows.append((t, u, 1 if v < 0.5 else -1))
        draw += 1


def hot_times(pixel, fraction, rate_hz, seed, end_s):
    if rng.uniforms(seed, rng.HOT_CHOICE, pixel, 0)[0] >= fraction:
        return np.empty(0)
    steps = [rng.exponential(seed, rng.HOT_TIME, pixel, k) for k in range(400)]
    times = np.cumsum(steps) / rate_hz
    return times[times < end_s]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("first", "dead_time", "jitter"),
    [
        ("settled", None, 0.2),
        ("settled", 800.0, 0.0),
        ("running", None, 0.0),
        ("running", 800.0, 0.2),
    ],
)
def test_noise_events_and_leak_jitter(first, dead_time, jitter):
    """The same draws handed to both: thinning, order, dead time and references must agree."""
    knots, pixels, seed = 25, 24, 9
    light = moving_light(knots, pixels, seed=6, step=0.15)
    times = clock(knots, 1 / 240)
    pixel = quiet(
        refractory=Refractory(period_us=dead_time) if dead_time else None,
        leak=Leak(rate_hz=20, photo_rate_hz=10, jitter=jitter),
        shot_noise=ShotNoise(rate_hz=150),
        hot_pixels=HotPixels(fraction=0.3, rate_hz=200),
        initial_reference=first,
    )
    shot = [shot_candidates(i, 150.0, seed, times[-1]) for i in range(pixels)]
    hot = [hot_times(i, 0.3, 200.0, seed, times[-1]) for i in range(pixels)]
    assert sum(map(len, hot)) > 20
    factors = [
        np.array(
            [
                1 / (1 + jitter * np.clip(rng.normal(seed, rng.LEAK_PERIOD, i, k), -3, 3))
                for k in range(200)
            ]
        )
        for i in range(pixels)
    ]
    draws = Draws(injected=merge_injected(shot, hot), leak_factors=factors)
    circuit = Circuit(dead_time_us=dead_time, leak_hz=20.0, photo_leak_hz=10.0)
    check(light, times, pixel, circuit, draws, seed=seed)
