"""What must hold of any stimulus."""

import numpy as np
from harness import QUIET, advance, by_pixel, effect, quiet, solve, start
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.config.model import (
    LogResponse,
    LowPass,
    Pixel,
    Refractory,
    ResetOvershoot,
    SlewLimit,
    Thresholds,
)
from adv2e.kernel import per_pixel

LIGHTS = st.lists(st.floats(0.0, 255.0, width=32), min_size=2, max_size=8)
MANY = st.lists(
    st.lists(st.floats(0.0, 255.0, width=32), min_size=3, max_size=3), min_size=2, max_size=6
)
INTERVAL_NS = 4_166_667


def stimulus(values):
    light = np.array(values, np.float32)[:, None]
    return light, [k * INTERVAL_NS for k in range(len(values))]


@settings(max_examples=150, deadline=None)
@given(LIGHTS, st.floats(0.05, 0.5), st.floats(0.05, 0.5))
def test_the_reference_is_the_sum_of_the_events(values, on, off):
    light, times = stimulus(values)
    pixel = quiet(thresholds=Thresholds(on=on, off=off, mismatch=0))
    array = start(light, times, pixel)
    before = array.state[per_pixel.REFERENCE, 0]
    events, _ = advance(array, light, times)
    up = int(events["p"].sum())
    moved = up * on - (len(events) - up) * off
    assert abs(array.state[per_pixel.REFERENCE, 0] - before - moved) < 1e-9
    distance = (
        array.state[per_pixel.X, 0]
        + array.state[per_pixel.LAG, 0]
        - array.state[per_pixel.REFERENCE, 0]
    )
    assert -off - 2e-9 < distance < on + 2e-9
    assert np.all(np.diff(events["t"]) >= 0)
    assert np.all((events["t"] >= 0) & (events["t"] <= times[-1] // 1000 + 1))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(2.0, 250.0), min_size=2, max_size=8), st.floats(0.1, 0.5))
def test_mirrored_light_mirrors_polarities(values, level):
    """At a corner that does not follow the light, ln(light) -> -ln(light) swaps ON and OFF."""
    light, times = stimulus(values)
    mirrored = (500.0 / light.astype(np.float64)).astype(np.float64)
    circuit = {
        "log_response": LogResponse(linear_below=0),
        "low_pass": LowPass(cutoff_hz=90.0, dark_cutoff_hz=90.0),
    }
    one = quiet(thresholds=Thresholds(on=level, off=0.17, mismatch=0), **circuit)
    other = quiet(thresholds=Thresholds(on=0.17, off=level, mismatch=0), **circuit)
    seconds = [t * 1e-9 for t in times]
    a = solve(light.astype(np.float64), seconds, one)[0]
    b = solve(mirrored, seconds, other)[0]
    assert np.array_equal(a[:, 1], -b[:, 1])
    # where the lag creeps over the level, its single precision is some 10 ns
    assert np.allclose(a[:, 0], b[:, 0], rtol=0, atol=1e-7)


def test_more_light_everywhere_changes_nothing_but_the_corner():
    """A gain is a constant under the logarithm: with a fixed corner, the events stay."""
    rng = np.random.default_rng(0)
    light = rng.uniform(5, 60, (9, 40))
    times = [k * INTERVAL_NS for k in range(9)]
    pixel = quiet(
        log_response=LogResponse(linear_below=0),
        low_pass=LowPass(cutoff_hz=90.0, dark_cutoff_hz=90.0),
    )
    found = []
    for gain in (1.0, 4.0):
        array = start(gain * light, times, pixel, exact_times=True)
        found.append(by_pixel(array, *advance(array, gain * light, times)))
    for a, b in zip(*found, strict=True):
        assert np.array_equal(a[:, 1], b[:, 1])
        assert np.allclose(a[:, 0], b[:, 0], rtol=0, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    light=MANY,
    fraction=st.floats(-0.9, 0.9),
    slew=st.floats(1.0, 500.0),
    drift=st.floats(-5.0, 20.0),
    dead_us=st.none() | st.floats(1.0, 5000.0),
)
def test_whatever_the_light_events_are_in_order_and_apart(light, fraction, slew, drift, dead_us):
    sections = {
        "reset_overshoot": ResetOvershoot(fraction=fraction),
        "slew_limit": SlewLimit(per_s=slew),
        "thresholds": Thresholds(mismatch=0.0, drift_per_s=drift),
        "refractory": Refractory(period_us=dead_us) if dead_us else None,
    }
    times = np.arange(len(light)) * 0.01
    span = 1e6 * times[-1]
    for events in solve(np.array(light), times, Pixel(**{**QUIET, **sections})):
        t = 1e6 * events[:, 0]
        assert np.all((t >= 0) & (t <= span + 1e-6))
        assert np.all(np.diff(t) >= (dead_us or 0.0) - 1e-6)


@settings(max_examples=40, deadline=None)
@given(light=MANY, offset=st.floats(-3.0, 3.0))
def test_a_constant_added_to_the_signal_changes_nothing(light, offset):
    times = np.arange(len(light)) * 0.01
    added = effect((1, 3), 1e3, signal=lambda t: np.full(t.shape, offset))
    plain = solve(np.array(light), times, quiet(), method="stepped")
    found = solve(np.array(light), times, quiet(), hooks=[added])
    for a, b in zip(found, plain, strict=True):
        assert np.array_equal(a[:, 1], b[:, 1])
        # where the signal hardly moves, rounding shows
        np.testing.assert_allclose(a[:, 0], b[:, 0], atol=1e-6)
