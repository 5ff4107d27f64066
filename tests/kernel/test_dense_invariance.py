"""The stepping path: the same bytes for any division of the work, and what must always hold."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from harness import EVERYTHING, QUIET, advance, quiet, solve, start
from hypothesis import example, given, settings
from hypothesis import strategies as st

from adv2e.config.model import (
    LowPass,
    Pixel,
    Refractory,
    ResetOvershoot,
    SlewLimit,
    Thresholds,
)
from adv2e.effects.courses import INJECTED_DTYPE, Additions
from adv2e.pixel import steps as stepping

FRAMES, ROWS, COLUMNS = 13, 40, 70
NEW = {
    "slew_limit": SlewLimit(per_s=30.0),
    "reset_overshoot": ResetOvershoot(fraction=0.2),
    "thresholds": Thresholds(on=0.2, off=0.25, mismatch=0.03, drift_per_s=2.0),
}


def clip():
    draw = np.random.default_rng(1)
    y, x = np.mgrid[:ROWS, :COLUMNS]
    light = [
        60 + 55 * np.sin(0.35 * (x - 1.3 * k)) * np.cos(0.2 * y) + draw.normal(0, 0.5, y.shape)
        for k in range(FRAMES)
    ]
    return np.clip(light, 0, 255).astype(np.float32)


def additions():
    shape = 1.0 + 0.3 * np.sin(np.arange(ROWS * COLUMNS))

    def inject(t0, t1):
        k = np.arange(np.ceil(t0 / 1e-5), np.ceil(t1 / 1e-5)).astype(np.int64)
        k = k[(k * 1e-5 >= t0) & (k * 1e-5 < t1)]
        rows = np.zeros(k.size, INJECTED_DTYPE)
        rows["t"], rows["x"], rows["y"], rows["p"] = k * 1e-5, k * 31 % COLUMNS, k % ROWS, k % 2
        return rows

    return Additions(
        longest_step_us=lambda a, b: 90.0,
        drive=lambda t: 0.2 * np.sin(700 * t)[:, None] * shape,
        signal=lambda t: 0.1 * np.sin(1300 * t),
        on=lambda t: 1 + 0.2 * np.sin(300 * t)[:, None] * shape,
        inject=inject,
    )


CASES = {
    "as today": ({}, None),
    "everything": ({**EVERYTHING, **NEW}, None),
    "with additions": ({**EVERYTHING, **NEW}, additions()),
    "stepped": ({**NEW, "low_pass": LowPass(update="first_order_hold")}, additions()),
}


def run(pixel, light, printed=False, **options):
    split = {k: options.pop(k) for k in ("chunk", "threads") if k in options}
    times = [k * 4_166_667 + (k % 3) * 1_000 for k in range(len(light))]
    array = start(light, times, pixel, seed=5, printed=printed, method="stepped", **options)
    events = advance(array, light, times, L=3, printed=printed, **split)[0]
    return np.sort(events, order=("t", "y", "x", "p"))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("printed", [False, True])
def test_tiles_chunks_and_threads_change_nothing(name, printed, monkeypatch):
    sections, added = CASES[name]
    light, pixel = clip(), Pixel(**sections)
    whole = run(pixel, light, printed=printed, additions=added)
    assert len(whole) > 1000
    for options in ({"tile": 2048}, {"chunk": 1}, {"chunk": 4, "tile": 2048, "threads": 3}):
        split = run(pixel, light, printed=printed, additions=added, **options)
        assert whole.tobytes() == split.tobytes()
    # as few steps in memory at a time as can be
    monkeypatch.setattr(stepping, "_VALUES", 1)
    split = run(pixel, light, printed=printed, additions=added)
    assert whole.tobytes() == split.tobytes()


def test_noise_does_not_depend_on_other_effects():
    """Events of shot noise and hot pixels come at the same times whatever else is on."""
    light = np.full((9, 1, 64), 40.0, np.float32)
    noisy = {key: EVERYTHING[key] for key in ("shot_noise", "hot_pixels")}
    plain = run(quiet(**noisy), light)
    assert len(plain) > 20
    for more in (
        {"slew_limit": NEW["slew_limit"]},
        {"reset_overshoot": ResetOvershoot(fraction=0.0)},
    ):
        assert run(quiet(**{**noisy, **more}), light).tobytes() == plain.tobytes()


_PLAIN = """
import numpy as np, sys
sys.path[:0] = [{tests!r}, {tests!r} + "/kernel"]
from harness import EVERYTHING, advance, start
from test_dense_invariance import NEW
from adv2e.effects.courses import Additions
from adv2e.config.model import Pixel, LowPass
draw = np.random.default_rng(2)
light = np.exp(draw.uniform(1, 5.5, (3, 3, 4))).astype(np.float32)
times = [0, 2_000_000, 4_000_000]
added = Additions(
    longest_step_us=lambda a, b: 100.0,
    drive=lambda t: 0.1 * np.sin(900 * t),
    on=lambda t: 1 + 9 * t,
)
everything = {{**EVERYTHING, **NEW}}
for sections, additions in (
    ({{}}, None), (everything, None), (everything, added),
    ({{**NEW, "low_pass": LowPass(update="paper")}}, added),
):
    array = start(
        light, times, Pixel(**sections), exact_times=True, method="stepped", additions=additions
    )
    events, exact = advance(array, light, times)
    print(len(events), *(f"{{t:.4f}}" for t in exact), *events["p"], *events["x"], *events["y"])
