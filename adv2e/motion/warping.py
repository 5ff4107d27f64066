"""Compiled loops along the motion: interpolation between two frames, and smear of one.

Motion is in two planes (u: columns, v: rows) of the pixels of its own frame, and so is its bend
(p, q): at a share f of the interval a pixel of the first frame is f (u, v) - f (1 - f) (p, q) from
where it was.  Positions outside the frame take the light of the nearest pixel of its border: there
is nothing better to know.
"""

from __future__ import annotations

import math

from adv2e.compiled import kernel

ONE_SIDED = 1000.0
"""Least score of a motion whose pixel is seen in its own frame only."""

UNKNOWN = 1e9
"""Score of no motion at all."""

_STEP_COST = 0.02
_DIAGONAL = 1.4


@kernel
def _bilinear(image, x, y):
    rows, columns = image.shape
    x = min(max(x, 0.0), columns - 1.0)
    y = min(max(y, 0.0), rows - 1.0)
    i, j = min(int(x), columns - 2), min(int(y), rows - 2)
    fx, fy = x - i, y - j
    top = image[j, i] + fx * (image[j, i + 1] - image[j, i])
    bottom = image[j + 1, i] + fx * (image[j + 1, i + 1] - image[j + 1, i])
    return top + fy * (bottom - top)


@kernel
def cubic(image, x, y):
    """Return the light at column `x`, row `y`: Catmull-Rom, overshoot limited.

    Bilinear light would lose contrast between pixels and regain it on them, so that every moving
    texture flickered.  Beyond the four pixels around by a quarter of their range, and below zero,
    it does not go, so that an edge gets no echo that fires.
    """
    rows, columns = image.shape
    x = min(max(x, 0.0), columns - 1.0)
    y = min(max(y, 0.0), rows - 1.0)
    i, j = int(x), int(y)
    f, g = x - i, y - j
    i0, i2, i3 = max(i - 1, 0), min(i + 1, columns - 1), min(i + 2, columns - 1)
    j0, j2, j3 = max(j - 1, 0), min(j + 1, rows - 1), min(j + 2, rows - 1)
    a0, a1 = ((-0.5 * f + 1.0) * f - 0.5) * f, (1.5 * f - 2.5) * f * f + 1.0
    a2, a3 = ((-1.5 * f + 2.0) * f + 0.5) * f, (0.5 * f - 0.5) * f * f
    b0, b1 = ((-0.5 * g + 1.0) * g - 0.5) * g, (1.5 * g - 2.5) * g * g + 1.0
    b2, b3 = ((-1.5 * g + 2.0) * g + 0.5) * g, (0.5 * g - 0.5) * g * g
    p, q, r, s = image[j, i], image[j, i2], image[j2, i], image[j2, i2]
    value = (
        b0 * (a0 * image[j0, i0] + a1 * image[j0, i] + a2 * image[j0, i2] + a3 * image[j0, i3])
        + b1 * (a0 * image[j, i0] + a1 * p + a2 * q + a3 * image[j, i3])
        + b2 * (a0 * image[j2, i0] + a1 * r + a2 * s + a3 * image[j2, i3])
        + b3 * (a0 * image[j3, i0] + a1 * image[j3, i] + a2 * image[j3, i2] + a3 * image[j3, i3])
    )
    least, most = min(p, q, r, s), max(p, q, r, s)
    slack = 0.25 * (most - least)
    return min(max(value, least - slack, 0.0), most + slack)


@kernel
def mismatch(u, v, here, there, out):
    """Fill `out` with the absolute difference between each pixel and where it goes."""
    rows, columns = here.shape
    for y in range(rows):
        for x in range(columns):
            out[y, x] = abs(here[y, x] - _bilinear(there, x + u[y, x], y + v[y, x]))


@kernel
def find_lost(u, v, ru, rv, lost):
    """Mark in `lost` the pixels that do not come back with the motion (`ru`, `rv`) there."""
    rows, columns = lost.shape
    for y in range(rows):
        for x in range(columns):
            du, dv = u[y, x], v[y, x]
            tx, ty = x + du, y + dv
            if tx < -0.5 or ty < -0.5 or tx > columns - 0.5 or ty > rows - 0.5:
                lost[y, x] = True
                continue
            eu = du + _bilinear(ru, tx, ty)
            ev = dv + _bilinear(rv, tx, ty)
            if math.sqrt(eu * eu + ev * ev) > 1.0 + 0.1 * math.sqrt(du * du + dv * dv):
                lost[y, x] = True


