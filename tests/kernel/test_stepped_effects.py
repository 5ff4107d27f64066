"""Effects of the stepping solver against plain differences in steps of 1 us."""

import numpy as np
import pytest
from differences import PURE, Truth
from harness import quiet, solve
from reference.agreement import count_and_time_errors
from reference.twin import light_of

from adv2e.config.model import (
    LogResponse,
    LowPass,
    Refractory,
    ResetOvershoot,
    SlewLimit,
    SourceFollower,
    Thresholds,
)
from adv2e.effects.courses import INJECTED_DTYPE, Additions
from adv2e.errors import ConfigError

SPEEDS = 0.35


def moving_light(knots, pixels, seed, step=SPEEDS):
    draw = np.random.default_rng(seed)
    walk = np.log(50) + np.cumsum(draw.normal(0, step, (knots, pixels)), 0)
    return np.exp(np.clip(walk, 0.0, np.log(255))).astype(np.float32).astype(np.float64)


def pixel(**sections):
    return quiet(log_response=LogResponse(linear_below=0), **sections)


def compare(found, truth, *, least=60):
    agreement = count_and_time_errors(found, truth)
    assert agreement.count_b > least
    assert len(agreement.differing) <= len(truth) // 20
    times = [abs(a[:, 0] - b[:, 0]) for a, b in zip(found, truth, strict=True) if len(a) == len(b)]
    apart = 1e6 * np.concatenate(times)
    assert np.median(apart) < 0.2
    assert apart.max() < 1.0


LIGHT = moving_light(11, 20, seed=5)
TIMES = np.arange(11) * 0.004
DEAD = {"refractory": Refractory(period_us=900.0)}


@pytest.mark.parametrize("per_s", [15.0, 40.0, 120.0])
@pytest.mark.parametrize("follower_hz", [None, 250.0])
@pytest.mark.quick_cases(1)
def test_slew_limit(per_s, follower_hz):
    sections = {"slew_limit": SlewLimit(per_s=per_s)}
    if follower_hz:
        sections["source_follower"] = SourceFollower(cutoff_hz=follower_hz)
    truth = Truth.of_light(LIGHT, TIMES, slew=per_s, follower_hz=follower_hz)
    compare(solve(LIGHT, TIMES, pixel(**sections)), truth.events(), least=20)


def test_slew_limit_of_no_account_changes_nothing(monkeypatch):
    monkeypatch.setattr("adv2e.pixel.steps._BEND_US", np.inf)  # steps as without it
    found = solve(LIGHT, TIMES, pixel(slew_limit=SlewLimit(per_s=1e6)))
    plain = solve(LIGHT, TIMES, pixel(), method="stepped")
    assert all(np.array_equal(a, b) for a, b in zip(found, plain, strict=True))


def test_slew_limit_holds_for_the_stepped_forms_too():
    """A step of the light becomes a ramp whatever the update."""
    light = np.array([[2.0], [200.0], [200.0]])
    slew = SlewLimit(per_s=40.0)
    for update in ("first_order_hold", "zero_order_hold", "euler"):
        low_pass = LowPass(cutoff_hz=3000.0, update=update)
        events = solve(light, [0.0, 0.001, 0.2], pixel(low_pass=low_pass, slew_limit=slew), K=200)
        np.testing.assert_allclose(np.diff(events[0][2:18, 0]), 0.2 / 40.0, rtol=1e-6)


@pytest.mark.parametrize("fraction", [-0.3, 0.15, 0.4])
@pytest.mark.parametrize("dead_us", [None, 900.0])
@pytest.mark.quick_cases(1)
def test_reset_overshoot_and_noise_events(fraction, dead_us):
    noise = [(0.0031, 2, 1), (0.00312, 2, -1), (0.02004, 7, -1), (0.0391, 2, -1)]
    sections = {"reset_overshoot": ResetOvershoot(fraction=fraction)}
    if dead_us:
        sections["refractory"] = Refractory(period_us=dead_us)

    def inject(t0, t1):
        rows = [(t, i, 0, p > 0) for t, i, p in noise if t0 <= t < t1]
        return np.array(rows, INJECTED_DTYPE)

    options = {
        "additions": Additions(longest_step_us=lambda a, b: 1000.0, inject=inject),
        "chunk": 3,
    }
    found = solve(LIGHT, TIMES, pixel(**sections), **options)
    dead_s = dead_us and dead_us * 1e-6
    truth = Truth.of_light(LIGHT, TIMES).events(dead_s=dead_s, overshoot=fraction, noise=noise)
    compare(found, truth)


