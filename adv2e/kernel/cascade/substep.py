"""Events of one pixel within a substep in which light, lags, noise and leak are known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import embedded, kernel
from adv2e.kernel import per_pixel, special
from adv2e.kernel.comparator import TIE, cause_by_most, fire, note_parts
from adv2e.kernel.noise import NONE, noise_within, take_noise

# ---- Distance of one pixel's signal from its reference within a substep, and its first crossing.
#
# With t = 0..1 over the substep the distance is a polynomial of degree 5 and an exponential of the
# second pole:
# f(t) = c0 + c1 t + ... + c5 t^5 + swing e^(-b t).


NOWHERE = 2.0
"""Place of a crossing that does not happen in a substep."""

_NARROW = 1e-7
"""Share of a substep within which two crossings count as one."""

_SLOW = 0.01
"""Corner in a substep below which the exact answer is a difference of large numbers."""

_NEWTON = 30
SETTLED = 1e-4
"""Step of Newton's method after which the next one is below 1e-8: half its square at most, as the
slope where it is used changes by less than itself."""


class SignalCurve(NamedTuple):
    """Coefficients of a polynomial, swing and corner b of an exponential."""

    c0: float
    c1: float
    c2: float
    c3: float
    c4: float
    c5: float
    swing: float
    b: float


@embedded
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
    # the series, whose seventh term is taken for one like the sixth
    s1 = b * (p0 - q0) - d
    s2 = b * (p1 - s1) / 2.0
    s3 = b * (p2 - s2) / 3.0
    s4 = b * (p3 - s3) / 4.0
    s5 = b * (p4 - s4) / 5.0
    s5 += b * (p5 - s5) / 6.0
    is_slow, has_none = b < _SLOW, b == 0.0
    lag = 0.0 if has_none else 1.0 / (1.0 if is_slow else b)
    p4 -= 5.0 * p5 * lag
    p3 -= 4.0 * p4 * lag
    p2 -= 3.0 * p3 * lag
    p1 -= 2.0 * p2 * lag
    p0 -= (p1 + d) * lag
    # chosen, not branched: for loops over lanes
    series = is_slow & (not has_none)
    return SignalCurve(
        q0 if series else p0, s1 if series else p1, s2 if series else p2, s3 if series else p3,
        s4 if series else p4, s5 if series else p5, 0.0 if is_slow else q0 - p0,
        0.0 if is_slow else b,
    )  # fmt: skip


@kernel
def plus(curve, c0, c1, c2, c3):
    """Add a cubic to a curve."""
    return SignalCurve(
        curve.c0 + c0, curve.c1 + c1, curve.c2 + c2, curve.c3 + c3, curve.c4, curve.c5,
        curve.swing, curve.b,
    )  # fmt: skip


@kernel
def mirrored(curve):
    """Return the curve of the opposite sign."""
    return SignalCurve(
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


@embedded
def guess_root(v0, slope0, v1, slope1, width):
    """Return the approximate root of the cubic through values and slopes, from its start."""
    t = v0 / (v0 - v1 if v0 != v1 else 1.0)
    s0, s1 = slope0 * width, slope1 * width
    c2, c3 = 3.0 * (v1 - v0) - 2.0 * s0 - s1, s0 + s1 - 2.0 * (v1 - v0)
    for _ in range(2):
        slope = s0 + t * (2.0 * c2 + t * 3.0 * c3)
        t -= (v0 + t * (s0 + t * (c2 + t * c3))) / (slope if slope != 0.0 else 1.0)
    return t * width


@kernel
def _root(curve, low, v_low, slope_low, high, v_high, slope_high):
    """Root of a curve that rises through zero once in [low, high]: Newton, else halving."""
    t = low + guess_root(v_low, slope_low, v_high, slope_high, high - low)
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
        if abs(after - t) < SETTLED:
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


DONE = -1.0
"""Place of a pixel that is at the end of its piece."""


class Cubic(NamedTuple):
    """A cubic of the place in a substep."""

    c0: float
    c1: float
    c2: float
    c3: float


class Piece(NamedTuple):
    """Part of an interval, the lags at the ends of whose substeps are kept."""

    origin: float  # from which due times count [us]
    start: float  # its start [us]
    length: float  # its length [us]
    before: float  # time from the start of the interval to its own, in lengths of the piece
    substeps: int
    places: NDArray[np.float64]  # where they end, as shares of the piece
    levels: tuple[float, float]  # factors on both thresholds at its ends


class Substep(NamedTuple):
    """Light, thresholds and leak of a pixel in a substep."""

    place: float  # its start, as a share of the piece
    span: float  # its length, likewise
    t0: float  # its start [us]
    h: float  # its length [us]
    x: float  # log intensity at its start
    d: float  # by which that changes
    on0: float  # thresholds at its ends
    on1: float
    off0: float
    off1: float
    fallen: float  # what leak at its nominal speed has taken from the reference before
    leak1: float  # coefficients of the cubic that it takes in the substep
    leak2: float
    leak3: float


@kernel
def light_of(x, on_log, circuit):
    """Light [DN] that log intensity x stands for, on the log branch or on the foot."""
    return special.exp(x) if on_log else circuit.slope * x


@embedded
def hull(u0, u1, q0, q1, d):
    """Bounds of the signal in a substep, less x at its start; see the bounds of the screens.

    u0, u1, q0, q1 : lags of both poles at its ends; d : change of x
    """
    turns = u0 * u1 < 0.0
    if not turns and ((u0 + u1 <= 0.0 and q0 <= u0) or (u0 + u1 >= 0.0 and q0 >= u0)):
        return max(q0, d + q1), min(q0, d + q1)
    high, low = max(u0, q0, d + u1), min(u0, q0, d + u1)
    if turns:  # the first pole turns where it meets x
        high, low = max(high, 0.0, d), min(low, 0.0, d)
    return high, low


@embedded
def may_fire(high, low, fallen0, fallen1, on, off):
    """Tell whether a distance from the reference may reach a level, given its bounds.

    fallen0, fallen1 : fall of the reference by leak at both ends of the time
    """
    return high + fallen1 >= on or low + fallen0 <= -off


@kernel
def noise_at(noise, t):
    """Value of a cubic."""
    return noise.c0 + t * (noise.c1 + t * (noise.c2 + t * noise.c3))


@kernel
def fallen(step, t):
    """Return the fall of the reference until t by leak at its nominal speed."""
    return step.fallen + t * (step.leak1 + t * (step.leak2 + t * step.leak3))


@kernel
def _light_at(x, circuit):
    """Light [DN] that log intensity x stands for."""
    return light_of(x, x >= circuit.knee, circuit)


@kernel
def _shifted(found, sign, level, slope):
    """Return the result of `at` for a curve or its mirror plus a line, which is `level` there."""
    return sign * found[0] + level, sign * found[1] + slope, sign * found[2]


@kernel
def leak_factor(i, circuit, state):
    """Return the leak speed of pixel i, relative to the nominal one."""
    return state[per_pixel.LEAK_FACTOR, i] if circuit.leak_jitter > 0.0 else 1.0


@kernel
def fire_until(i, t, upto, step, signal, noise, circuit, state, buffer, n):
    """Fire the events of pixel i in a substep from t on, until `upto`.

    signal, noise : signal by the light alone, and the photoreceptor noise on top of it

    Returns the number of events, and DONE or the place at which the buffer was full.  In row
    REFERENCE the reference is as if leak had always had its present speed.
    """
    h, reference, factor = step.h, state[per_pixel.REFERENCE, i], leak_factor(i, circuit, state)
    on_level, off_level = state[per_pixel.ON, i], state[per_pixel.OFF, i]
    most = buffer.keys.shape[0]
    signal = plus(signal, noise.c0, noise.c1, noise.c2, noise.c3)
    if state[per_pixel.HOLD, i] >= 0.0:
        t = max(t, (state[per_pixel.HOLD, i] - step.t0) / h)
        seen = value(signal, t)
        reference = seen + factor * fallen(step, t) + state[per_pixel.BEYOND, i]
        state[per_pixel.HOLD, i] = -1.0
        if circuit.causes:
            now, by_noise = reference - factor * fallen(step, t), noise_at(noise, t)
            note_parts(i, now, seen - by_noise, by_noise, 0.0, state)
    while True:
        if n == most:
            break
        kind, t_end = noise_within(i, step.t0 + t * h, step.t0 + upto * h, circuit, state)
        end = upto if kind == NONE else max(t, (t_end - step.t0) / h)
        away = plus(
            signal, factor * step.fallen - reference, factor * step.leak1, factor * step.leak2,
            factor * step.leak3,
        )  # fmt: skip
        at_t, at_end = at(away, t), at(away, end)
        room = bent(away, at_t[2]) * (end - t) * (end - t) * 0.125
        up, down = NOWHERE, NOWHERE
        if max(at_t[0], at_end[0]) + room >= min(step.on0, step.on1):
            rise = step.on1 - step.on0
            level = plus(away, -step.on0 - TIE, -rise, 0.0, 0.0)
            up = first_reach(
                level, t, _shifted(at_t, 1.0, -step.on0 - TIE - rise * t, -rise),
                end, _shifted(at_end, 1.0, -step.on0 - TIE - rise * end, -rise),
            )  # fmt: skip
        if room - min(at_t[0], at_end[0]) >= min(step.off0, step.off1):
            rise = step.off1 - step.off0
            level = plus(mirrored(away), -step.off0 - TIE, -rise, 0.0, 0.0)
            down = first_reach(
                level, t, _shifted(at_t, -1.0, -step.off0 - TIE - rise * t, -rise),
                end, _shifted(at_end, -1.0, -step.off0 - TIE - rise * end, -rise),
            )  # fmt: skip
        polarity, by_signal = 1 if up <= down else -1, min(up, down) <= 1.0
        if by_signal:
            t = min(up, down)
        elif kind == NONE:
            t = DONE
            break
        else:
            t = end
            light = _light_at(step.x + step.d * t, circuit)
            polarity = take_noise(i, kind, light, circuit, state)
            if polarity == 0:
                continue
        when, cause = step.t0 + t * h, kind
        if circuit.causes and by_signal:
            now = reference - factor * fallen(step, t)
            seen, by_noise = value(signal, t), noise_at(noise, t)
            cause = cause_by_most(i, polarity, now, seen - by_noise, by_noise, 0.0, circuit, state)
        n = fire(i, when, polarity, cause, circuit, state, buffer, n)
        before = factor
        factor = leak_factor(i, circuit, state)
        level = on_level if polarity > 0 else -off_level
        beyond = circuit.overshoot * level
        if circuit.dead_time > 0.0:
            hold = when + circuit.dead_time
            if hold >= step.t0 + upto * h:
                state[per_pixel.HOLD, i] = hold
                state[per_pixel.BEYOND, i] = beyond
                t = DONE
                break
            t = (hold - step.t0) / h
        if circuit.dead_time > 0.0 or not by_signal:
            reference = value(signal, t) + factor * fallen(step, t) + beyond
        else:
            level = (
                step.on0 + (step.on1 - step.on0) * t
                if polarity > 0
                else (step.off1 - step.off0) * -t - step.off0
            )
            reference += level * (1.0 + circuit.overshoot)
            reference += (factor - before) * fallen(step, t)
        if circuit.causes:
            now = reference - factor * fallen(step, t)
            by_noise = noise_at(noise, t)
            note_parts(i, now, value(signal, t) - by_noise, by_noise, 0.0, state)
    state[per_pixel.REFERENCE, i] = reference
    return n, t