@kernel
def fill_lost(u, v, lost, g, distance):
    """Give lost pixels the motion of the one that is nearest over like light, in place.

    The length of a path is the change of `g` along it and 0.02 a pixel, found by two pairs of
    sweeps.  `distance` is 0 for pixels not lost, UNKNOWN where no path was found.
    """
    rows, columns = g.shape
    for y in range(rows):
        for x in range(columns):
            distance[y, x] = UNKNOWN if lost[y, x] else 0.0
    for sweep in range(4):
        step = 1 if sweep % 2 == 0 else -1
        for row in range(rows):
            y = row if step == 1 else rows - 1 - row
            for column in range(columns):
                x = column if step == 1 else columns - 1 - column
                if not lost[y, x]:
                    continue
                for k in range(4):
                    ny = y if k == 3 else y - step
                    nx = x - step if k == 3 else x + k - 1
                    if ny < 0 or ny >= rows or nx < 0 or nx >= columns:
                        continue
                    cost = _STEP_COST * (_DIAGONAL if k in (0, 2) else 1.0)
                    length = distance[ny, nx] + abs(g[y, x] - g[ny, nx]) + cost
                    if length < distance[y, x]:
                        distance[y, x] = length
                        u[y, x] = u[ny, nx]
                        v[y, x] = v[ny, nx]


@kernel
def splat(u, v, p, q, score, fraction, best, source):
    """Send every pixel `fraction` of its way; `best` and `source` say who arrives.

    A pixel arrives at the up to four pixels around its goal; the lowest score wins, the nearer
    of equals.  `source` is the flat index of the winner, `best` its score (UNKNOWN: nobody).
    """
    rows, columns = score.shape
    aside = fraction * (1.0 - fraction)
    for y in range(rows):
        for x in range(columns):
            best[y, x] = UNKNOWN
    for y in range(rows):
        for x in range(columns):
            own = score[y, x]
            if own >= UNKNOWN:
                continue
            gx = x + fraction * u[y, x] - aside * p[y, x]
            gy = y + fraction * v[y, x] - aside * q[y, x]
            i, j = math.floor(gx), math.floor(gy)
            for ty in range(max(j, 0), min(j + 2 if gy > j else j + 1, rows)):
                for tx in range(max(i, 0), min(i + 2 if gx > i else i + 1, columns)):
                    rank = own + 1e-3 * (abs(gx - tx) + abs(gy - ty))
                    if rank < best[ty, tx]:
                        best[ty, tx] = rank
                        source[ty, tx] = y * columns + x


@kernel
def compose(a, b, from_a, from_b, fraction, out):
    """Fill `out` with the light at `fraction` of the way from `a` to `b`.

    from_a, from_b: motion (u, v) and bend (p, q) of the pixels of each frame, flat, and for each
    pixel of `out` the score and the index of the one that arrives (:func:`splat`).

    Seen in both frames: blended along the motion.  Seen in one only: from that one.  Not known:
    blended in place.  Exactly the light of `a` where nothing moves and `b` is the same.
    """
    ua, va, pa, qa, best_a, source_a = from_a
    ub, vb, pb, qb, best_b, source_b = from_b
    rows, columns = a.shape
    rest = 1.0 - fraction
    aside = fraction * rest
    for y in range(rows):
        for x in range(columns):
            from_a, from_b = best_a[y, x], best_b[y, x]
            here, there = source_a[y, x], source_b[y, x]
            if min(from_a, from_b) < ONE_SIDED:
                if from_a <= from_b:
                    u, v, dx, dy = ua[here], va[here], aside * pa[here], aside * qa[here]
                else:
                    u, v, dx, dy = -ub[there], -vb[there], aside * pb[there], aside * qb[there]
                if u == 0.0 and v == 0.0:
                    one, two = a[y, x], b[y, x]
                else:
                    one = cubic(a, x + dx - fraction * u, y + dy - fraction * v)
                    two = cubic(b, x + dx + rest * u, y + dy + rest * v)
            elif from_a < UNKNOWN or from_b < UNKNOWN:
                if from_a < UNKNOWN:
                    dx, dy = aside * pa[here], aside * qa[here]
                    one = cubic(a, x + dx - fraction * ua[here], y + dy - fraction * va[here])
                if from_b < UNKNOWN:
                    dx, dy = aside * pb[there], aside * qb[there]
                    two = cubic(b, x + dx - rest * ub[there], y + dy - rest * vb[there])
                if from_a >= UNKNOWN:
                    one = two
                if from_b >= UNKNOWN:
                    two = one
            else:
                one, two = a[y, x], b[y, x]
            out[y, x] = one + fraction * (two - one)


# ---- Frames smeared along their motion; see :mod:`adv2e.effects.frames.motion_blur`.


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
