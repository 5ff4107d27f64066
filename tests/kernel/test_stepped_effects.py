"""Effects of the stepping solver against plain differences in steps of 1 us."""

import numpy as np
import pytest
from harness import clock, effect, moving_light, pure, quiet, solve
from reference.agreement import count_and_time_errors
from reference.differences import LIGHT, PURE, TIMES, Truth, check
from reference.twin import light_of

from adv2e.config.model import (
    HighPass,
    Leak,
    LogResponse,
    Refractory,
    ResetOvershoot,
    ShotNoise,
    SlewLimit,
    SourceFollower,
    Thresholds,
)

DEAD = {"refractory": Refractory(period_us=900.0)}


def wave(share, frequency):
    return lambda t: share * np.sin(2 * np.pi * frequency * t)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.quick_cases(1)
def test_drive_signal_and_thresholds_that_change(wide):
    """Courses for all pixels alike, and one a pixel."""
    shape = np.linspace(0.5, 1.5, LIGHT.shape[1]) if wide else np.ones(1)
    ones = np.ones((1, LIGHT.shape[1]))

    def course(values):
        return lambda t: values(t)[:, None, None] * shape[None] if wide else values(t)

    drive, signal = wave(0.3, 120.0), lambda t: 0.1 * np.cos(2 * np.pi * 90.0 * t)
    factor = lambda t: 1 + 0.3 * np.sin(2 * np.pi * 37.0 * t)  # noqa: E731

    def thresholds(t):
        return factor(t)[:, None, None] * ones if wide else factor(t), factor(t)

    courses = {"drive": course(drive), "signal": course(signal), "thresholds": thresholds}
    added = effect((1, LIGHT.shape[1]), 25.0, **courses)
    found = solve(LIGHT, TIMES, pure(**DEAD), hooks=[added])
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


COURSES = {
    "signal": {"signal": wave(0.15, 90.0)},
    "gain": {"gain": lambda t: 1.0 + 0.6 * np.sin(2 * np.pi * 70.0 * t)},
    "both": {"signal": wave(0.1, 90.0), "gain": lambda t: np.exp(0.3 * np.sin(700.0 * t))},
    "drive": {"signal": wave(0.1, 90.0), "drive": wave(0.2, 50.0)},
}


@pytest.mark.parametrize("least", [0.3, 12.0])
@pytest.mark.parametrize("name", COURSES)
@pytest.mark.quick_cases(1)
def test_one_pole_alone_is_as_any_circuit(name, least):
    """Courses of all pixels alike, in one loop, and the same one a pixel, in loops for all effects.

    Light from 0.3 DN on crosses the knee, that from 12 on never does.
    """
    pixel = quiet(
        log_response=LogResponse(linear_below=2.72),
        leak=Leak(rate_hz=20, photo_rate_hz=10, jitter=0.2),
        shot_noise=ShotNoise(rate_hz=30),
        **DEAD,
    )
    light, times = np.maximum(moving_light(13, 60, step=0.25), least), clock(13, 1 / 240)
    ones = np.ones((1, 1, 60))
    narrow = COURSES[name]
    wide = {key: lambda t, values=of: values(t)[:, None, None] * ones for key, of in narrow.items()}
    alone, any_circuit = (
        solve(light, times, pixel, seed=5, hooks=[effect((1, 60), 50.0, **courses)])
        for courses in (narrow, wide)
    )
    found = count_and_time_errors(alone, any_circuit)
    assert found.count_b > 300
    assert not found.differing
    assert found.max_dt_us < 1e-5


def test_all_at_once():
    thresholds = Thresholds(on=0.2, off=0.15, mismatch=0.0, drift_per_s=4.0)
    sections = {
        "thresholds": thresholds,
        "slew_limit": SlewLimit(per_s=40.0),
        "source_follower": SourceFollower(cutoff_hz=250.0),
        "high_pass": HighPass(cutoff_hz=4.0),
        "reset_overshoot": ResetOvershoot(fraction=0.2),
        **DEAD,
    }
    truth = Truth.of_light(LIGHT, TIMES, slew=40.0, follower_hz=250.0, high_hz=4.0)
    expected = truth.events(off=0.15, dead_s=9e-4, overshoot=0.2, factor=lambda t: 1 + 4 * t)
    check(solve(LIGHT, TIMES, pure(**sections)), expected, least=40)


def test_light_of_the_reference_is_what_the_truth_here_takes():
    x = np.log(np.array([1.0, 50.0, 255.0]))
    np.testing.assert_allclose(light_of(x, PURE), np.exp(x))
