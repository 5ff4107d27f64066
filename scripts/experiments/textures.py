"""Clips of textures that move by smooth homographies: the light is exact at any frame rate.

Textures are the photographs that scikit-image brings along, in linear light.  Each is taken for the
coefficients of a cubic B-spline, so that the light is twice differentiable in place and time and
never outside the range of the photograph; beyond its edges it is mirrored.  The view shifts, turns,
grows and tilts, each as the sum of two slow waves.
"""

from __future__ import annotations

import importlib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import MissingExtraError
from experiments.simulators.clip import Clip

NAMES = (
    "astronaut", "brick", "camera", "chelsea", "coffee", "coins", "grass", "gravel",
    "immunohistochemistry", "moon", "page", "retina", "rocket",
)  # fmt: skip
"""Photographs whose files are inside the package: nothing is downloaded."""
SPEEDS = 15.0, 150.0
"""Largest speed of the shift of a clip [pixels/s], drawn evenly in the logarithm."""
SCALES = 0.7, 1.6
"""Pixels of the photograph to one of the clip, drawn in the same way."""
HZ = 240


@lru_cache(maxsize=len(NAMES))
def photograph(name: str) -> NDArray[np.float32]:
    """Return the light [DN of 255] of a photograph, (rows, columns).

    Raises
    ------
    MissingExtraError
        scikit-image is not installed.
    """
    image = getattr(_late("skimage.data"), name)()
    return LightDecoder("srgb", 255.0, image.dtype, image.ndim == 3).decode(image)


def _late(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError("textures", "experiments") from error


def moving(seed: int, frames: int, size: tuple[int, int], hz: float = HZ) -> Clip:
    """Return the clip of a seed.

    Parameters
    ----------
    seed : int
        Decides photograph, place, and way.
    frames : int
    size : (int, int)
        Columns and rows.
    hz : float
        Frames a second.
    """
    rng = np.random.default_rng([seed, 41])
    light = photograph(NAMES[rng.integers(len(NAMES))])
    speed, scale = (np.exp(rng.uniform(*np.log(span))) for span in (SPEEDS, SCALES))
    times = np.arange(frames) / hz
    # waves of 0.4 to 2 s; the amplitude that gives the speed
    waves = rng.uniform(0.4, 2.0, (6, 2)), rng.uniform(0, 2 * np.pi, (6, 2))
    pace = 2 * np.pi / waves[0]
    ways = np.sin(pace * times[:, None, None] + waves[1]).transpose(1, 2, 0)
    reach = np.array([speed, speed, 0.5, 0.15, 0.05, 0.05])[:, None] / pace / 2
    shift_x, shift_y, turn, grow, tilt_x, tilt_y = (reach[..., None] * ways).sum(1)
    centre = rng.uniform(0.25, 0.75, 2) * light.shape
    columns, rows = size
    x = (np.arange(columns) - (columns - 1) / 2)[None]
    y = (np.arange(rows) - (rows - 1) / 2)[:, None]
    spline = _late("scipy.ndimage").map_coordinates
    made = np.empty((frames, rows, columns), np.float32)
    for k in range(frames):
        away = 1 + (tilt_x[k] * x + tilt_y[k] * y) / max(size)
        factor = scale * np.exp(grow[k]) / away
        cos, sin = np.cos(turn[k]), np.sin(turn[k])
        at_x = centre[1] + factor * (cos * x - sin * y) + scale * shift_x[k]
        at_y = centre[0] + factor * (sin * x + cos * y) + scale * shift_y[k]
        spline(light, (at_y, at_x), made[k], order=3, mode="mirror", prefilter=False)
    return Clip(made, np.rint(1e9 * times).astype(np.int64))
