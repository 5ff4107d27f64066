"""Luma and two chromas to colours: with the matrix and the range of the pictures.

Each chroma sample stands for all the pixels that it covers.

References
----------
.. [1] ITU-T H.273 (07/2021), 8.3 (matrix coefficients).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

SHARES = {
    **dict.fromkeys((0, 2, 3, 5, 6), (0.299, 0.114)),
    **{1: (0.2126, 0.0722), 4: (0.30, 0.11), 7: (0.212, 0.087), 9: (0.2627, 0.0593)},
}
"""Shares of red and blue in luma by the code of the matrix; not stated is BT.601, as in FFmpeg."""


def rgb_of_planes(
    planes: Sequence[NDArray[np.float32]], matrix: int, bits: int, *, full: bool
) -> NDArray[np.float32]:
    """Return red, green and blue, 0 to 1 but for codes beyond, of codes of so many bits."""
    top = (1 << bits) - 1
    luma, chroma = 1 / top, 1 / top
    black = 0
    if not full:
        black, luma, chroma = 16 << bits - 8, 1 / (219 << bits - 8), 1 / (224 << bits - 8)
    whole = [planes[0], *(_spread(plane, planes[0].shape) for plane in planes[1:3])]
    to_rgb = _to_rgb(matrix) * [luma, chroma, chroma]
    offset = to_rgb @ np.array([black, 1 << bits - 1, 1 << bits - 1])
    turned = np.column_stack([to_rgb, -offset]).astype(np.float32)
    return np.asarray(cv2.transform(cv2.merge(whole), turned))


def _spread(plane: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return chroma for every pixel."""
    for axis in (0, 1):
        plane = np.repeat(plane, -(-shape[axis] // plane.shape[axis]), axis)
    return plane[: shape[0], : shape[1]]


def _to_rgb(matrix: int) -> NDArray[np.float64]:
    """Return red, green and blue of luma 0..1 and two chromas of -0.5..0.5."""
    red, blue = SHARES[matrix]
    green = 1 - red - blue
    to_red, to_blue = 2 * (1 - red), 2 * (1 - blue)
    return np.array(
        [[1, 0, to_red], [1, -blue * to_blue / green, -red * to_red / green], [1, to_blue, 0]]
    )
