"""The events of one pixel that may fire, substep by substep through one piece of an interval."""

from __future__ import annotations

import math
from typing import NamedTuple

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen, special
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import screen as cascade
from adv2e.kernel.cascade.curve import (
    NOWHERE,
    at,
    bent,
    first_reach,
    lag_curve,
    mirrored,
    plus,
    value,
)
from adv2e.kernel.cascade.plan import FEWEST, LONGEST
from adv2e.kernel.causes import cause_by_most, note_parts
from adv2e.kernel.comparator import TIE, fire
from adv2e.kernel.lanes.exchange import log_of, watch
from adv2e.kernel.noise import NONE, next_noise, noise_within, take_noise
from adv2e.kernel.screen import STRIDE

DONE = -1.0
"""Place of a pixel that is at the end of its piece."""

_SIXTH = 1.0 / 6.0
_LARGEST_RATIO = math.tanh(0.5 * cascade.LARGEST_STEP)


class _Substep(NamedTuple):
    """What a pixel meets in a substep."""

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


class _Way(NamedTuple):
    """How a pixel goes through its piece."""

    x0: float  # log intensity at its start
    dx: float  # by which that changes
    knee: float  # where the light passes the knee of the log map; 1: nowhere
    before: int  # substeps before the knee,
    behind: int  # and behind it
    alone: bool  # whether the lags that the screen keeps do not hold


@kernel
def _way(k, length, substeps, circuit, strip):
    """Return how pixel k of a strip goes through its piece of `length` us."""
    i0, i1 = float(strip[screen.LIGHT_0 + k]), float(strip[screen.LIGHT_1 + k])
    x0 = log_of(i0, circuit)
    dx = log_of(i1, circuit) - x0
    knee_dn = circuit.slope * circuit.knee
    mixed = (i0 < knee_dn) != (i1 < knee_dn)
    brightest, steep = max(i0, i1), abs(dx) / cascade.LARGEST_STEP
    # a little less than what the screen takes for steep, which rounds otherwise
    alone = abs(i1 - i0) > 0.99 * _LARGEST_RATIO * (i0 + i1) or steep > 0.99
    if not (alone or mixed or brightest > 0.99 * screen.LARGEST_LIGHT):
        return _Way(x0, dx, 1.0, substeps, 0, False)
    corner = (circuit.dark + circuit.per_dn * brightest) * length
    needed = max(corner / LONGEST, FEWEST * max(steep, 1.0))
    knee = min(max((circuit.knee - x0) / dx, 0.0), 1.0) if mixed and dx != 0.0 else 1.0
    return _Way(x0, dx, knee, math.ceil(needed * knee), math.ceil(needed * (1.0 - knee)), True)


@kernel
def _place(way, j):
    """Where substep j of a piece begins."""
    if j < way.before:
        return way.knee * (j / way.before)
    if j == way.before + way.behind:
        return 1.0
    return way.knee + (1.0 - way.knee) * ((j - way.before) / way.behind)


@kernel
def _light(x, on_log, circuit):
    return special.exp(x) if on_log else circuit.slope * x


@kernel
def _after(u0, d, a, c):
    """Lag of the first pole after a substep; see :mod:`adv2e.kernel.cascade`."""
    decay = special.exp(-a)
    if a < 0.05:
        shape = 1.0 - a * (1 / 2 - a * (1 / 6 - a * (1 / 24 - a * (1 / 120 - a / 720))))
        turn = 1 / 6 - a * (1 / 12 - a * (1 / 40 - a * (1 / 180 - a / 1008)))
    else:
        shape = (1.0 - decay) / a
        turn = (a - 2.0 + (a + 2.0) * decay) / (a * a * a)
    u1 = decay * u0 - d * (shape - 0.5 * c * turn)
    return u1 if abs(u1) > screen.AT_REST else 0.0


