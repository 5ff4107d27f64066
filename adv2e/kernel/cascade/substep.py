"""Events of one pixel within a substep in which light, lags, noise and leak are known."""

from __future__ import annotations

from typing import NamedTuple

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, special
from adv2e.kernel.cascade.curve import (
    NOWHERE,
    at,
    bent,
    first_reach,
    mirrored,
    plus,
    value,
)
from adv2e.kernel.causes import cause_by_most, note_parts
from adv2e.kernel.comparator import TIE, fire
from adv2e.kernel.noise import NONE, noise_within, take_noise

DONE = -1.0
"""Place of a pixel that is at the end of its piece."""


class Cubic(NamedTuple):
    """A cubic of the place in a substep."""

    c0: float
    c1: float
    c2: float
    c3: float


NO_NOISE = Cubic(0.0, 0.0, 0.0, 0.0)


class Substep(NamedTuple):
    """Light, thresholds and leak of a pixel in a substep."""

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


@kernel
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


@kernel
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
def fire_until(
    i, t, upto, step, signal, noise, reference, factor, t_base, circuit, state, keys, times, n
):  # fmt: skip
    """Fire the events of pixel i in a substep from t on, until `upto`.

    signal, noise : signal by the light alone, and the photoreceptor noise on top of it

    Returns the number of events; DONE or the place at which the buffer was full; the reference, as
    if leak had always had its present speed; and that speed.
    """
    jitter, h = circuit.leak_jitter > 0.0, step.h
    on_level, off_level = state[per_pixel.ON, i], state[per_pixel.OFF, i]
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
        if n == keys.shape[0]:
            return n, t, reference, factor
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
            return n, DONE, reference, factor
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
        n = fire(i, when, polarity, cause, t_base, circuit, state, keys, times, n)
        before = factor
        factor = state[per_pixel.LEAK_FACTOR, i] if jitter else 1.0
        level = on_level if polarity > 0 else -off_level
        beyond = circuit.overshoot * level
        if circuit.dead_time > 0.0:
            hold = when + circuit.dead_time
            if hold >= step.t0 + upto * h:
                state[per_pixel.HOLD, i] = hold
                state[per_pixel.BEYOND, i] = beyond
                return n, DONE, reference, factor
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
