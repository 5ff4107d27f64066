"""Factors on the light between frames, beside frames that have them."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.effects.hooks import Hooks

QUIET = (
    "frames.full_scale=255", "sampling.L=1", "pixel.thresholds.mismatch=0", "pixel.shot_noise=null",
    "pixel.leak={rate_hz: 2, photo_rate_hz: 8}",
)  # fmt: skip
LEVELS = np.array([[2.0, 8.0, 30.0, 120.0]])


class Factor(Hooks):
    step_us = 50.0

    def __init__(self, course):
        super().__init__()
        self._course = course

    def gain(self, times_s):
        return self._course(times_s)


def by_pixel(frames, times, *sets, effects=()):
    config = load_config([], [*QUIET, *sets])
    events = np.concatenate(list(simulate(frames, times, config, effects=effects, threads=1)))
    return [events[events["x"] == x] for x in range(LEVELS.shape[1])]


def swing(t):
    return 1.0 + 0.5 * np.sin(2 * np.pi * 40.0 * np.asarray(t))


@pytest.mark.parametrize("knee", [0, 20])
@pytest.mark.parametrize("low_pass", ["{cutoff_hz: 300, dark_cutoff_hz: 20}", "null"])
@pytest.mark.quick_cases(1)
def test_a_swing_is_that_of_frames_taken_very_often(knee, low_pass):
    sets = f"pixel.log_response.linear_below={knee}", f"pixel.low_pass={low_pass}"
    fine, coarse = np.arange(4001) / 20_000, np.arange(101) / 500
    slow = [LEVELS * np.exp(0.6 * np.sin(9.0 * t)) for t in coarse]
    # as x is linear between the frames, so it has to be between the fine ones
    levels = np.array(slow)[:, 0]
    logs = (
        np.log(levels)
        if knee == 0
        else np.where(levels < knee, levels * np.log(knee) / knee, np.log(np.maximum(levels, knee)))
    )
    logs = np.stack([np.interp(fine, coarse, logs[:, k]) for k in range(4)], axis=1)
    light = (
        np.exp(logs)
        if knee == 0
        else np.where(logs < np.log(knee), logs * knee / np.log(knee), np.exp(logs))
    )
    wanted = by_pixel((light * swing(fine)[:, None])[:, None, :], fine, *sets)
    found = by_pixel(slow, coarse, *sets, effects=[Factor(swing)])
    without = by_pixel(slow, coarse, *sets)
    assert sum(map(len, wanted)) > 3 * sum(map(len, without))
    for a, b in zip(found, wanted, strict=True):
        assert len(a) == len(b)
        assert np.array_equal(a["p"], b["p"])
        late = np.abs(a["t"] - b["t"])
        assert np.median(late) <= 3
        assert np.quantile(late, 0.9) <= 20


def test_a_constant_factor_is_that_on_the_frames():
    times = np.arange(41) / 500
    frames = [LEVELS * np.exp(1.2 * np.sin(60.0 * t)) for t in times]
    for factor in (0.25, 3.0):
        sets = ("pixel.log_response.linear_below=0",)
        found = by_pixel(frames, times, *sets, effects=[Factor(lambda t, f=factor: f + 0 * t)])
        wanted = by_pixel([factor * frame for frame in frames], times, *sets)
        for a, b in zip(found, wanted, strict=True):
            assert len(a) == len(b) > 0
            assert np.abs(a["t"] - b["t"]).max() <= 1
