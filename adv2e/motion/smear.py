"""Frames smeared along their motion; see :mod:`adv2e.effects.frames.motion_blur`."""

from __future__ import annotations

import math

from adv2e.compiled import kernel
from adv2e.motion.warping import cubic


@kernel
def spread(u, v, wide_u, wide_v):
    """Fill `wide_u` and `wide_v` with the longest smear that passes over each pixel.

    u, v: columns and rows over which what is at a pixel is smeared, half to either side [px].
    """
    rows, columns = u.shape
    for y in range(rows):
        for x in range(columns):
            wide_u[y, x], wide_v[y, x] = u[y, x], v[y, x]
    for y in range(rows):
        for x in range(columns):
            du, dv = u[y, x], v[y, x]
            length = du * du + dv * dv
            steps = math.ceil(max(abs(du), abs(dv)) * 0.5)
            for step in range(-steps, steps + 1):
                if step == 0:
                    continue
                share = 0.5 * step / steps
                i, j = round(y + share * dv), round(x + share * du)
                if 0 <= i < rows and 0 <= j < columns:
                    here = wide_u[i, j] * wide_u[i, j] + wide_v[i, j] * wide_v[i, j]
                    if here < length:
                        wide_u[i, j], wide_v[i, j] = du, dv


@kernel
def smear(light, u, v, out):
    """Fill `out` with the mean of `light` along the smear through each pixel.

    Samples stand at the middles of equal parts of half a pixel or less.  Where there is no smear
    it is the light to the last bit.
    """
    rows, columns = light.shape
    for y in range(rows):
        for x in range(columns):
            du, dv = u[y, x], v[y, x]
            if du == 0.0 and dv == 0.0:
                out[y, x] = light[y, x]
                continue
            count = math.ceil(2.0 * max(abs(du), abs(dv))) + 1
            total = 0.0
            for k in range(count):
                share = (k + 0.5) / count - 0.5
                total += cubic(light, x - share * du, y - share * dv)
            out[y, x] = total / count
