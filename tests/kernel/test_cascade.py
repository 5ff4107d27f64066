"""Two poles without small steps of time: against the dense ODE, and against steps of time."""

import math

import numpy as np
import pytest
from harness import EVERYTHING, advance, by_pixel, quiet, solve, start
from reference import stimuli
from reference.agreement import count_and_time_errors
from reference.circuit import Circuit
from reference.dense_ode import as_lists, dense_truth

from adv2e.config.model import (
    Leak,
    LowPass,
    PhotoreceptorNoise,
    Pixel,
    Refractory,
    ResetOvershoot,
    SourceFollower,
    Thresholds,
)
from adv2e.kernel.cascade import plan
from adv2e.kernel.cascade import substep as curve


def agreement_with_ode(stimulus, circuit, sections):
    truth, until = as_lists(dense_truth(*stimulus, circuit))
    found = solve(stimulus.light, stimulus.times, quiet(**sections))
    return count_and_time_errors(found, truth, until)


def second_pole(hz, **circuit):
    return Circuit(follower_hz=hz, **circuit), {"source_follower": SourceFollower(cutoff_hz=hz)}


@pytest.mark.parametrize(
    ("fps", "L", "hz"),
    [
        *[(24, 1, 300.0), (10, 10, 300.0), (240, 1, 60.0), (1000, 1, 60.0)],
        *[(10, 10, 1000.0), (1000, 1, 1000.0), (240, 1, 10_000.0)],
    ],
)
@pytest.mark.quick_cases(1)
def test_edges_ramps_and_textures(fps, L, hz):
    stimulus = stimuli.standard(fps, L=L, pixels=16, frames=5)
    agreement = agreement_with_ode(stimulus, *second_pole(hz))
    assert agreement.count_b > 20
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0
    assert agreement.mean_dt_us < 0.05


@pytest.mark.parametrize("hz", [300.0, 5000.0])
@pytest.mark.thorough
def test_dead_time_and_leak(hz):
    stimulus = stimuli.standard(24, L=10, pixels=16, frames=5)
    circuit, sections = second_pole(hz, dead_time_us=800.0, leak_hz=3.0, photo_leak_hz=6.0)
    sections["refractory"] = Refractory(period_us=800.0)
    sections["leak"] = Leak(rate_hz=3.0, photo_rate_hz=6.0, jitter=0.0)
    agreement = agreement_with_ode(stimulus, circuit, sections)
    assert agreement.count_b > 40
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0


@pytest.mark.parametrize(
    ("cutoff", "dark", "hz"),
    [
        (20.0, 1.0, 400.0), (3000.0, 200.0, 400.0), (300.0, 0.0, 400.0), (40_000.0, 20.0, 400.0),
        (10_000.0, 200.0, 10.0),
    ],
)  # fmt: skip
@pytest.mark.thorough
def test_whichever_pole_is_slower(cutoff, dark, hz):
    stimulus = stimuli.texture(pixels=16, frames=5, fps=30.0, L=10)
    circuit, sections = second_pole(hz, cutoff_hz=cutoff, dark_cutoff_hz=dark)
    sections["low_pass"] = LowPass(cutoff_hz=cutoff, dark_cutoff_hz=dark)
    agreement = agreement_with_ode(stimulus, circuit, sections)
    assert agreement.count_b > 8
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0


@pytest.mark.thorough
def test_flashes_and_light_beyond_white():
    draw = np.random.default_rng(4)
    dark = draw.uniform(1.0, 20.0, 30)
    light = np.array([dark * np.exp(draw.uniform(1.2, 4.5, 30) * (k % 2)) for k in range(5)])
    light = light.astype(np.float32).astype(float)
    assert light.max() > 600
    stimulus = stimuli.Stimulus(light, np.round(np.arange(5) / 100 * 1e9) * 1e-9)
    agreement = agreement_with_ode(stimulus, *second_pole(1000.0))
    assert agreement.count_b > 300
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0


def without(*names, **more):
    return {**{key: value for key, value in EVERYTHING.items() if key not in names}, **more}


