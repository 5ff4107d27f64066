r"""Misregistration: the picture in the frames lies beside the one that the event pixels see.

.. math:: DN(x, y) = DN_{frame}(x + d_x,\; y + d_y)

with (d_x, d_y) = ``frames.shift_px``, how far the picture in the frames lies to the right of, and
below, where the event pixels see it [px].  Parts of a pixel are interpolated by the six-point cubic
convolution of Keys (of fourth order) on the logarithm of the light, which is what the pixel
responds to: contrast moves as it is, and dark pixels beside bright ones stay above zero.  Light
below 0.05 DN counts as that.  Beyond the edge the outermost pixels are repeated.

References
----------
.. [1] R. Keys, "Cubic convolution interpolation for digital image processing", IEEE TASSP 29(6),
   1981, doi:10.1109/TASSP.1981.1163711.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Frames, Hooks

_LEAST_DN = 0.05


def _weight(distance: float) -> float:
    """Return the weight of a pixel at a distance [px]."""
    d = abs(distance)
    if d < 1.0:
        return 1.0 + d * d * (4.0 / 3.0 * d - 7.0 / 3.0)
    if d < 2.0:
        return 2.5 + d * (-59.0 / 12.0 + d * (3.0 - 7.0 / 12.0 * d))
    return -1.5 + d * (1.75 + d * (-2.0 / 3.0 + d / 12.0)) if d < 3.0 else 0.0


def _moved(values: NDArray[Any], by: float, axis: int) -> NDArray[Any]:
    """Return `values` (rows, columns) taken `by` pixels further along `axis`."""
    count = values.shape[axis]
    whole = math.floor(by)
    part = by - whole
    total = np.zeros_like(values)
    for step in range(-2, 4) if part else (0,):
        where = np.clip(np.arange(count) + whole + step, 0, count - 1)
        # a Python float keeps float32
        total += _weight(part - step) * values.take(where, axis)
    return total


def shifted(light: NDArray[Any], shift_px: tuple[float, float]) -> NDArray[Any]:
    """Return the light at each pixel's place plus `shift_px`, (x, y)."""
    x, y = shift_px
    if x == math.floor(x) and y == math.floor(y):
        return _moved(_moved(light, y, 0), x, 1)
    logarithm = np.log(np.maximum(light, light.dtype.type(_LEAST_DN)))
    return np.asarray(np.exp(_moved(_moved(logarithm, y, 0), x, 1)))


class MisregistrationHooks(Hooks):
    """Moves the picture back by `shift_px`, (x, y)."""

    stage = "frames"

    def __init__(self, shift_px: tuple[float, float]) -> None:
        super().__init__()
        self._shift_px = shift_px

    def light(self, frames: Frames) -> Frames:
        """Yield the frames where the event pixels see them."""
        for t_ns, light in frames:
            yield t_ns, shifted(light, self._shift_px)
