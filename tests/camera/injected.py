"""Events that come from no signal: shot noise and hot pixels, drawn for the whole recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camera.settings import Settings, find, section

FALL_AT_WHITE = 0.75
"""Share of the dark rate of shot noise that is gone at white."""


@dataclass(frozen=True)
class Candidates:
    """Noise events that happen unless the pixel is dead or the light forbids it; in time order.

    Attributes
    ----------
    time : (n,) float [s]
    pixel : (n,) int
    polarity : (n,) int, 1 or -1
    draw : (n,) float in 0..1
        Compared with ``1 - fall DN/255``.
    fall : (n,) float
    """

    time: NDArray[np.float64]
    pixel: NDArray[np.int64]
    polarity: NDArray[np.int64]
    draw: NDArray[np.float64]
    fall: NDArray[np.float64]


def shot_noise(
    rate_hz: float, pixels: int, duration_s: float, rng: np.random.Generator
) -> Candidates:
    r"""Draw Poisson events, half of them ON, at the rate R (1 - 0.75 DN/255) a pixel.

    Source: Hu, Liu, Delbruck, "v2e: From Video Frames to Realistic DVS Events", 2021.
    """
    count = rng.poisson(rate_hz * pixels * duration_s)
    return Candidates(
        rng.uniform(0.0, duration_s, count),
        rng.integers(0, pixels, count),
        rng.choice(np.array([1, -1]), count),
        rng.random(count),
        np.full(count, FALL_AT_WHITE),
    )


def hot_pixels(
    fraction: float, rate_hz: float, pixels: int, duration_s: float, rng: np.random.Generator
) -> Candidates:
    """Draw which pixels are hot, each with probability `fraction`, and their Poisson ON events.

    Source: Joubert et al., "Event camera simulator improvements via characterized parameters",
    2021.
    """
    hot = np.flatnonzero(rng.random(pixels) < fraction)
    count = rng.poisson(rate_hz * len(hot) * duration_s) if len(hot) else 0
    return Candidates(
        rng.uniform(0.0, duration_s, count),
        hot[rng.integers(0, max(len(hot), 1), count)] if count else np.zeros(0, np.int64),
        np.ones(count, np.int64),
        rng.random(count),
        np.zeros(count),
    )


def draw_candidates(
    settings: Settings,
    pixels: int,
    duration_s: float,
    rng: Callable[[str], np.random.Generator],
) -> Candidates:
    """Return all noise events that `settings` ask for, in time order."""
    rate = find(settings, "pixel.shot_noise.rate_hz", 0.0)
    parts = [shot_noise(rate, pixels, duration_s, rng("shot noise"))]
    hot = section(settings, "pixel.hot_pixels")
    if hot is not None:
        chosen = rng("hot pixels")
        parts.append(hot_pixels(hot["fraction"], hot["rate_hz"], pixels, duration_s, chosen))
    order = np.argsort(np.concatenate([part.time for part in parts]), kind="stable")
    columns = ("time", "pixel", "polarity", "draw", "fall")
    return Candidates(
        *(np.concatenate([getattr(part, name) for part in parts])[order] for name in columns)
    )


def dead_pixels(fraction: float, pixels: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw the pixels that never fire, each with probability `fraction`.

    Source: EMVA 1288 (defect pixels); 0 to 0.5 per cent is usual.
    """
    return np.flatnonzero(rng.random(pixels) < fraction)
