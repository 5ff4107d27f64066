"""Light from means over exposures; see :mod:`adv2e.effects.frames.exposure_blur`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import entry


@entry
def sharpen(
    blurred: NDArray[Any],
    first: NDArray[Any],
    last: NDArray[Any],
    weights: NDArray[Any],
    norm: NDArray[Any],
    iterations: int,
    variation: NDArray[Any],
    light: NDArray[Any],
    mean: NDArray[Any],
    factor: NDArray[Any],
) -> None:
    """Iterate over a strip of pixels.

    Parameters
    ----------
    blurred : (n, pixels)
        Frames [DN], above zero.
    first, last : (n,) int
        Where the weights of each row are not zero.
    weights : (n, n), norm : (n,)
        Rows, and sums of the columns.
    iterations : int
    variation : (2,)
        Lambda and the square of epsilon.
    light : (n, pixels)
        In: where to begin.  Out: the light.
    mean, factor : (pixels,), (n, pixels)
        Memory to work in.
    """
    n, pixels = blurred.shape
    cost, soft = variation
    one = blurred.dtype.type(1)
    two = one + one
    for _ in range(iterations):
        factor[:] = 0.0
        for k in range(n):
            mean[:] = 0.0
            for j in range(first[k], last[k]):
                weight, row = weights[k, j], light[j]
                for p in range(pixels):
                    mean[p] += weight * row[p]
            now = blurred[k]
            for p in range(pixels):
                mean[p] = now[p] / mean[p]
            for j in range(first[k], last[k]):
                weight, row = weights[k, j], factor[j]
                for p in range(pixels):
                    row[p] += weight * mean[p]
        mean[:] = 0.0  # from here on the pull of the step before
        for k in range(n):
            row, now, scale = light[k], factor[k], norm[k]
            coming = light[min(k + 1, n - 1)]
            for p in range(pixels):
                step = two * (coming[p] - row[p]) / (coming[p] + row[p])
                pull = step / np.sqrt(step * step + soft)
                row[p] *= now[p] * scale / (one - cost * (pull - mean[p]))
                mean[p] = pull
