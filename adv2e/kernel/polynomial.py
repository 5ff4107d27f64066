"""The first crossing of a polynomial through two levels, without missing one.

A polynomial on [0, 1] lies within the hull of its Bernstein coefficients, and has no more turning
points than their differences change sign (variation diminishing).  So an interval is either clear
of both levels, or monotone, or has one turning point, or is halved.  Nothing is sampled: a pair of
crossings around a tangent cannot slip through.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., 2002, chapters 5 and 6.
.. [2] R. T. Farouki, "The Bernstein polynomial basis: a centennial retrospective", Computer Aided
   Geometric Design 29, 2012, doi:10.1016/j.cagd.2012.03.001.
"""

from __future__ import annotations

import math

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel.workspace import BERNSTEIN, DISTANCE, LOCAL, ORDER_MAX

TIE = 1e-9
"""A level counts as reached when it is passed by this much [ln units].

A pixel that returns to an earlier brightness approaches levels a whole number of thresholds away
without ever arriving; rounding alone would decide whether it fires.
"""

_FLAT = 1e-13
_INVERSE_BINOMIAL = np.array(
    [
        [1.0 / math.comb(n, k) if k <= n else 0.0 for k in range(ORDER_MAX + 1)]
        for n in range(ORDER_MAX + 1)
    ]
)


@kernel
def value(ws, row, order, s):
    """Value at s of the polynomial in a row."""
    v = ws[row, order]
    for k in range(order - 1, -1, -1):
        v = v * s + ws[row, k]
    return v


@kernel
def at_end(ws, row, order):
    """Value at 1 of the polynomial in a row."""
    v = ws[row, order]
    for k in range(order - 1, -1, -1):
        v += ws[row, k]
    return v


@kernel
def _restrict(ws, order, lo, hi):
    """LOCAL: the polynomial of row DISTANCE on [lo, hi], as one on [0, 1]."""
    for k in range(order + 1):
        ws[LOCAL, k] = ws[DISTANCE, k]
    if lo != 0.0:
        for k in range(order):
            for j in range(order - 1, k - 1, -1):
                ws[LOCAL, j] += lo * ws[LOCAL, j + 1]
    width = hi - lo
    if width != 1.0:
        power = width
        for k in range(1, order + 1):
            ws[LOCAL, k] *= power
            power *= width


@kernel
def _hull(ws, order):
    """Least and greatest Bernstein coefficient of LOCAL, and the sign changes of differences."""
    for k in range(order + 1):
        ws[BERNSTEIN, k] = ws[LOCAL, k] * _INVERSE_BINOMIAL[order, k]
    for level in range(1, order + 1):
        for j in range(order, level - 1, -1):
            ws[BERNSTEIN, j] += ws[BERNSTEIN, j - 1]
    low = ws[BERNSTEIN, 0]
    high = low
    for k in range(1, order + 1):
        b = ws[BERNSTEIN, k]
        low = b if b < low else low
        high = b if b > high else high
    flat = _FLAT * (1.0 + abs(low) + abs(high))
    changes = 0
    direction = 0
    for k in range(1, order + 1):
        d = ws[BERNSTEIN, k] - ws[BERNSTEIN, k - 1]
        now = 1 if d > flat else (-1 if d < -flat else 0)
        if now != 0:
            if direction not in (0, now):
                changes += 1
            direction = now
    return low, high, changes


@kernel
def _turning_point(ws, order):
    """Where the derivative of LOCAL changes sign within [0, 1] (there is one such place)."""
    lo, hi = 0.0, 1.0
    rising = ws[BERNSTEIN, 1] > ws[BERNSTEIN, 0]
    for k in range(1, order + 1):
        d = ws[BERNSTEIN, k] - ws[BERNSTEIN, k - 1]
        if d != 0.0:
            rising = d > 0.0
            break
    s = 0.5
    for _ in range(80):
        d1 = 0.0
        d2 = 0.0
        for k in range(order, 0, -1):
            d2 = d2 * s + d1
            d1 = d1 * s + k * ws[LOCAL, k]
        # d2 is the derivative of d1 by the same Horner scheme
        if (d1 > 0.0) == rising:
            lo = s
        else:
            hi = s
        step = s - d1 / d2 if d2 != 0.0 else -1.0
        if not (lo < step < hi):
            step = 0.5 * (lo + hi)
        if abs(step - s) < 1e-14:
            break
        s = step
    return s


