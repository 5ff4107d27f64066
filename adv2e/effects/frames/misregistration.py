"""Misregistration: the picture in the frames lies beside the one that the event pixels see.

    DN(x, y) = DN_frame(x + dx, y + dy)

dx, dy      frames.shift_px: how far the picture in the frames lies to the right of, and below,
            where the event pixels see it [px]

Parts of a pixel are interpolated by quintic splines through the logarithm of the light, which is
what the pixel responds to.  Contrast moves as it is, and dark pixels beside bright ones stay above
zero.  Edges do not ring: between two pixels the logarithm goes no farther beyond theirs than a
parabola with four times the curvature that both of them have.  Light below 0.05 DN counts as 0.05
DN.  What lies beyond the outermost pixels is not known.  These are repeated, and half of the slope
there goes on where parts of a pixel are asked for.

References
----------
[1] M. Unser, A. Aldroubi, M. Eden, "B-spline signal processing: Part I - Theory", IEEE Transactions
    on Signal Processing 41(2), 1993, doi:10.1109/78.193220.
[2] A. Suresh, H. T. Huynh, "Accurate monotonicity-preserving schemes with Runge-Kutta time
    stepping", Journal of Computational Physics 136(1), 1997, doi:10.1006/jcph.1997.5745 (limits
    that leave peaks as they are).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, LightFrame

LABELS = {"misregistration": "shift of the frames"}
SEPARATED_BY = {
    "misregistration": "motion in two opposite directions: a shift stays, a delay turns round"
}

_LEAST_DN = 0.05
_REACH = 12
"""Pixels to each side that count: those beyond weigh less than 2e-5."""
_MORE_CURVATURE = 4.0


def _spline(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quintic B-spline at distances [px]."""
    powers = [np.maximum(edge - np.abs(distance), 0.0) ** 5 for edge in (3.0, 2.0, 1.0)]
    return np.asarray((powers[0] - 6.0 * powers[1] + 15.0 * powers[2]) / 120.0)


@lru_cache(maxsize=64)
def _weights(part: float) -> NDArray[np.float64]:
    """Return the weights of the pixels around, for a place `part` of a pixel after the middle one.

    The coefficients with which a spline goes through all pixels are their values, filtered by the
    inverse of the spline at whole distances; that filter is applied to the weights instead.
    """
    place = np.arange(-_REACH, _REACH + 1.0)
    through = _spline(place[:, None] - place)
    weights = np.linalg.solve(through, _spline(part - place))
    return np.asarray(weights / weights.sum())


def _continued(values: NDArray[Any], left: int, right: int) -> NDArray[Any]:
    """Return `values` (rows, columns) with columns more on both sides.

    Half of the slope at the border goes on for a pixel: with all of it, or none, errors are larger.
    """
    wide: NDArray[Any] = cv2.copyMakeBorder(values, 0, 0, left, right, cv2.BORDER_REPLICATE)
    slopes = np.diff(values, axis=1)
    if slopes.size:
        wide[:, :left] -= 0.5 * slopes[:, :1]
        wide[:, wide.shape[1] - right :] += 0.5 * slopes[:, -1:]
    return wide


def _between(values: NDArray[Any], part: float) -> NDArray[Any]:
    """Return `values` (rows, columns) taken `part` of a pixel to the right."""
    border = cv2.BORDER_REPLICATE
    found = cv2.sepFilter2D(values, -1, _weights(part), np.ones(1), borderType=border)
    around = cv2.copyMakeBorder(values, 0, 0, 1, 2, border)
    left, a, b, right = (around[:, k : around.shape[1] - 3 + k] for k in range(4))
    bends = left - 2 * a + b, a - 2 * b + right
    # the lesser of the two where they have the same sign, otherwise none
    bend = np.clip(bends[1], np.minimum(bends[0], 0), np.maximum(bends[0], 0))
    curved = a + part * (b - a) - 0.5 * part * (1.0 - part) * _MORE_CURVATURE * bend
    ends = np.minimum(a, b), np.maximum(a, b)
    return np.clip(found, np.minimum(ends[0], curved), np.maximum(ends[1], curved))


def _moved(values: NDArray[Any], by: float) -> NDArray[Any]:
    """Return `values` (rows, columns) taken `by` pixels further to the right."""
    count, whole = values.shape[1], math.floor(by)
    if by == whole:
        return values.take(np.clip(np.arange(count) + whole, 0, count - 1), axis=1)
    left, right = max(-whole, 0), max(whole + 1, 0)
    values = _between(_continued(values, left, right), by - whole)
    return values[:, left + whole : left + whole + count]


def shifted(light: NDArray[Any], shift_px: tuple[float, float]) -> NDArray[Any]:
    """Return the light at each pixel's place plus `shift_px`, (x, y)."""
    x, y = shift_px
    in_parts = x != math.floor(x) or y != math.floor(y)
    values = np.log(np.maximum(light, light.dtype.type(_LEAST_DN))) if in_parts else light
    values = _moved(np.ascontiguousarray(_moved(values, x).T), y).T
    return np.exp(values) if in_parts else np.ascontiguousarray(values)


class MisregistrationHooks(Hooks):
    """Moves the picture back by `shift_px`, (x, y)."""

    stage = "frames"

    def __init__(self, shift_px: tuple[float, float]) -> None:
        super().__init__()
        self._shift_px = shift_px

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        return t_ns, shifted(light, self._shift_px)
