"""The stepping solver against the exact one and the slow twin.

Beside the exact one, it meets the dense ODE in ``test_exact_against_ode.py`` and the twin in
``test_twin.py``.
"""

import math

import numpy as np
import pytest
from harness import advance, by_pixel, clock, effect, moving_light, quiet, solve, start
from reference.agreement import count_and_time_errors
from reference.differences import STEP_S, Truth

from adv2e.config.model import (
    HotPixels,
    Leak,
    LogResponse,
    PhotoreceptorNoise,
    Refractory,
    Sampling,
    ShotNoise,
    SourceFollower,
    Thresholds,
)
from adv2e.errors import UsageError
from adv2e.kernel import rng
from adv2e.pixel.array import make_circuit
from adv2e.pixel.steps import steps_of

NOISY = {
    "dead time": Refractory(period_us=800.0),
    "no dead time": None,
}


@pytest.mark.parametrize("name", NOISY)
def test_noise_events_and_leak_are_those_of_the_solved_path(name):
    """The same draws: every event of shot noise, of hot pixels and of jittering leak."""
    pixel = quiet(
        log_response=LogResponse(linear_below=2.72),
        refractory=NOISY[name],
        leak=Leak(rate_hz=20, photo_rate_hz=10, jitter=0.2),
        shot_noise=ShotNoise(rate_hz=150),
        hot_pixels=HotPixels(fraction=0.3, rate_hz=200),
        thresholds=Thresholds(on=0.2, off=0.25, mismatch=0.03),
        initial_reference="random",
    )
    light, times = moving_light(25, 200, seed=6, step=0.15), clock(25, 1 / 240)
    solved = solve(light, times, pixel, seed=9)
    stepped = solve(light, times, pixel, seed=9, method="stepped")
    found = count_and_time_errors(stepped, solved)
    assert found.count_b > 3000
    assert not found.differing
    assert found.max_dt_us < 0.5