@pytest.mark.parametrize("per_s", [-8.0, 6.0])
@pytest.mark.quick_cases(1)
def test_threshold_drift(per_s):
    thresholds = Thresholds(on=0.2, off=0.15, mismatch=0.0, drift_per_s=per_s)
    found = solve(LIGHT, TIMES, pixel(thresholds=thresholds, **DEAD))
    truth = Truth.of_light(LIGHT, TIMES)
    expected = truth.events(off=0.15, dead_s=9e-4, factor=lambda t: 1 + per_s * t)
    compare(found, expected)
    assert sum(map(len, found)) != sum(map(len, truth.events(off=0.15, dead_s=9e-4)))


def test_thresholds_that_drift_to_zero_are_an_error():
    thresholds = Thresholds(drift_per_s=-30.0)
    with pytest.raises(ConfigError, match=r"drift_per_s: -30 1/s .* 0\.0333 s after"):
        solve(LIGHT, TIMES, pixel(thresholds=thresholds))


def wave(share, frequency):
    return lambda t: share * np.sin(2 * np.pi * frequency * t)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.quick_cases(1)
def test_drive_signal_and_thresholds_that_change(wide):
    """Courses for all pixels alike, and one a pixel."""
    shape = np.linspace(0.5, 1.5, LIGHT.shape[1]) if wide else np.ones(1)

    def course(values):
        return lambda t: values(t)[:, None] * shape if wide else values(t)

    drive, signal = wave(0.3, 120.0), lambda t: 0.1 * np.cos(2 * np.pi * 90.0 * t)
    factor = lambda t: 1 + 0.3 * np.sin(2 * np.pi * 37.0 * t)  # noqa: E731
    ones = np.ones(LIGHT.shape[1])
    additions = Additions(
        longest_step_us=lambda a, b: 25.0,
        drive=course(drive),
        signal=course(signal),
        on=(lambda t: factor(t)[:, None] * ones) if wide else factor,
        off=factor,
    )
    found = solve(LIGHT, TIMES, pixel(**DEAD), additions=additions)
    truth = Truth.of_light(
        LIGHT,
        TIMES,
        drive=lambda t: drive(t)[:, None] * shape,
        signal=lambda t: signal(t)[:, None] * shape,
    )
    expected = truth.events(dead_s=9e-4, factor=factor)
    agreement = count_and_time_errors(found, expected)
    assert agreement.count_b > 100
    assert len(agreement.differing) <= 1
    assert agreement.mean_dt_us < 0.6  # courses are lines within a step


def test_all_at_once():
    thresholds = Thresholds(on=0.2, off=0.15, mismatch=0.0, drift_per_s=4.0)
    sections = {
        "thresholds": thresholds,
        "slew_limit": SlewLimit(per_s=40.0),
        "source_follower": SourceFollower(cutoff_hz=250.0),
        "reset_overshoot": ResetOvershoot(fraction=0.2),
        **DEAD,
    }
    truth = Truth.of_light(LIGHT, TIMES, slew=40.0, follower_hz=250.0)
    expected = truth.events(off=0.15, dead_s=9e-4, overshoot=0.2, factor=lambda t: 1 + 4 * t)
    compare(solve(LIGHT, TIMES, pixel(**sections)), expected, least=40)


def test_light_of_the_reference_is_what_the_truth_here_takes():
    x = np.log(np.array([1.0, 50.0, 255.0]))
    np.testing.assert_allclose(light_of(x, PURE), np.exp(x))
