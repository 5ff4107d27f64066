"""Loops over the pixels of frames, before the pixel sees them."""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel


@kernel
def fill_luma(image, red, green, blue, luma):
    """Set `luma` (pixels,) to the sum of a table for each channel of `image` (pixels, 3).

    A third of the time of look-ups by NumPy.
    """
    for k in range(luma.shape[0]):
        luma[k] = green[image[k, 1]] + red[image[k, 0]] + blue[image[k, 2]]


@kernel
def sharpen(blurred, first, last, weights, norm, iterations, variation, light, mean, factor):
    """Find light from its means over exposures; see :mod:`adv2e.effects.frames.exposure_blur`.

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
