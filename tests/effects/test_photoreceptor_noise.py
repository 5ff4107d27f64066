"""Photoreceptor noise: its variance and correlation, and the events that it makes."""

from __future__ import annotations

import numpy as np
import pytest
from camera.helpers import seen, still
from harness import advance, at_rest, quiet, solve, start

from adv2e.config import load_config
from adv2e.config.model import (
    LogResponse,
    LowPass,
    PhotoreceptorNoise,
    Pixel,
    Refractory,
    SourceFollower,
    Thresholds,
)
from adv2e.errors import ConfigError
from adv2e.kernel import per_pixel


def test_photoreceptor_noise_has_its_rms_and_correlation():
    """Sampled from the state at the ends of intervals, at two brightnesses."""
    interval_ns = 500_000
    for dn in (20.0, 255.0):
        pixel = quiet(photoreceptor_noise=PhotoreceptorNoise(rms=0.05))
        light = np.full((2, 1, 2000), dn, np.float32)
        array = start(light, [0], pixel)
        samples = []
        for k in range(30):
            advance(array, light, [k * interval_ns, (k + 1) * interval_ns])
            samples.append(array.state[per_pixel.NOISE].copy())
        noise = np.array(samples)
        assert noise.std() == pytest.approx(0.05, rel=0.03)
        corner = 2e-9 * np.pi * (21.8 + 278.2 * dn / 255)
        lagged = np.mean(noise[1:] * noise[:-1]) / np.mean(noise**2)
        assert lagged == pytest.approx(np.exp(-corner * interval_ns), abs=0.02)


def test_photoreceptor_noise_alternates():
    pixel = quiet(photoreceptor_noise=PhotoreceptorNoise(rms=0.08), initial_reference="random")
    events, _ = at_rest(128.0, pixel, seconds=0.3, pixels=200)
    pairs = opposite = 0
    for x in range(200):
        p = events["p"][events["x"] == x].astype(int)
        pairs += len(p) - 1 if len(p) else 0
        opposite += np.count_nonzero(np.diff(p))
    assert pairs > 500
    assert opposite / pairs > 0.75


def test_noise_behind_a_second_pole_begins_as_it_goes_on():
    """Its variance, and what it has in common with that before the pole, as theory has them."""
    rms, follower_hz = 0.1, 60.0
    dn = np.repeat([10.0, 200.0], 4000)
    light = np.tile(dn, (3, 1)).astype(np.float32)
    times = [0, 30_000_000, 60_000_000]
    pixel = quiet(
        thresholds=Thresholds(on=9.0, off=9.0, mismatch=0.0),
        source_follower=SourceFollower(cutoff_hz=follower_hz),
        photoreceptor_noise=PhotoreceptorNoise(rms=rms, step=0.3),
    )
    array = start(light, times, pixel)
    share = follower_hz / (follower_hz + 21.8 + (300.0 - 21.8) * dn / 255.0)
    for _ in range(2):
        noise, seen = array.state[per_pixel.NOISE], array.state[per_pixel.SEEN]
        for half in (slice(0, 4000), slice(4000, 8000)):
            expected = rms**2 * share[half][0]
            # five standard errors
            assert np.var(seen[half]) == pytest.approx(expected, rel=0.12)
            both = np.mean(seen[half] * noise[half])
            assert both == pytest.approx(expected, rel=0.12 / np.sqrt(share[half][0]))
        advance(array, light, times)


@pytest.mark.parametrize("method", ["auto", "stepped"])
@pytest.mark.parametrize("follower_hz", [None, 300.0])
@pytest.mark.quick_cases(1)
def test_photoreceptor_noise_makes_as_many_events_as_the_camera_has(follower_hz, method):
    follower = {"cutoff_hz": follower_hz} if follower_hz else None
    dead = {"period_us": 500.0}
    given = {"photoreceptor_noise": {"rms": 0.08}, "source_follower": follower, "refractory": dead}
    stream = seen(still(60.0), hidden={"pixel": given}, size=(25, 20), duration_s=0.3, step_us=50.0)
    pixel = quiet(
        log_response=LogResponse(linear_below=0),
        low_pass=LowPass(dark_cutoff_hz=20.0),
        photoreceptor_noise=PhotoreceptorNoise(rms=0.08),
        source_follower=SourceFollower(**follower) if follower else None,
        refractory=Refractory(**dead),
    )
    light, times = np.full((4, 500), 60.0), np.arange(4) * 0.1
    events = sum(map(len, solve(light, times, pixel, seed=1, method=method)))
    assert events > 3000
    assert events == pytest.approx(len(stream.time), rel=0.06)


def test_noise_of_the_davis346_rises_with_the_light_and_falls_again():
    """ON and OFF, in a scene whose black is dark; as published counts of another camera do."""
    pixel = load_config(["davis346"], ["pixel.photoreceptor_noise.rms=0.052"]).pixel
    rates = []
    for dn in (0.1, 0.6, 2.5, 25.0, 100.0):
        events, _ = at_rest(dn, pixel, 4.0)
        on = np.count_nonzero(events["p"])
        rates.append((on, len(events) - on))
    for counts in np.transpose(rates):
        assert np.argmax(counts) == 2
        assert counts[0] < 0.3 * counts[2] > 3 * counts[4]
        assert counts[0] < counts[1]
        assert counts[3] > counts[4]


def test_noise_without_the_filter_that_limits_it_is_an_error():
    with pytest.raises(ConfigError, match="low_pass"):
        Pixel(low_pass=None, photoreceptor_noise=PhotoreceptorNoise(rms=0.1))
