r"""Misregistration: the picture in the frames lies beside the one that the event pixels see.

.. math:: DN(x, y) = DN_{frame}(x + d_x,\; y + d_y)

with (d_x, d_y) = ``frames.shift_px``, how far the picture in the frames lies to the right of, and
below, where the event pixels see it [px].  Parts of a pixel are interpolated by cubic convolution
(Keys), held between the two neighbours so that dark pixels beside bright ones stay above zero;
beyond the edge the outermost pixels are repeated.

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


def shifted(light: NDArray[Any], by: float, axis: int) -> NDArray[Any]:
    """Return `light` (rows, columns) taken `by` pixels further along `axis`."""
    count = light.shape[axis]
    whole = math.floor(by)
    f = by - whole

    def taken(step: int) -> NDArray[Any]:
        where = np.clip(np.arange(count) + whole + step, 0, count - 1)
        return light.take(where, axis)

    if f == 0.0:
        return taken(0)
    # in the type of the light: a Python float keeps float32
    weights = (
        f * (-0.5 + f * (1.0 - 0.5 * f)),
        1.0 + f * f * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2.0 - 1.5 * f)),
        f * f * (-0.5 + 0.5 * f),
    )
    near = taken(0), taken(1)
    value = weights[0] * taken(-1) + weights[1] * near[0]
    value += weights[2] * near[1] + weights[3] * taken(2)
    return np.clip(value, np.minimum(*near), np.maximum(*near))


class MisregistrationHooks(Hooks):
    """Moves the picture back by `shift_px`, (x, y)."""

    stage = "frames"

    def __init__(self, shift_px: tuple[float, float]) -> None:
        super().__init__()
        self._x, self._y = shift_px

    def light(self, frames: Frames) -> Frames:
        """Yield the frames where the event pixels see them."""
        for t_ns, light in frames:
            yield t_ns, shifted(shifted(light, self._y, 0), self._x, 1)
