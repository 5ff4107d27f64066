"""Noise events in the lanes: among those of the signal, and by themselves."""

import math

import numpy as np
import pytest
from lane_checks import clock, fire
from lane_light import walks
from reference.agreement import count_and_time_errors
from reference.circuit import Circuit, Draws
from reference.dense_ode import as_lists, find_events
from reference.dense_signal import solve_signal

from adv2e.config.model import ShotNoise
from adv2e.kernel import rng


def shot_candidates(pixels, rate_hz, seed, end_s):
    """Return the candidates of every pixel, drawn here one by one."""
    drawn = []
    for pixel in range(pixels):
        rows, t = [], 0.0
        for draw in range(10_000):
            t += rng.exponential(seed, rng.SHOT_TIME, pixel, draw) / rate_hz
            if t >= end_s:
                break
            u, v = rng.uniforms(seed, rng.SHOT_KIND, pixel, draw)
            rows.append((t, u, 1 if v < 0.5 else -1))
        drawn.append(np.array(rows).reshape(-1, 3))
    return drawn


@pytest.mark.parametrize("dead_time_us", [None, 700.0, 9_000.0])
@pytest.mark.parametrize("leak_hz", [0.0, 30.0])
@pytest.mark.quick_cases(1)
def test_shot_noise_at_500_hz_among_signal_events(dead_time_us, leak_hz):
    seed, rate_hz = 4, 500.0
    light, times = walks(31, 8, 20, lo=1.0), clock([4.0, 12.0, 1.0, 33.0, 4.0, 4.0, 33.0])
    circuit = Circuit(linear_below=2.72, dead_time_us=dead_time_us, leak_hz=leak_hz)
    draws = Draws(injected=shot_candidates(light.shape[1], rate_hz, seed, times[-1]))
    truth, until = as_lists(find_events(solve_signal(light, times, circuit), circuit, draws))
    found = fire(light, times, circuit, seed=seed, shot_noise=ShotNoise(rate_hz=rate_hz))
    agreement = count_and_time_errors(found, truth, until)
    assert agreement.count_b > 150
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0


@pytest.mark.parametrize("dead_time_us", [None, 700.0])
@pytest.mark.parametrize("dn", [0.0, 128.0])
def test_rate_and_gaps_of_shot_noise_at_500_hz(dead_time_us, dn):
    pixels, seconds, kept = 64, 1.0, 500.0 * (1 - 0.75 * dn / 255)
    light, times = np.full((31, pixels), dn), np.linspace(0.0, seconds, 31)
    circuit = Circuit(dead_time_us=dead_time_us)
    found = fire(light, times, circuit, shot_noise=ShotNoise(rate_hz=500.0))
    gaps = np.concatenate([np.diff(events[:, 0]) for events in found]) * 1e6
    dead_s = (dead_time_us or 0.0) * 1e-6
    assert gaps.min() >= dead_s * 1e6 - 1e-4  # times count from the start of the recording [s]
    # a renewal process: a gap is the dead time and an exponential wait
    expected = pixels * seconds * kept / (1 + kept * dead_s)
    count = sum(map(len, found))
    assert abs(count - expected) < 4 * math.sqrt(expected) / (1 + kept * dead_s) + pixels
    assert np.mean(gaps) == pytest.approx(1e6 / kept + dead_s * 1e6, rel=4 / math.sqrt(count))