@kernel
def _may_fire(u0, u1, q0, q1, away0, away1, fallen0, fallen1, on, off):
    """Tell whether the signal may reach a level in a substep; see the bounds of the screens.

    away0, away1 : distance of x from the reference at its ends, fallen0, fallen1 : what leak adds
    """
    turns = u0 * u1 < 0.0
    if not turns and ((u0 + u1 <= 0.0 and q0 <= u0) or (u0 + u1 >= 0.0 and q0 >= u0)):
        high, low = max(away0 + q0, away1 + q1), min(away0 + q0, away1 + q1)
    else:
        high, low = away0 + max(u0, q0), away0 + min(u0, q0)
        high, low = max(high, away1 + u1), min(low, away1 + u1)
        if turns:  # the first pole turns where it meets x
            high, low = max(high, away0, away1), min(low, away0, away1)
    return high + fallen1 >= on or low + fallen0 <= -off


@kernel
def _first_busy(k, j, count, away, d, fall, on, off, strip):
    """Return the first substep from j on in which pixel k may fire by its signal, else `count`.

    away : distance of x from the reference at the start of the piece; d, fall : what x and leak
    move it by in each substep.
    """
    u1 = float(strip[cascade.FIRST + j * STRIDE + k])
    q1 = float(strip[cascade.SECOND + j * STRIDE + k])
    while j < count:
        u0, q0, away_j = u1, q1, away + (d + fall) * j
        u1 = float(strip[cascade.FIRST + (j + 1) * STRIDE + k])
        q1 = float(strip[cascade.SECOND + (j + 1) * STRIDE + k])
        if _may_fire(u0, u1, q0, q1, away_j, away_j + d, 0.0, fall, on, off):
            break
        j += 1
    return j


@kernel
def _fallen(step, t):
    """Return what leak at its nominal speed has taken from the reference until t."""
    return step.fallen + t * (step.leak1 + t * (step.leak2 + t * step.leak3))


@kernel
def _light_at(x, circuit):
    """Light [DN] that log intensity x stands for."""
    return _light(x, x >= circuit.knee, circuit)


@kernel
def _shifted(found, sign, level, slope):
    """Return what `at` finds of a curve or its mirror with a line, `level` there, added to it."""
    return sign * found[0] + level, sign * found[1] + slope, sign * found[2]


@kernel
def _fire(i, t, step, lag, reference, factor, t_base, circuit, state, keys, times, n):
    """Fire the events of pixel i in a substep from t on.

    Returns the number of events, DONE or the place where there is no room left for them, and the
    reference, as if leak had always had its present speed, and that speed.
    """
    jitter, h = circuit.leak_jitter > 0.0, step.h
    on_level, off_level = state[per_pixel.ON, i], state[per_pixel.OFF, i]
    signal = plus(lag, step.x, step.d, 0.0, 0.0)
    if state[per_pixel.HOLD, i] >= 0.0:
        t = max(t, (state[per_pixel.HOLD, i] - step.t0) / h)
        seen = value(signal, t)
        reference = seen + factor * _fallen(step, t) + state[per_pixel.BEYOND, i]
        state[per_pixel.HOLD, i] = -1.0
        if circuit.causes:
            note_parts(i, reference - factor * _fallen(step, t), seen, 0.0, 0.0, state)
    while True:
        if n == keys.shape[0]:
            return n, t, reference, factor
        kind, t_end = noise_within(i, step.t0 + t * h, step.t0 + h, circuit, state)
        end = 1.0 if kind == NONE else max(t, (t_end - step.t0) / h)
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
            return n, DONE, reference, factor
        else:
            t = end
            light = _light_at(step.x + step.d * t, circuit)
            polarity = take_noise(i, kind, light, circuit, state)
            if polarity == 0:
                continue
        when, cause = step.t0 + t * h, kind
        if circuit.causes and by_signal:
            now = reference - factor * _fallen(step, t)
            cause = cause_by_most(i, polarity, now, value(signal, t), 0.0, 0.0, circuit, state)
        n = fire(i, when, polarity, cause, t_base, circuit, state, keys, times, n)
        before = factor
        factor = state[per_pixel.LEAK_FACTOR, i] if jitter else 1.0
        level = on_level if polarity > 0 else -off_level
        beyond = circuit.overshoot * level
        if circuit.dead_time > 0.0:
            hold = when + circuit.dead_time
            if hold >= step.t0 + h:
                state[per_pixel.HOLD, i] = hold
                state[per_pixel.BEYOND, i] = beyond
                return n, DONE, reference, factor
            t = (hold - step.t0) / h
        if circuit.dead_time > 0.0 or not by_signal:
            reference = value(signal, t) + factor * _fallen(step, t) + beyond
        else:
            level = (
                step.on0 + (step.on1 - step.on0) * t
                if polarity > 0
                else (step.off1 - step.off0) * -t - step.off0
            )
            reference += level * (1.0 + circuit.overshoot)
            reference += (factor - before) * _fallen(step, t)
        if circuit.causes:
            now = reference - factor * _fallen(step, t)
            note_parts(i, now, value(signal, t), 0.0, 0.0, state)


