"""Classes by which residuals are told apart: rows, contrast, load of the sensor.

A place is a pixel in a frame interval.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import Placed, Scene

Array = NDArray[np.float64]

_MOST_ROWS = 48
_CONTRAST_S = 0.05
"""Time within which the change of log light counts as one contrast [s]."""
CONTRASTS: Array = 0.025 * 2.0 ** np.arange(9.0)
"""Borders of classes of contrast [ln]; beyond the first and last are counted with them."""


def row_borders(scene: Scene) -> Array:
    """Return the rows at which classes of rows begin, and the end."""
    classes = min(scene.height, _MOST_ROWS)
    return np.rint(np.linspace(0.0, scene.height, classes + 1))


def of_rows(scene: Scene, borders: Array) -> NDArray[np.int64]:
    """Return the class of each pixel by its row, (1, pixels)."""
    row = np.arange(scene.pixels) // scene.width
    return (np.searchsorted(borders, row, "right") - 1)[None]


def contrast(scene: Scene) -> NDArray[np.float32]:
    """Return the contrast [ln] that each place sees, (frame intervals, pixels).

    It is the range of its log light within 50 ms about the middle of the interval, or from one
    frame to the next where frames are as far apart.
    """
    seconds = scene.seconds.astype(np.float32)
    light = np.zeros((scene.intervals + 1, scene.pixels), np.float32)
    np.cumsum(scene.slope * seconds[:, None], axis=0, out=light[1:])
    beside = int(max(0.0, 0.5 * (_CONTRAST_S / float(np.median(seconds)) - 1.0)))
    high, low = light[1:].copy(), light[1:].copy()
    for step in range(-beside, beside + 2):
        frame = np.clip(np.arange(scene.intervals) + step, 0, scene.intervals)
        np.maximum(high, light[frame], out=high)
        np.minimum(low, light[frame], out=low)
    return high - low


def of_contrast(scene: Scene) -> NDArray[np.int64]:
    """Return the class of contrast of each place, (frame intervals, pixels)."""
    return np.digitize(contrast(scene), CONTRASTS[1:-1])


def rate_hz(scene: Scene, simulations: Sequence[Placed]) -> Array:
    """Return events a second on the whole sensor in each frame interval, mean of simulations."""
    numbers = [np.bincount(one.interval, minlength=scene.intervals) for one in simulations]
    return np.asarray(np.mean(numbers, axis=0) / scene.seconds)


def by_load(rate_hz: Array, steps: int) -> NDArray[np.int64]:
    """Return which of `steps` classes each frame interval is in, from few to many events.

    Parameters
    ----------
    rate_hz : (frame intervals,)
        Events a second that a model makes on the whole sensor.  Each class holds about as many
        events.
    steps : int
    """
    order = np.argsort(rate_hz, kind="stable")
    total = np.cumsum(rate_hz[order])
    step = np.empty(len(rate_hz), np.int64)
    step[order] = np.minimum(steps * total / max(total[-1], 1e-9), steps - 1e-9).astype(np.int64)
    return step
