"""The compiled pixel against the slow twin, which shares no code with it."""

import numpy as np
import pytest
from harness import check_against_twin, clock, moving_light, quiet
from reference.circuit import Circuit, Draws, merge_injected

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
    times = clock(14, interval_s)
    check_against_twin(light, times, quiet(**sections), Circuit(**circuit), in_steps=True)


@pytest.mark.parametrize("L", [1, 10])
@pytest.mark.thorough
def test_exact_with_the_printed_last_interval(L):
    light = moving_light(21, 8, seed=4, step=0.1)
    circuit = Circuit(K=4, L=L, printed_last_interval=True)
    check_against_twin(light, clock(21, 1 / 240), quiet(), circuit, K=4, L=L, printed=True)


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
    check_against_twin(light, times, pixel, circuit, draws, seed=seed)
