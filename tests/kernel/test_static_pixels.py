"""Pixels at rest: their closed form, against lanes, which take them where a neighbour moves."""

import numpy as np
import pytest
from harness import advance, by_pixel, quiet, start
from reference.agreement import count_and_time_errors

from adv2e.config.model import HotPixels, Leak, Refractory, ShotNoise, Thresholds

PIXELS = 300
CLOSE_US = 1e-6


def events(light, times_ns, moving, **sections):
    """Events of pixels at constant light; with `moving`, one more of the strip changes a little."""
    frames = np.repeat(np.append(light, 100.0)[None].astype(np.float32), len(times_ns), axis=0)
    if moving:
        frames[1::2, -1] = 100.5
    levels = Thresholds(on=0.05, off=0.06, mismatch=0.02)
    pixel = quiet(thresholds=levels, initial_reference="random", **sections)
    array = start(frames, times_ns, pixel, seed=3, exact_times=True)
    return by_pixel(array, *advance(array, frames, times_ns))[:-1]


@pytest.mark.parametrize("dead_time_us", [None, 30.0, 700.0, 20_000.0])
@pytest.mark.parametrize(
    "noise",
    [
        {},
        {"shot_noise": ShotNoise(rate_hz=200.0)},
        {
            "shot_noise": ShotNoise(rate_hz=50.0),
            "hot_pixels": HotPixels(fraction=0.3, rate_hz=400.0),
        },
    ],
    ids=["quiet", "shot", "hot"],
)
@pytest.mark.parametrize("interval_ms", [1.0, 40.0])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_at_rest_as_in_lanes(dead_time_us, noise, interval_ms, jitter):
    light = np.exp(np.random.default_rng(1).uniform(0.0, 5.5, PIXELS))
    times_ns = [round(k * interval_ms * 1e6) for k in range(round(400 / interval_ms) + 1)]
    sections = {"leak": Leak(rate_hz=7.0, photo_rate_hz=20.0, jitter=jitter), **noise}
    if dead_time_us is not None:
        sections["refractory"] = Refractory(period_us=dead_time_us)
    still = events(light, times_ns, False, **sections)
    beside = events(light, times_ns, True, **sections)
    assert sum(map(len, still)) > 800
    found = count_and_time_errors(still, beside)
    assert not found.differing
    assert found.max_dt_us < CLOSE_US


def test_leak_alone_fires_in_equal_steps():
    """A pixel at rest without noise fires at its leak rate, dead time or not: in closed form."""
    light, times_ns = np.full(PIXELS, 51.0), [0, 300_000_000, 1_000_000_000, 2_500_000_000]
    for one in events(
        light, times_ns, False, leak=Leak(rate_hz=9.0, photo_rate_hz=15.0, jitter=0.0)
    ):
        assert 20 <= len(one) <= 31  # references begin anywhere between the thresholds
        assert np.allclose(np.diff(one[:, 0]), 1.0 / 12.0, rtol=0, atol=1e-8)
        assert np.all(one[:, 1] == 1)
