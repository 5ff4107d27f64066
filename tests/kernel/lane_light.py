"""Light of a few pixels for the lanes, in single precision as they take it."""

from __future__ import annotations

import math

import numpy as np


def single(light):
    """Light as the kernel sees it: single precision, for both sides."""
    return np.asarray(light).astype(np.float32).astype(np.float64)


def walks(seed, knots, pixels, *, lo=21.0, hi=255.0, steps=(0.02, 0.3, 0.9), rest=0.2):
    """Light that wanders by small and large steps, rests, and returns to earlier values."""
    draw = np.random.default_rng(seed)
    x = np.empty((knots, pixels))
    x[0] = draw.uniform(math.log(lo), math.log(hi), pixels)
    for k in range(1, knots):
        step = draw.choice(steps, pixels) * draw.standard_normal(pixels)
        step[draw.random(pixels) < rest] = 0.0
        x[k] = np.clip(x[k - 1] + step, math.log(lo), math.log(hi))
        returns = draw.random(pixels) < 0.15
        x[k, returns] = x[draw.integers(0, k), returns]
    return single(np.exp(x))
