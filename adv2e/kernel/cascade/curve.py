"""Distance of one pixel's signal from its reference within a substep, and its first crossing.

With t = 0..1 over the substep the distance is a polynomial of degree 5 and an exponential of the
second pole:
f(t) = c0 + c1 t + ... + c5 t^5 + swing e^(-b t).
"""

from __future__ import annotations

from typing import NamedTuple

from adv2e.compiled import kernel
from adv2e.kernel import special

NOWHERE = 2.0
"""Place of a crossing that does not happen in a substep."""

_NARROW = 1e-7
"""Share of a substep within which two crossings count as one."""

_SLOW = 0.01
"""Corner in a substep below which the exact answer is a difference of large numbers."""

_NEWTON = 30
_SETTLED = 1e-4
"""Step of Newton's method after which the next one is below 1e-8: half its square at most, as the
slope where it is used changes by less than itself."""


class Curve(NamedTuple):
    """Coefficients of a polynomial, swing and corner b of an exponential."""

    c0: float
    c1: float
    c2: float
    c3: float
    c4: float
    c5: float
    swing: float
    b: float


@kernel
def lag_curve(u0, slope0, bend0, u1, slope1, bend1, q0, d, b):
    """Lag of the second pole: `q0` at the start, for the lag of the first one as its input.

    The lag of the first pole is given by value, slope and curvature at both ends; `d` is the change
    of x, `b` the corner of the second pole in the substep, 0: there is none.
    """
    p0, p1, p2 = u0, slope0, 0.5 * bend0
    rise, turn, bend = u1 - p0 - p1 - p2, slope1 - p1 - 2.0 * p2, bend1 - 2.0 * p2
    p3 = 10.0 * rise - 4.0 * turn + 0.5 * bend
    p4 = -15.0 * rise + 7.0 * turn - bend
    p5 = 6.0 * rise - 3.0 * turn + 0.5 * bend
    if b == 0.0:
        return Curve(p0, p1, p2, p3, p4, p5, 0.0, 0.0)
    if b < _SLOW:
        # the series, whose seventh term is taken for one like the sixth
        s1 = b * (p0 - q0) - d
        s2 = b * (p1 - s1) / 2.0
        s3 = b * (p2 - s2) / 3.0
        s4 = b * (p3 - s3) / 4.0
        s5 = b * (p4 - s4) / 5.0
        return Curve(q0, s1, s2, s3, s4, s5 + b * (p5 - s5) / 6.0, 0.0, 0.0)
    lag = 1.0 / b
    p4 -= 5.0 * p5 * lag
    p3 -= 4.0 * p4 * lag
    p2 -= 3.0 * p3 * lag
    p1 -= 2.0 * p2 * lag
    p0 -= (p1 + d) * lag
    return Curve(p0, p1, p2, p3, p4, p5, q0 - p0, b)


@kernel
def plus(curve, c0, c1, c2, c3):
    """Add a cubic to a curve."""
    return Curve(
        curve.c0 + c0, curve.c1 + c1, curve.c2 + c2, curve.c3 + c3, curve.c4, curve.c5,
        curve.swing, curve.b,
    )  # fmt: skip


@kernel
def mirrored(curve):
    """Return the curve of the opposite sign."""
    return Curve(
        -curve.c0, -curve.c1, -curve.c2, -curve.c3, -curve.c4, -curve.c5, -curve.swing, curve.b
    )


@kernel
def at(curve, t):
    """Value, slope and remaining exponential term (swing) at t."""
    swing = curve.swing
    if swing != 0.0 and t > 0.0:
        swing *= special.exp_alone(-curve.b * t)
    t2 = t * t
    p = (curve.c0 + t * curve.c1) + t2 * (
        (curve.c2 + t * curve.c3) + t2 * (curve.c4 + t * curve.c5)
    )
    slope = (curve.c1 + t * (2.0 * curve.c2)) + t2 * (
        (3.0 * curve.c3 + t * (4.0 * curve.c4)) + t2 * (5.0 * curve.c5)
    )
    return p + swing, slope - curve.b * swing, swing


@kernel
def value(curve, t):
    """Value at t."""
    return at(curve, t)[0]


@kernel
def bent(curve, swing):
    """Bound of the curvature behind a place where the exponential term is `swing`."""
    most = 2.0 * abs(curve.c2) + 6.0 * abs(curve.c3) + 12.0 * abs(curve.c4) + 20.0 * abs(curve.c5)
    return most + curve.b * curve.b * abs(swing)


@kernel
def _guess(v0, slope0, v1, slope1, width):
    """Return the approximate root of the cubic through values and slopes, from its start."""
    t = v0 / (v0 - v1)
    s0, s1 = slope0 * width, slope1 * width
    c2, c3 = 3.0 * (v1 - v0) - 2.0 * s0 - s1, s0 + s1 - 2.0 * (v1 - v0)
    for _ in range(2):
        slope = s0 + t * (2.0 * c2 + t * 3.0 * c3)
        t -= (v0 + t * (s0 + t * (c2 + t * c3))) / (slope if slope != 0.0 else 1.0)
    return t * width


@kernel
def _root(curve, low, v_low, slope_low, high, v_high, slope_high):
    """Root of a curve that rises through zero once in [low, high]: Newton, else halving."""
    t = low + _guess(v_low, slope_low, v_high, slope_high, high - low)
    if not low <= t <= high:
        t = 0.5 * (low + high)
    for _ in range(_NEWTON):
        v, slope, _ = at(curve, t)
        if v >= 0.0:
            high = t
        else:
            low = t
        after = t - v / slope if slope > 0.0 else -1.0
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if abs(after - t) < _SETTLED:
            return after
        t = after
    return t


@kernel
def first_reach(curve, start, at_start, end, at_end):
    """First place in [start, end] at which a curve is at or above zero; beyond 1: none.

    `at_start` and `at_end` are the results of `at` there.  The span that is searched gets shorter
    until its curvature excludes more than one crossing.
    """
    t, width = start, end - start
    v, slope, swing = at_start
    if v >= 0.0:
        return start
    ahead, (v1, slope1, swing1) = end, at_end
    while True:
        most = bent(curve, swing) * width
        if v1 >= 0.0:
            if min(slope, slope1) > 0.0 and max(slope, slope1) > most:
                return _root(curve, t, v, slope, ahead, v1, slope1)
            if width <= _NARROW:
                return ahead
            width *= 0.5
        elif max(v, v1) + most * width * 0.125 < 0.0 or width <= _NARROW:
            t, v, slope, swing = ahead, v1, slope1, swing1
            if t >= end:
                return NOWHERE
            width *= 2.0
        else:
            width *= 0.5
        ahead = end if width >= end - t else t + width
        width = ahead - t
        v1, slope1, swing1 = at(curve, ahead)
