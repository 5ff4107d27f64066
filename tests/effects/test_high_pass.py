"""High-pass: against plain differences in steps of 1 us, and where its answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from harness import pure, quiet, solve, start
from reference.differences import LIGHT, TIMES, Truth, check
from scipy.linalg import solve_continuous_lyapunov

import adv2e
from adv2e.config import load_config
from adv2e.config.model import (
    HighPass,
    LowPass,
    PhotoreceptorNoise,
    Refractory,
    SlewLimit,
    SourceFollower,
    Thresholds,
)
from adv2e.errors import ConfigError
from adv2e.kernel import per_pixel


@pytest.mark.parametrize("high_hz", [1.0, 20.0, 100.0])
@pytest.mark.parametrize("follower_hz", [None, 250.0])
@pytest.mark.parametrize("slew", [None, 40.0])
@pytest.mark.quick_cases(2)
def test_events_are_those_of_plain_differences(high_hz, follower_hz, slew):
    level = 0.06
    sections = {
        "high_pass": HighPass(cutoff_hz=high_hz),
        "thresholds": Thresholds(on=level, off=level, mismatch=0.0),
    }
    if follower_hz:
        sections["source_follower"] = SourceFollower(cutoff_hz=follower_hz)
    if slew:
        sections["slew_limit"] = SlewLimit(per_s=slew)
    poles = {"follower_hz": follower_hz, "high_hz": high_hz, "slew": slew}
    truth = Truth.of_light(LIGHT, TIMES, **poles).events(level, level)
    check(solve(LIGHT, TIMES, pure(**sections)), truth)


def test_dead_time_and_overshoot_go_on_from_the_filtered_signal():
    sections = {
        "high_pass": HighPass(cutoff_hz=15.0),
        "refractory": Refractory(period_us=1500.0),
    }
    truth = Truth.of_light(LIGHT, TIMES, high_hz=15.0).events(dead_s=1.5e-3)
    check(solve(LIGHT, TIMES, pure(**sections)), truth, least=40)


STEP = np.array([[20.0], [180.0], [180.0]])
AT = [0.0, 0.0005, 2.0]


def test_an_edge_is_forgotten_as_an_exponential():
    """ON events of the edge, then OFF events at the times of e^(-t/tau) crossing the thresholds."""
    pixel = quiet(
        high_pass=HighPass(cutoff_hz=2.0),
        low_pass=None,
        thresholds=Thresholds(on=0.25, off=0.25, mismatch=0.0),
    )
    events = solve(STEP, AT, pixel)[0]
    tau, size = 1 / (2 * np.pi * 2.0), np.log(180 / 20)
    # the ramp of the edge loses a little already; what is left of it decays
    peak = size * tau / 0.0005 * (1 - np.exp(-0.0005 / tau))
    on = events[events[:, 1] > 0]
    assert len(on) == int(peak / 0.25)
    reference = 0.25 * len(on)
    levels = reference - 0.25 * np.arange(1, 1 + int(reference / 0.25))
    known = 0.0005 + tau * np.log(peak / levels[levels > 1e-3])
    off = events[events[:, 1] < 0]
    np.testing.assert_allclose(off[:, 0], known, atol=2e-6)


def test_a_slow_ramp_makes_no_events():
    """The filtered signal of a ramp of s ln/s comes to s/(2 pi f) and no further."""
    light = np.exp(np.linspace(3.0, 5.0, 41))[:, None]
    times = np.linspace(0.0, 4.0, 41)
    for high_hz, least in ((0.5, 0), (None, 8)):  # 0.5 ln/s over 3.14/s: 0.16 ln, below 0.2
        section = {"high_pass": HighPass(cutoff_hz=high_hz)} if high_hz else {}
        found = solve(light, times, pure(**section))[0]
        assert len(found) == 0 if least == 0 else len(found) >= least


def test_a_high_pass_of_no_account_changes_nothing():
    found = solve(LIGHT, TIMES, pure(high_pass=HighPass(cutoff_hz=1e-7)), method="stepped")
    plain = solve(LIGHT, TIMES, pure(), method="stepped")
    for one, other in zip(found, plain, strict=True):
        assert np.array_equal(one[:, 1], other[:, 1])
        np.testing.assert_allclose(one[:, 0], other[:, 0], atol=1e-6)


def test_the_stepped_forms_have_it_too():
    pixels = [
        pure(low_pass=LowPass(update=update), high_pass=HighPass(cutoff_hz=20.0))
        for update in ("exact", "first_order_hold")
    ]
    exact, stepped = (solve(LIGHT, TIMES, pixel, K=400) for pixel in pixels)
    alike = [len(a) == len(b) for a, b in zip(exact, stepped, strict=True)]
    assert np.mean(alike) > 0.8
    apart = [
        np.abs(a[:, 0] - b[:, 0]) for a, b in zip(exact, stepped, strict=True) if len(a) == len(b)
    ]
    assert np.median(np.concatenate(apart)) < 20e-6


# ---- Photoreceptor noise, which was there before the first frame.


@pytest.mark.parametrize("follower_hz", [None, 480.0])
def test_what_is_subtracted_of_noise_is_stationary_at_the_start(follower_hz):
    """Moments of noise, of noise behind the second pole, and of what follows it slowly."""
    rms, corner_hz, high_hz, count = 0.3, 320.0, 64.0, 200_000
    pixel = quiet(
        low_pass=LowPass(cutoff_hz=corner_hz, dark_cutoff_hz=corner_hz),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
        high_pass=HighPass(cutoff_hz=high_hz),
        photoreceptor_noise=PhotoreceptorNoise(rms=rms),
    )
    state = start(np.full((1, 400, count // 400), 100.0), [0], pixel, seed=3).state
    ahead = [per_pixel.NOISE, per_pixel.SEEN] if follower_hz else [per_pixel.NOISE]
    slow = state[per_pixel.SLOW] - state[per_pixel.FIRST]
    np.testing.assert_allclose(state[per_pixel.REFERENCE], state[per_pixel.SEEN] - slow, atol=1e-12)
    rates = [corner_hz, follower_hz, high_hz] if follower_hz else [corner_hz, high_hz]
    matrix = -np.diag(rates) + np.diag(rates[1:], -1)
    driven = np.zeros_like(matrix)
    driven[0, 0] = 2 * corner_hz * rms**2
    known = solve_continuous_lyapunov(matrix, -driven)
    np.testing.assert_allclose(
        np.cov([*state[ahead], slow]), known, atol=6 * rms**2 / np.sqrt(count)
    )


def test_noise_behind_it_fires_as_much_at_the_start_as_later():
    pixel = quiet(
        high_pass=HighPass(cutoff_hz=5.0),
        photoreceptor_noise=PhotoreceptorNoise(rms=0.07),
        refractory=Refractory(period_us=100.0),
    )
    light = np.full((41, 1500), 100.0)
    events = solve(light, np.linspace(0.0, 0.4, 41), pixel)
    times = np.concatenate([one[:, 0] for one in events])
    early, late = (np.count_nonzero((times > a) & (times <= a + 0.1)) for a in (0.0, 0.3))
    assert early > 500
    assert abs(early - late) < 6 * np.sqrt(early + late)


def test_causes_of_noise_behind_it_are_refused():
    frames = np.full((3, 4, 5), 0.4, np.float32)
    sets = ["pixel.high_pass.cutoff_hz=5", "pixel.photoreceptor_noise.rms=0.05"]
    config = load_config((), sets)
    with pytest.raises(ConfigError, match=r"causes: .*photoreceptor_noise.*high_pass"):
        list(adv2e.simulate(frames, 100, config=config, causes=True))
    alone = load_config((), sets[:1])
    list(adv2e.simulate(frames, 100, config=alone, causes=True))