@kernel
def _root(ws, row, order, lo, hi, level):
    """Where a row, monotone on [lo, hi] and with `level` between its ends, reaches it."""
    f_lo = value(ws, row, order, lo) - level
    f_hi = value(ws, row, order, hi) - level
    if f_lo == f_hi:
        return hi
    rising = f_hi > f_lo
    s = lo + (hi - lo) * f_lo / (f_lo - f_hi)
    for _ in range(80):
        f = ws[row, order]
        d = 0.0
        for k in range(order - 1, -1, -1):
            d = d * s + f
            f = f * s + ws[row, k]
        f -= level
        if (f < 0.0) == rising:
            lo = s
        else:
            hi = s
        step = s - f / d if d != 0.0 else -1.0
        if not (lo <= step <= hi):
            step = 0.5 * (lo + hi)
        if abs(step - s) < 1e-13:
            return step
        s = step
    return s


@kernel
def _crossing_on_monotone(ws, row, order, lo, hi, on, off):
    """Polarity (1, -1, 0: none) and place of the first crossing of a row, monotone on [lo, hi]."""
    end = value(ws, row, order, hi)
    if end >= on + TIE:
        return 1, _root(ws, row, order, lo, hi, on + TIE)
    if end <= -off - TIE:
        return -1, _root(ws, row, order, lo, hi, -off - TIE)
    return 0, hi


@kernel
def _crossing_of_line(ws, sa, sb, on, off):
    """As first_crossing, for order 1."""
    slope = ws[DISTANCE, 1]
    end = ws[DISTANCE, 0] + slope * sb
    if end >= on + TIE:
        s = (on + TIE - ws[DISTANCE, 0]) / slope
        return 1, min(max(s, sa), sb)
    if end <= -off - TIE:
        s = (-off - TIE - ws[DISTANCE, 0]) / slope
        return -1, min(max(s, sa), sb)
    return 0, sb


@kernel
def first_crossing(ws, order, sa, sb, on, off, monotone):
    """First place in [sa, sb] where row DISTANCE reaches `on` or falls to -`off`.

    Returns polarity (1 ON, -1 OFF, 0 none) and the place s.  A polynomial that is beyond a level at
    `sa` already crosses there.  Where it is known to be monotone, the search is shorter.
    """
    start = value(ws, DISTANCE, order, sa) if sa > 0.0 else ws[DISTANCE, 0]
    if start >= on + TIE:
        return 1, sa
    if start <= -off - TIE:
        return -1, sa
    if order == 1:
        return _crossing_of_line(ws, sa, sb, on, off)
    if monotone:
        return _crossing_on_monotone(ws, DISTANCE, order, sa, sb, on, off)
    lo = sa
    width = sb - sa
    while lo < sb:
        hi = lo + width
        if hi > sb or sb - hi < 1e-14:
            hi = sb
        _restrict(ws, order, lo, hi)
        low, high, changes = _hull(ws, order)
        if high < on + TIE and low > -off - TIE:
            lo = hi
            width *= 2.0
            continue
        if changes > 1 and high - low > 1e-11:
            width = 0.5 * (hi - lo)
            continue
        turn = 1.0
        if changes == 1:
            turn = _turning_point(ws, order)
            polarity, s = _crossing_on_monotone(ws, LOCAL, order, 0.0, turn, on, off)
            if polarity != 0:
                return polarity, lo + (hi - lo) * s
            polarity, s = _crossing_on_monotone(ws, LOCAL, order, turn, 1.0, on, off)
        else:
            polarity, s = _crossing_on_monotone(ws, LOCAL, order, 0.0, 1.0, on, off)
        if polarity != 0:
            return polarity, lo + (hi - lo) * s
        lo = hi
    return 0, sb
