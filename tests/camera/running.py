"""Where in its leak cycle each pixel is when the recording begins: the camera has run before."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CYCLES = 20
"""How long the camera has run, in cycles: as many forget how the first began."""


class Running(NamedTuple):
    """What leak has done since the last event of each pixel, both (pixels,).

    fallen: of the reference, in ON thresholds; speed: of the leak in this cycle, relative to the
    nominal one.
    """

    fallen: Array
    speed: Array


def run_before(
    leak_hz: Array, noise_hz: Array, way: Array, dead_s: float, jitter: float,
    rng: np.random.Generator,
) -> Running:  # fmt: skip
    """Go through the cycles of all pixels until the recording begins, on constant light.

    Parameters
    ----------
    leak_hz : (pixels,)
        Events of each pixel by leak alone, at nominal speed; not zero.
    noise_hz : (pixels,)
        Those that come between, and begin a cycle too.
    way : (pixels,)
        How far the reference falls in a cycle, in ON thresholds.
    dead_s : float
    jitter : float
    """
    pixels = len(leak_hz)
    speed, age, fallen = np.ones(pixels), np.zeros(pixels), np.zeros(pixels)
    nominal = way / leak_hz
    noise_s = 1.0 / np.maximum(noise_hz, 1e-12)
    mean = dead_s - noise_s * np.expm1(-nominal / noise_s)
    begun = -(_CYCLES + rng.random(pixels)) * mean
    going = np.arange(pixels)
    while len(going):
        g = np.clip(rng.standard_normal(len(going)), -3.0, 3.0)
        slow = 1.0 + jitter * g
        period = nominal[going] * slow
        noise = noise_s[going] * rng.exponential(size=len(going))
        end = begun[going] + dead_s + np.minimum(period, noise)
        here = end >= 0.0
        under_way = going[here]
        age = np.maximum(-begun[under_way] - dead_s, 0.0)
        speed[under_way] = 1.0 / slow[here]
        fallen[under_way] = way[under_way] * age / period[here]
        begun[going] = end
        going = going[~here]
    return Running(fallen, speed)
