r"""Linear interpolation: the light of each pixel is linear in time between two frames.

.. math:: I_l = a + (b - a)\, l / L, \qquad l = 1 \dots L

A pixel that an edge passes makes one long slope of it, over the whole interval and at both ends of
the path at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.light.interpolation.sequence import NOTHING, Beside


def blend(a: NDArray[Any], difference: NDArray[Any], fraction: float) -> NDArray[Any]:
    """Return a + fraction difference, in one pass over memory.

    Where the difference is 0 this is `a` to the last bit, which (1 - w) a + w b is not: a pixel at
    rest must stay at rest.
    """
    blended: NDArray[Any] = cv2.scaleAdd(difference, fraction, a)
    return blended


def check_pair(a: NDArray[Any], b: NDArray[Any]) -> None:
    """Raise ValueError unless `a` and `b` are light frames of the same size and type."""
    if a.shape != b.shape or a.dtype != b.dtype:
        raise ValueError(f"two frames: {a.dtype} {a.shape} and {b.dtype} {b.shape}")
    if a.ndim != 2 or a.dtype not in (np.float32, np.float64):
        raise ValueError(f"light must be float32 or float64 (rows, columns): {a.dtype} {a.shape}")


class LinearUpsampler:
    """Makes `L` frames of each interval, linear in time."""

    def __init__(self, L: int) -> None:
        self.L = L

    def count(self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING) -> int:
        """Return `L`."""
        del a, b, beside
        return self.L

    def between(
        self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING
    ) -> Iterator[NDArray[Any]]:
        """Yield `L` frames, the last `b` itself; see :class:`.Upsampler`."""
        del beside  # a line through two points
        check_pair(a, b)
        difference = np.subtract(b, a)
        for step in range(1, self.L):
            yield blend(a, difference, step / self.L)
        yield b
