"""The same bytes for any division of the work, and for the plain Python code."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from harness import EVERYTHING, IN_LANES, STEPPED_FORM, advance, quiet, start

from adv2e.config.model import LowPass, Pixel, Thresholds


def clip(frames=19, rows=48, columns=70, seed=1):
    draw = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns]
    light = [
        60 + 55 * np.sin(0.35 * (x - 1.3 * k)) * np.cos(0.2 * y) + draw.normal(0, 0.5, y.shape)
        for k in range(frames)
    ]
    # float32, as decoded video is; the right half rests for a while
    stack = np.clip(light, 0, 255).astype(np.float32)
    stack[6:12, :, columns // 2 :] = stack[6, :, columns // 2 :]
    return stack


def times_ns(frames):
    return [k * 4_166_667 + (k % 3) * 1_000 for k in range(frames)]


def run(pixel, light, K=10, printed=False, **options):
    split = {k: options.pop(k) for k in ("chunk", "threads") if k in options}
    times = times_ns(len(light))
    array = start(light, times, pixel, K=K, seed=5, printed=printed, **options)
    return advance(array, light, times, L=3, printed=printed, **split)[0]


@pytest.mark.parametrize(
    "sections", [{}, IN_LANES, STEPPED_FORM, EVERYTHING, {"low_pass": LowPass(update="euler")}]
)
@pytest.mark.parametrize("printed", [False, True])
def test_tiles_chunks_and_threads_change_nothing(sections, printed):
    light = clip()
    pixel = Pixel(**sections)
    whole = run(pixel, light, printed=printed)
    assert len(whole) > 1000
    for options in ({"tile": 1024}, {"chunk": 1}, {"chunk": 4, "tile": 1024, "threads": 3}):
        split = run(pixel, light, printed=printed, **options)
        split = np.sort(split, order=("t", "y", "x", "p"))
        assert whole.tobytes() == split.tobytes()


@pytest.mark.parametrize("sections", [{}, IN_LANES, EVERYTHING])
def test_exact_does_not_depend_on_K(sections):
    light = clip()
    assert run(Pixel(**sections), light, K=1).tobytes() == (
        run(Pixel(**sections), light, K=100).tobytes()
    )


def test_seed_decides_and_only_noise():
    light, times = clip(), times_ns(19)

    def events(pixel, seed):
        return advance(start(light, times, pixel, seed=seed), light, times)[0].tobytes()

    assert events(Pixel(), 1) == events(Pixel(), 1)
    assert events(Pixel(), 1) != events(Pixel(), 2)
    assert events(quiet(), 1) == events(quiet(), 2)


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
sys.path.insert(0, {tests!r})
from harness import EVERYTHING, IN_LANES, STEPPED_FORM, advance, start
from adv2e.config.model import Pixel, LowPass
draw = np.random.default_rng(2)
light = np.exp(draw.uniform(1, 5.5, (3, 3, 4))).astype(np.float32)
times = [0, 2_000_000, 4_000_000]
steps = {{"low_pass": LowPass(update="paper")}}
for sections in ({{}}, IN_LANES, STEPPED_FORM, EVERYTHING, steps):
    events, exact = advance(start(light, times, Pixel(**sections), exact_times=True), light, times)
    print(len(events), *(f"{{t:.4f}}" for t in exact), *events["p"], *events["x"], *events["y"])
"""


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
