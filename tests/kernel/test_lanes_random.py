"""Random circuits and light: the pixels in lanes, and in fine steps of time."""

from __future__ import annotations

import numpy as np
import pytest
from harness import advance, by_pixel, quiet, start
from reference.agreement import count_and_time_errors

from adv2e.config.model import (
    HotPixels,
    Leak,
    LogResponse,
    LowPass,
    Refractory,
    ShotNoise,
    Thresholds,
)
from adv2e.pixel import steps
from adv2e.pixel.steps import steps_of

PIXELS = 96


def random_light(draw):
    """Light that wanders, in small steps or over e-folds, and rests for a while or does not."""
    knots = int(draw.integers(3, 14))
    steps = draw.normal(0.0, draw.choice([0.05, 0.3, 1.0, 2.0]), (knots, PIXELS))
    light = np.exp(np.cumsum(steps, 0)) * draw.choice([3.0, 20.0, 80.0])
    light = np.clip(light, draw.choice([0.0, 0.3, 2.0]), draw.choice([255.0, 400.0]))
    if draw.random() < 0.5:
        light[1 : knots // 2 + 1, : PIXELS // 2] = light[0, : PIXELS // 2]
    lengths = draw.choice([0.5e6, 2e6, 4.2e6, 40e6]) * draw.uniform(0.5, 1.5, knots - 1)
    return light.astype(np.float32), [0, *np.cumsum(np.rint(lengths)).astype(int).tolist()]


def random_sections(draw):
    """Parts of the pixel, each there or not."""
    sections = {
        "log_response": LogResponse(linear_below=float(draw.choice([0.0, 2.72, 20.0])), floor=0.1),
        "low_pass": LowPass(
            cutoff_hz=float(draw.choice([30.0, 300.0, 3000.0])),
            dark_cutoff_hz=float(draw.choice([5.0, 22.0])),
        ),
        "thresholds": Thresholds(
            on=float(draw.uniform(0.08, 0.5)), off=float(draw.uniform(0.08, 0.5)), mismatch=0.02
        ),
        "initial_reference": str(draw.choice(["settled", "random"])),
    }
    if draw.random() < 0.6:
        sections["refractory"] = Refractory(period_us=float(draw.choice([50.0, 800.0, 5000.0])))
    if draw.random() < 0.7:
        sections["leak"] = Leak(
            rate_hz=float(draw.choice([0.5, 20.0, 100.0])),
            photo_rate_hz=float(draw.choice([0.0, 30.0])),
            jitter=float(draw.choice([0.0, 0.1, 0.3])),
        )
    if draw.random() < 0.6:
        sections["shot_noise"] = ShotNoise(rate_hz=float(draw.choice([5.0, 300.0])))
    if draw.random() < 0.4:
        sections["hot_pixels"] = HotPixels(fraction=0.4, rate_hz=float(draw.choice([50.0, 800.0])))
    return sections


def events(light, times, pixel, seed, **options):
    array = start(light, times, pixel, seed=seed, exact_times=True, **options)
    return by_pixel(array, *advance(array, light, times))


@pytest.mark.parametrize("first", range(0, 60, 10))
@pytest.mark.quick_cases(1)
def test_in_lanes_as_in_steps_of_time(first, monkeypatch):
    count = 0
    for seed in range(first, first + 10):
        draw = np.random.default_rng(seed)
        light, times = random_light(draw)
        pixel = quiet(**random_sections(draw))
        in_lanes = events(light, times, pixel, seed)
        # a third of a step leaves a hundredth of its error
        with monkeypatch.context() as patch:
            patch.setattr(steps, "steps_of", lambda *given: 3 * steps_of(*given))
            in_steps = events(light, times, pixel, seed, method="stepped")
        found = count_and_time_errors(in_lanes, in_steps)
        assert not found.differing, seed
        assert found.max_dt_us < 1.0, seed
        count += found.count_b
    assert count > 1000
