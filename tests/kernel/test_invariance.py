"""The same bytes for any division of the work, and for the plain Python code."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from harness import EVERYTHING, IN_LANES, advance, effect, quiet, start

from adv2e.config.model import (
    HighPass,
    LowPass,
    Pixel,
    ResetOvershoot,
    SlewLimit,
    Thresholds,
)
from adv2e.effects.hooks import INJECTED_DTYPE
from adv2e.pixel import steps as stepping

FRAMES, ROWS, COLUMNS = 19, 48, 70
ALL = {
    **EVERYTHING,
    "slew_limit": SlewLimit(per_s=30.0),
    "high_pass": HighPass(cutoff_hz=3.0),
    "reset_overshoot": ResetOvershoot(fraction=0.2),
    "thresholds": Thresholds(on=0.2, off=0.25, mismatch=0.03, drift_per_s=2.0),
}

CASCADE = {
    name: section
    for name, section in ALL.items()
    if name not in ("photoreceptor_noise", "slew_limit", "high_pass")
}
"""Two poles, overshoot and drift."""


def clip():
    draw = np.random.default_rng(1)
    y, x = np.mgrid[:ROWS, :COLUMNS]
    light = [
        60 + 55 * np.sin(0.35 * (x - 1.3 * k)) * np.cos(0.2 * y) + draw.normal(0, 0.5, y.shape)
        for k in range(FRAMES)
    ]
    # float32, as decoded video is; the right half rests for a while
    stack = np.clip(light, 0, 255).astype(np.float32)
    stack[6:12, :, COLUMNS // 2 :] = stack[6, :, COLUMNS // 2 :]
    return stack


def added():
    shape = 1.0 + 0.3 * np.sin(np.arange(ROWS * COLUMNS)).reshape(ROWS, COLUMNS)

    def inject(t0, t1):
        k = np.arange(np.ceil(t0 / 1e-5), np.ceil(t1 / 1e-5)).astype(np.int64)
        k = k[(k * 1e-5 >= t0) & (k * 1e-5 < t1)]
        rows = np.zeros(k.size, INJECTED_DTYPE)
        rows["t"], rows["x"], rows["y"], rows["p"] = k * 1e-5, k * 31 % COLUMNS, k % ROWS, k % 2
        return rows

    def wide(t, rate):
        return np.sin(rate * t)[:, None, None] * shape

    return effect(
        (ROWS, COLUMNS),
        90.0,
        drive=lambda t: 0.2 * wide(t, 700),
        signal=lambda t: 0.1 * np.sin(1300 * t),
        thresholds=lambda t: (1 + 0.2 * wide(t, 300), np.ones(t.size)),
        inject=inject,
    )


CASES = {
    "exact": {},
    "in lanes": IN_LANES,
    "cascade": CASCADE,
    "all": ALL,
    "all and more": {**ALL, "hooks": [added()]},
    "Euler": {**IN_LANES, "low_pass": LowPass(update="euler")},
    "K steps and more": {
        **ALL, "low_pass": LowPass(update="first_order_hold"), "hooks": [added()]
    },
}  # fmt: skip


def times_ns(frames):
    return [k * 4_166_667 + (k % 3) * 1_000 for k in range(frames)]


def run(pixel, light, K=10, printed=False, **options):
    split = {k: options.pop(k) for k in ("chunk", "threads") if k in options}
    times = times_ns(len(light))
    array = start(light, times, pixel, K=K, seed=5, printed=printed, **options)
    return advance(array, light, times, L=3, printed=printed, **split)[0]


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.thorough
def test_tiles_chunks_and_threads_change_nothing(name, printed, monkeypatch):
    sections = dict(CASES[name])
    light, same = clip(), {"printed": printed, "hooks": sections.pop("hooks", ())}
    pixel = Pixel(**sections)
    whole = run(pixel, light, **same)
    assert len(whole) > 1000
    for options in ({"tile": 2048}, {"chunk": 1}, {"chunk": 4, "tile": 2048, "threads": 3}):
        split = np.sort(run(pixel, light, **same, **options), order=("t", "y", "x", "p"))
        assert np.sort(whole, order=("t", "y", "x", "p")).tobytes() == split.tobytes()
    # as few steps in memory at a time as can be
    monkeypatch.setattr(stepping, "_VALUES", 1)
    assert whole.tobytes() == run(pixel, light, **same).tobytes()


@pytest.mark.parametrize("sections", [{}, IN_LANES, CASCADE, EVERYTHING])
def test_exact_does_not_depend_on_K(sections):
    light = clip()
    assert run(Pixel(**sections), light, K=1).tobytes() == (
        run(Pixel(**sections), light, K=100).tobytes()
    )


def test_seed_decides_and_only_noise():
    light, times = clip(), times_ns(FRAMES)

    def events(pixel, seed):
        return advance(start(light, times, pixel, seed=seed), light, times)[0].tobytes()

    assert events(Pixel(), 1) == events(Pixel(), 1)
    assert events(Pixel(), 1) != events(Pixel(), 2)
    assert events(quiet(), 1) == events(quiet(), 2)


def test_noise_does_not_depend_on_other_effects():
    """Events of shot noise and hot pixels come at the same times whatever else is on."""
    light = np.full((9, 1, 64), 40.0, np.float32)
    noisy = {key: EVERYTHING[key] for key in ("shot_noise", "hot_pixels")}
    plain = run(quiet(**noisy), light)
    assert len(plain) > 20
    for more in (
        {"slew_limit": ALL["slew_limit"]},
        {"high_pass": ALL["high_pass"]},
        {"reset_overshoot": ResetOvershoot(fraction=0.0)},
    ):
        assert run(quiet(**{**noisy, **more}), light).tobytes() == plain.tobytes()


def test_events_do_not_run_out_of_room():
    """A burst of far more events than the buffers hold at first."""
    light = np.stack([np.full((64, 64), dn, np.float32) for dn in (2.0, 255.0, 2.0)])
    pixel = quiet(low_pass=None, thresholds=Thresholds(on=0.01, off=0.01, mismatch=0))
    times = [0, 10_000_000, 20_000_000]
    events, _ = advance(start(light, times, pixel), light, times)
    # 2 DN lies on the foot: x = 2 ln(20)/20; the last threshold of the way back is only approached
    up = int((np.log(255) - 2 * np.log(20) / 20) / 0.01)
    assert len(events) == (2 * up - 1) * 64 * 64


_PLAIN = """
import numpy as np, sys
sys.path[:0] = [{tests!r}, {tests!r} + "/kernel"]
from harness import EVERYTHING, IN_LANES, STEPPED_FORM, advance, effect, start
from test_invariance import ALL, CASCADE
from adv2e.config.model import Pixel, LowPass
draw = np.random.default_rng(2)
light = np.exp(draw.uniform(1, 5.5, (3, 3, 4))).astype(np.float32)
times = [0, 2_000_000, 4_000_000]
added = effect(
    (3, 4), drive=lambda t: 0.1 * np.sin(900 * t), thresholds=lambda t: (1 + 9 * t, 1 + 0 * t)
)
paper = LowPass(update="paper")
for sections, hooks in (
    ({{}}, ()), (IN_LANES, ()), (STEPPED_FORM, ()), (CASCADE, ()), (EVERYTHING, ()),
    (ALL, [added]), ({{**ALL, "low_pass": paper}}, [added]),
):
    array = start(light, times, Pixel(**sections), exact_times=True, hooks=hooks)
    events, exact = advance(array, light, times)
    print(len(events), *(f"{{t:.4f}}" for t in exact), *events["p"], *events["x"], *events["y"])
"""


@pytest.mark.thorough
def test_compiled_equals_plain_python():
    """Times agree to 5 ns: the compiled code may round a product and a sum once, in float32 too."""
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
    assert compiled.size > 200
    assert np.allclose(compiled, plain, rtol=0, atol=5e-3)