@pytest.mark.parametrize("follower_hz", [None, 500.0])
@pytest.mark.quick_cases(1)
def test_photoreceptor_noise_moves_the_signal(follower_hz):
    """At rest the noise is known from its draws: a line between its knots, behind both poles."""
    pixels, seed, rms = 12, 4, 0.12
    light, times = np.full((9, pixels), 80.0), np.arange(9) * 0.004
    corner = 2 * np.pi * (21.8 + 278.2 * 80 / 255)
    pixel = quiet(
        photoreceptor_noise=PhotoreceptorNoise(rms=rms, step=0.2),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
    )
    steps = steps_of(4000.0, make_circuit(pixel, Sampling(), seed))
    drawn = np.empty((-(-8 * steps // 4), 4, pixels))
    for block, four in enumerate(drawn):
        rng.normals_of_four(seed, rng.PHOTORECEPTOR_STEPS, 0, pixels, block, four)
    drawn = drawn.reshape(-1, pixels)
    decay = np.exp(-corner * 0.004 / steps)
    knots = np.empty((8 * steps + 1, pixels))
    knots[0] = [rms * rng.normal(seed, rng.PHOTORECEPTOR, i, 0) for i in range(pixels)]
    for k in range(8 * steps):
        knots[k + 1] = decay * knots[k] + rms * np.sqrt(1 - decay**2) * drawn[k]
    fine = np.arange(round(times[-1] / STEP_S) + 1) * STEP_S
    at = np.arange(8 * steps + 1) * (0.004 / steps)
    signal = np.stack([np.interp(fine, at, n) for n in knots.T], axis=1)
    if follower_hz:
        b = 2 * np.pi * follower_hz * STEP_S
        z = signal.copy()
        share = 2 * np.pi * follower_hz / (2 * np.pi * follower_hz + corner)
        own = [rng.normal(seed, rng.PHOTORECEPTOR_BEHIND, i, 0) for i in range(pixels)]
        z[0] = share * knots[0] + rms * np.sqrt(share * (1 - share)) * np.array(own)
        for k in range(len(z) - 1):
            z[k + 1] = z[k] + b / (1 + b / 2) * (0.5 * (signal[k] + signal[k + 1]) - z[k])
        signal = z
    found = count_and_time_errors(
        solve(light, times, pixel, seed=seed, method="stepped"), Truth(signal).events()
    )
    assert found.count_b > 30
    assert not found.differing
    assert found.max_dt_us < 0.5


def test_normals_are_normal_and_independent():
    drawn = np.empty((500, 4, 64))
    for block, four in enumerate(drawn):
        rng.normals_of_four(3, rng.PHOTORECEPTOR_STEPS, 10, 64, block, four)
    flat = drawn.reshape(-1, 64)
    assert abs(flat.mean()) < 4 / math.sqrt(flat.size)
    assert flat.var() == pytest.approx(1.0, abs=4 * math.sqrt(2 / flat.size))
    assert (flat**4).mean() == pytest.approx(3.0, abs=4 * math.sqrt(96 / flat.size))
    for a, b in ((flat[1:], flat[:-1]), (flat[:, 1:], flat[:, :-1]), (drawn[:, 0], drawn[:, 2])):
        assert abs((a * b).mean()) < 4 / math.sqrt(a.size)


def test_many_events_of_a_pixel_in_one_step_all_come():
    """A change of e-folds within a step, without filter and dead time."""
    light = np.array([[10.0, 200.0], [10.0, 200.0], [200.0, 10.0], [200.0, 10.0]])
    times = np.array([0.0, 0.001, 0.00108, 0.002])
    pixel = quiet(low_pass=None, log_response=LogResponse(linear_below=0))
    pixel_events = solve(light, times, pixel, method="stepped", K=1)
    for events, sign in zip(pixel_events, (1, -1), strict=True):
        expected = 0.001 + 0.00008 * 0.2 * np.arange(1, 15) / np.log(20)
        np.testing.assert_allclose(events[:, 0], expected, atol=1e-9)
        assert np.all(events[:, 1] == sign)


def test_a_peak_between_the_ends_of_a_step_is_seen():
    """The signal passes the threshold by 2e-6 and is back before the step ends."""
    light = np.array([[30.0], [30.0], [80.0], [30.0], [30.0]])
    times = np.array([0.0, 0.004, 0.008, 0.012, 0.02])
    fine = np.arange(0.0, 0.02, 1e-6)
    x = np.interp(fine, times, np.log(light[:, 0]))
    rate = 2 * np.pi * (21.8 + 278.2 * np.exp(x) / 255) * 1e-6
    y = np.empty_like(x)
    y[0] = x[0]
    for k in range(len(x) - 1):
        a = 0.5 * (rate[k] + rate[k + 1])
        y[k + 1] = y[k] + a / (1 + a / 2) * (0.5 * (x[k] + x[k + 1]) - y[k])
    peak = y.max() - y[0] - 2e-6
    assert np.diff(fine[y - y[0] > peak])[[0, -1]].sum() == pytest.approx(2e-6)  # one stretch
    assert np.count_nonzero(y - y[0] > peak) < 30  # shorter than a step
    pixel = quiet(thresholds=Thresholds(on=peak, off=1.0, mismatch=0))
    for method in ("auto", "stepped"):
        events = solve(light, times, pixel, method=method)[0]
        assert events[:, 1].tolist() == [1]
        assert events[0, 0] == pytest.approx(fine[y.argmax()], abs=15e-6)


def test_method_is_one_of_two():
    with pytest.raises(UsageError, match="method"):
        start(np.ones((2, 3)), [0, 1], quiet(), method="fast")


def test_an_effect_that_adds_nothing_changes_nothing():
    light, times = moving_light(9, 40, seed=2), clock(9, 1 / 240)
    times_ns = [round(t * 1e9) for t in times]
    arrays = [
        start(light, times_ns, quiet(), exact_times=True, **options)
        for options in (
            {"method": "stepped"},
            {"hooks": [effect((1, 40), math.inf, signal=lambda t: None)]},
        )
    ]
    one, two = (by_pixel(array, *advance(array, light, times_ns)) for array in arrays)
    assert sum(map(len, one)) > 100
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_light_beyond_white_is_followed_as_fast():
    """Thirty times white: a corner of 9 kHz."""
    light = np.exp(np.random.default_rng(0).uniform(0, 9, (12, 40))).astype(np.float32)
    times = clock(12, 1e-3)
    found = count_and_time_errors(
        solve(light, times, quiet(), method="stepped"), solve(light, times, quiet())
    )
    assert found.count_b > 1000
    assert not found.differing
    assert found.max_dt_us < 1.0
