"""Time of the pixel on a small clip, by setting; skipped unless asked for:

    python -m pytest tests/benchmarks -o addopts= --benchmark-only

For figures to quote see scripts/benchmarks/speed.py, which uses fresh processes and longer clips.
"""

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.synthetic import Scene

WIDTH, HEIGHT, FRAMES, FPS = 173, 130, 33, 240.0
QUIET = ["frames.encoding=linear", "sampling.L=1", "pixel.thresholds.mismatch=0"] + [
    f"pixel.{name}=null" for name in ("refractory", "leak", "shot_noise")
]
ALL = [
    "frames.encoding=linear",
    "sampling.L=1",
    "pixel.thresholds.mismatch=0.03",
    "pixel.refractory.period_us=500",
    "pixel.leak.rate_hz=0.1",
    "pixel.shot_noise.rate_hz=5",
]
SETTINGS = {
    "noise off": QUIET,
    "all effects": ALL,
    "mismatch": [*QUIET, "pixel.thresholds.mismatch=0.03"],
    "dead time": [*QUIET, "pixel.refractory.period_us=500"],
    "leak": [*QUIET, "pixel.leak.rate_hz=0.1"],
    "shot noise": [*QUIET, "pixel.shot_noise.rate_hz=5"],
    "photoreceptor noise": [*QUIET, "pixel.photoreceptor_noise.rms=0.03"],
    "second pole": [*QUIET, "pixel.source_follower.cutoff_hz=1000"],
    "first-order hold, K = 10": [*QUIET, "pixel.low_pass.update=first_order_hold"],
    "as printed, K = 10": [*QUIET, "pixel.low_pass.update=paper"],
}
SLOW = {"photoreceptor noise", "second pole"}


@pytest.fixture(scope="module")
def moving():
    """Frames from within the scene's fast part, 8-bit linear."""
    scene = Scene()
    light = [scene.light(0.3 + k / FPS, WIDTH, HEIGHT) for k in range(FRAMES)]
    return np.rint(np.stack(light)).astype(np.uint8)


def run(frames, config, threads=1):
    times = np.arange(len(frames)) / FPS
    return sum(len(part) for part in simulate(frames, times, config, threads=threads))


@pytest.mark.benchmark(group="pixel")
@pytest.mark.parametrize("name", SETTINGS)
def test_pixel(benchmark, moving, name):
    frames = moving[:9] if name in SLOW else moving
    config = load_config([], SETTINGS[name])
    benchmark.extra_info["pixel_frames"] = frames.size
    events = benchmark.pedantic(run, (frames, config), rounds=5, iterations=1, warmup_rounds=1)
    assert events > 0.01 * frames.size


@pytest.mark.benchmark(group="pixel at rest")
def test_pixel_at_rest(benchmark, moving):
    still = np.repeat(moving[:1], FRAMES, axis=0)
    config = load_config([], QUIET)
    assert benchmark.pedantic(run, (still, config), rounds=5, iterations=1, warmup_rounds=1) == 0


@pytest.mark.benchmark(group="pixel")
@pytest.mark.parametrize("threads", [1, 2])
def test_threads(benchmark, moving, threads):
    config = load_config([], ALL)
    events = benchmark.pedantic(
        run, (moving, config, threads), rounds=5, iterations=1, warmup_rounds=1
    )
    assert events > 0