@kernel
def _solve(
    lo, k, s_from, ta, length, start, substeps, levels, t_base, circuit, state, strip, keys, times,
    n,
):  # fmt: skip
    """Events of pixel k of the strip that begins at pixel `lo`, over a piece [ta, ta + length] us.

    Parameters
    ----------
    s_from : float
        Place to go on from; 0 at first.
    start : float
        Time that row DUE counts from [us].
    substeps : int
        Of the piece, in the rows of the screen.
    levels : (2,) float
        Factors on both thresholds at the ends of the piece.

    Returns
    -------
    Number of events so far, and DONE, or, where there is no room left for them, the place from
    which to go on.  The rows of the pixel are then those at the end of the piece.
    """
    i = lo + k
    way = _way(k, length, substeps, circuit, strip)
    on_level, off_level = state[per_pixel.ON, i], state[per_pixel.OFF, i]
    on_0, on_rise = on_level * levels[0], on_level * (levels[1] - levels[0])
    off_0, off_rise = off_level * levels[0], off_level * (levels[1] - levels[0])
    factor = state[per_pixel.LEAK_FACTOR, i] if circuit.leak_jitter > 0.0 else 1.0
    reference = state[per_pixel.REFERENCE, i]
    light1, fallen1, s1 = float(strip[screen.LIGHT_0 + k]), 0.0, 0.0
    u1, q1 = float(strip[cascade.FIRST + k]), float(strip[cascade.SECOND + k])
    follows_light = way.alone or circuit.photo_leak > 0.0
    count, share = way.before + way.behind, 1.0 / substeps
    hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    # where each substep is like the other, those in which nothing happens are passed quickly
    skims, fall_each = not follows_light, on_level * circuit.leak * length * share
    least_on, least_off = min(on_0, on_0 + on_rise), min(off_0, off_0 + off_rise)
    j = 0
    while j < count:
        if skims and hold < 0.0 and s1 >= s_from:
            busy = _first_busy(
                k, j, count, way.x0 - reference, way.dx * share, factor * fall_each, least_on,
                least_off, strip,
            )  # fmt: skip
            if due < ta + length:
                busy = min(busy, max(j, int((due - ta) / (length * share))))
            if busy > j:
                j, s1, fallen1 = busy, busy * share, fall_each * busy
                u1 = float(strip[cascade.FIRST + j * STRIDE + k])
                q1 = float(strip[cascade.SECOND + j * STRIDE + k])
                if j == count:
                    break
        j += 1
        s0, u0, q0, light0, fallen0 = s1, u1, q1, light1, fallen1
        if way.alone:
            s1 = _place(way, j)
        else:
            s1 = j * share if j < count else 1.0
            u1 = float(strip[cascade.FIRST + j * STRIDE + k])
            q1 = float(strip[cascade.SECOND + j * STRIDE + k])
        span = s1 - s0
        h, d, x = span * length, span * way.dx, way.x0 + s0 * way.dx
        t0 = ta + s0 * length
        on_log = x + 0.5 * d >= circuit.knee
        dark, per_dn = circuit.dark * h, circuit.per_dn * h
        fall = on_level * circuit.leak * h
        if follows_light:
            middle = _light(x + 0.5 * d, on_log, circuit)
            light1 = _light(x + d, on_log, circuit)
            mean = (light0 + 4.0 * middle + light1) * _SIXTH
            fall += on_level * circuit.photo_leak * mean * h
        fallen1 = fallen0 + fall
        if way.alone:
            u1 = _after(u0, d, dark + per_dn * mean, per_dn * (light1 - light0))
        on0, on1 = on_0 + on_rise * s0, on_0 + on_rise * s1
        off0, off1 = off_0 + off_rise * s0, off_0 + off_rise * s1
        idle = hold >= t0 + h or s1 <= s_from
        if hold < 0.0 and due >= t0 + h and follows_light and not way.alone:
            away = x - reference
            idle |= not _may_fire(
                u0, u1, q0, q1, away, away + d, factor * fallen0, factor * fallen1, min(on0, on1),
                min(off0, off1),
            )  # fmt: skip
        if idle and not way.alone:
            continue
        if not follows_light:
            light0, light1 = _light(x, on_log, circuit), _light(x + d, on_log, circuit)
        w0, w1 = dark + per_dn * light0, dark + per_dn * light1
        slope0, slope1 = -(w0 * u0 + d), -(w1 * u1 + d)
        # how the corner changes: with the light, which grows by itself or in a line
        g0 = per_dn * (light0 * d if on_log else circuit.slope * d)
        g1 = per_dn * (light1 * d if on_log else circuit.slope * d)
        bend0, bend1 = -(g0 * u0 + w0 * slope0), -(g1 * u1 + w1 * slope1)
        lag = lag_curve(u0, slope0, bend0, u1, slope1, bend1, q0, d, circuit.follower * h)
        if way.alone:
            q1 = value(lag, 1.0)
            q1 = q1 if abs(q1) > screen.AT_REST else 0.0
            if idle:
                continue
        l0 = on_level * (circuit.leak + circuit.photo_leak * light0) * h
        l1 = on_level * (circuit.leak + circuit.photo_leak * light1) * h
        step = _Substep(
            t0, h, x, d, on0, on1, off0, off1, fallen0, l0, 3.0 * fall - 2.0 * l0 - l1,
            l0 + l1 - 2.0 * fall,
        )  # fmt: skip
        place = max((s_from - s0) / span, 0.0)
        n, place, reference, factor = _fire(
            i, place, step, lag, reference, factor, t_base, circuit, state, keys, times, n
        )
        if place != DONE:
            state[per_pixel.REFERENCE, i] = reference
            return n, s0 + place * span
        hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    state[per_pixel.REFERENCE, i] = reference - factor * fallen1
    strip[screen.LAG_1 + k] = u1
    strip[cascade.SECOND + substeps * STRIDE + k] = q1
    watch(k, i, way.x0 + way.dx, start, circuit, state, strip)
    return n, DONE


@kernel
def solve_flagged(
    lo, j, m, s, ta, length, start, substeps, levels, t_base, circuit, state, strip, pixels, keys,
    times, n,
):  # fmt: skip
    """Events of the flagged pixels, from the j-th of m on, which is solved from place s on.

    Returns the number of events, and j and s where it stopped: j = m, or there was no room left.
    """
    state, strip, pixels, keys, times = borrowed(state, strip, pixels, keys, times)
    while j < m:
        n, s = _solve(
            lo, pixels[j], s, ta, length, start, substeps, levels, t_base, circuit, state, strip,
            keys, times, n,
        )  # fmt: skip
        if s != DONE:
            break
        j, s = j + 1, 0.0
    return n, j, s