CASES = {
    "two poles": without("photoreceptor_noise"),
    "no dead time": without("photoreceptor_noise", "refractory", refractory=None),
    "overshoot": without("photoreceptor_noise", reset_overshoot=ResetOvershoot(fraction=0.2)),
    "overshoot, one pole": without(
        *("photoreceptor_noise", "source_follower", "refractory"),
        refractory=None,
        reset_overshoot=ResetOvershoot(fraction=-0.2),
    ),
    "drift": without(
        "photoreceptor_noise",
        thresholds=Thresholds(on=0.2, off=0.25, mismatch=0.03, drift_per_s=2.0),
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("causes", [False, True])
@pytest.mark.thorough
def test_same_events_as_in_steps_of_time(name, causes):
    """With all noise of the pixel's own; a rest in the middle, and a recording of 0.2 s."""
    draw = np.random.default_rng(8)
    y, x = np.mgrid[:24, :40]
    light = [
        70 + 62 * np.sin(0.4 * (x - 1.3 * k)) * np.cos(0.2 * y) + draw.normal(0, 0.5, y.shape)
        for k in range(40)
    ]
    stack = np.clip(light, 0, 255).astype(np.float32)
    stack[10:25, :, 20:] = stack[10, :, 20:]
    times = [k * 5_000_000 + (k % 3) * 1_000 for k in range(len(stack))]
    found = []
    for method in ("auto", "stepped"):
        array = start(
            stack, times, Pixel(**CASES[name]), seed=3, method=method, exact_times=True,
            causes=causes,
        )  # fmt: skip
        events, exact = advance(array, stack, times)
        keys = (exact, events["y"], events["x"])
        found.append((by_pixel(array, events, exact), events[np.lexsort(keys)]))
    (ours, events), (steps, events_of_steps) = found
    agreement = count_and_time_errors(ours, steps)
    assert agreement.count_b > 4000
    assert not agreement.differing
    assert agreement.mean_dt_us < 0.05
    # where the signal creeps over a threshold, both solvers are off by more
    assert agreement.max_dt_us < 10.0
    apart = np.concatenate([abs(a - b)[:, 0] for a, b in zip(ours, steps, strict=True)])
    assert np.mean(apart > 1e-6) < 1e-3
    if causes:
        alike = np.array_equal(np.sort(events["cause"]), np.sort(events_of_steps["cause"]))
        differ = np.bincount(events["cause"], minlength=16) - np.bincount(
            events_of_steps["cause"], minlength=16
        )
        assert alike or np.abs(differ).sum() < 0.002 * len(events)


IN_LANES = {
    "noise": {
        "low_pass": LowPass(cutoff_hz=2200.0, dark_cutoff_hz=20.0),
        "source_follower": SourceFollower(cutoff_hz=100.0),
        "photoreceptor_noise": PhotoreceptorNoise(rms=0.05),
    },
    "noise behind one pole": {"photoreceptor_noise": PhotoreceptorNoise(rms=0.05)},
    "drift and leak": {
        "source_follower": SourceFollower(cutoff_hz=1000.0),
        "thresholds": Thresholds(on=0.1, off=0.12, mismatch=0.03, drift_per_s=20.0),
        "leak": Leak(rate_hz=20.0, photo_rate_hz=30.0, jitter=0.1),
    },
    "dead time": {
        "source_follower": SourceFollower(cutoff_hz=300.0),
        "refractory": Refractory(period_us=400.0),
        "photoreceptor_noise": PhotoreceptorNoise(rms=0.05),
    },
}


@pytest.mark.parametrize("name", IN_LANES)
def test_side_by_side_as_one_by_one(name):
    """With causes a pixel is solved by itself, with other bounds and another search for roots."""
    draw = np.random.default_rng(9)
    light = np.clip(90 + 60 * draw.normal(size=(6, 20, 60)), 1, 255).astype(np.float32)
    times = [k * 4_000_000 for k in range(len(light))]
    found = []
    for causes in (False, True):
        array = start(
            light, times, quiet(**IN_LANES[name]), seed=5, exact_times=True, causes=causes
        )
        events, exact = advance(array, light, times)
        found.append(by_pixel(array, events, exact))
    assert sum(len(one) for one in found[0]) > 5000
    for ours, theirs in zip(*found, strict=True):
        assert np.array_equal(ours[:, 1], theirs[:, 1])
        assert np.all(np.abs(ours[:, 0] - theirs[:, 0]) < 1e-9)  # s


def test_events_do_not_run_out_of_room():
    light = np.stack([np.full((48, 64), dn, np.float32) for dn in (2.0, 255.0, 2.0)])
    times = [0, 10_000_000, 20_000_000]
    pixel = quiet(
        source_follower=SourceFollower(cutoff_hz=1000.0),
        thresholds=Thresholds(on=0.01, off=0.01, mismatch=0),
    )
    whole, _ = advance(start(light, times, pixel), light, times)
    one, _ = advance(start(light[:, :1, :1], times, pixel), light[:, :1, :1], times)
    assert len(one) > 500
    assert len(whole) == len(one) * 48 * 64


def test_curves_reach_zero_where_dense_samples_do():
    draw = np.random.default_rng(1)
    t = np.linspace(0.0, 1.0, 20_001)
    reached = 0
    for _ in range(400):
        b = 10 ** draw.uniform(-1.0, 2.0)
        swing = draw.normal() * draw.integers(0, 2)
        one = curve.SignalCurve(*(draw.normal(size=6) * 0.4 ** np.arange(6)).tolist(), swing, b)
        start_at, end = np.sort(draw.uniform(0, 1, 2)).tolist()
        values = sum(c * t**k for k, c in enumerate(one[:6])) + swing * np.exp(-b * t)
        inside = (t >= start_at) & (t <= end)
        at = t[inside][values[inside] >= 0.0]
        ends = curve.at(one, start_at), curve.at(one, end)
        found = curve.first_reach(one, start_at, ends[0], end, ends[1])
        if at.size:
            reached += 1
            assert found <= at[0]
            # nothing above zero before, or a touch between two samples
            assert found >= at[0] - 1.01 * (t[1] - t[0]) or abs(curve.value(one, found)) < 1e-6
        elif found != curve.NOWHERE:
            assert abs(curve.value(one, found)) < 1e-6
        np.testing.assert_allclose(ends[1][0], np.interp(end, t, values), atol=1e-6 * (1 + b * b))
        room = curve.bent(one, ends[0][2]) * (end - start_at) ** 2 / 8 + 1e-9
        assert values[inside].max(initial=-9) <= max(ends[0][0], ends[1][0]) + room
        assert values[inside].min(initial=9) >= min(ends[0][0], ends[1][0]) - room
    assert reached > 100


@pytest.mark.parametrize("a", [0.05, 0.8])
@pytest.mark.parametrize("b", [1e-6, 1e-4, 0.009, 0.011, 0.3, 2.0, 40.0])
def test_lag_of_a_second_pole_slow_or_fast(a, b):
    """Behind an exponential lag of the first one, a in the substep, and a ramp: Gauss's rule."""
    d, q0, swing = 0.01, -0.06, 0.05
    u, slope, bend = (
        lambda t, k=k: (-a) ** k * swing * np.exp(-a * t) - (d / a if k == 0 else 0.0)
        for k in range(3)
    )
    found = curve.lag_curve(u(0), slope(0), bend(0), u(1), slope(1), bend(1), q0, d, b)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    for t in np.linspace(0.0, 1.0, 11):
        at = 0.5 * t * (nodes + 1.0)
        taken = (b * u(at) - d) * np.exp(-b * (t - at))
        expected = q0 * math.exp(-b * t) + 0.5 * t * (weights @ taken)
        assert curve.value(found, t) == pytest.approx(expected, abs=2e-7)


@pytest.mark.parametrize("b", [1e-3, 0.3, 2.0, 40.0, 3000.0])
def test_weights_of_the_second_pole(b):
    """A pole keeps a lag by e^-b, follows its input, and lags behind a ramp by (1 - e^-b)/b."""
    keep, *of_input, ramp = plan.weights_of(np.array([b]))[0]
    assert keep == pytest.approx(math.exp(-b), abs=1e-15)
    assert of_input[0] + of_input[3] == pytest.approx(1 - math.exp(-b), rel=1e-12)
    assert ramp == pytest.approx((1 - math.exp(-b)) / b, rel=1e-12)
    # its answer to t^5, whose value, slope and curvature at the end are 1, 5 and 20
    t = np.linspace(0.0, 1.0, 400_001)
    part = b * np.exp(-b * (1 - t)) * t**5
    expected = np.trapezoid(part, t)
    assert of_input[3] + 5 * of_input[4] + 20 * of_input[5] == pytest.approx(expected, rel=2e-5)