"""


def test_compiled_equals_plain_python():
    script = _PLAIN.format(tests=str(Path(__file__).resolve().parents[1]))
    outcome = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", script],
            env={**os.environ, **extra},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for extra in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    compiled, plain = (np.array(words, float) for words in outcome)
    assert compiled.size > 100
    assert np.allclose(compiled, plain, rtol=0, atol=1e-3)


lights = st.lists(
    st.lists(st.floats(0.0, 255.0, width=32), min_size=3, max_size=3), min_size=2, max_size=6
)


@settings(max_examples=60, deadline=None)
@given(
    light=lights,
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


@settings(max_examples=60, deadline=None)
@given(light=lights, slew=st.floats(5.0, 200.0), threshold=st.floats(0.05, 0.5))
@example(  # ends its ramp within a step, just before an event
    light=[[255.0, 0, 0], [71.0, 0, 0], [208.0, 0, 0], [8.0, 0, 0]], slew=90.0, threshold=0.19140625
)
def test_slew_limit_keeps_events_apart(light, slew, threshold):
    """No two events of one polarity are nearer than the limit allows, but for 1 us."""
    times = np.arange(len(light)) * 0.01
    pixel = quiet(
        slew_limit=SlewLimit(per_s=slew),
        thresholds=Thresholds(on=threshold, off=threshold, mismatch=0.0),
    )
    for events in solve(np.array(light), times, pixel):
        passed = threshold * np.cumsum(events[:, 1])
        assert np.all(np.abs(passed) <= slew * (events[:, 0] + 1e-6))
        gaps, moved = np.diff(events[:, 0]), np.abs(np.diff(passed))
        same = events[1:, 1] == events[:-1, 1]
        assert np.all(moved[same] <= slew * (gaps[same] + 1e-6))


@settings(max_examples=40, deadline=None)
@given(light=lights, offset=st.floats(-3.0, 3.0))
def test_a_constant_added_to_the_signal_changes_nothing(light, offset):
    times = np.arange(len(light)) * 0.01
    added = Additions(longest_step_us=lambda a, b: 1e3, signal=lambda t: np.full(t.shape, offset))
    plain = solve(np.array(light), times, quiet(), method="stepped")
    found = solve(np.array(light), times, quiet(), additions=added)
    for a, b in zip(found, plain, strict=True):
        assert np.array_equal(a[:, 1], b[:, 1])
        # where the signal hardly moves, rounding shows
        np.testing.assert_allclose(a[:, 0], b[:, 0], atol=1e-6)
