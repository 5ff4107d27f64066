"""The events of one pixel within a substep, with photoreceptor noise: where that may matter."""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel
from adv2e.kernel.cascade.curve import bent, value
from adv2e.kernel.cascade.substep import DONE, Cubic, fire_until, may_fire
from adv2e.kernel.noise import next_noise
from adv2e.kernel.photoreceptor import bridge


@kernel
def bounds_over(s0, s1, own):
    """Bounds of what is seen of the noise of a pixel between two places of its piece."""
    m = own[bridge.SAMPLES]
    first, last = int(s0 * m), int(min(s1 * m, m - 1.0))
    high, low = own[bridge.HIGH + first], own[bridge.LOW + first]
    for c in range(first + 1, last + 1):
        high, low = max(high, own[bridge.HIGH + c]), min(low, own[bridge.LOW + c])
    return high, low


@kernel
def _is_clear(hold, due, until, high, low, step, reference, factor):
    """Tell whether nothing happens to a pixel in a part of a substep that ends `until` [us].

    hold : end of the dead time [us], -1: not in it
    due : when something happens by itself [us]
    high, low : bounds of its signal
    """
    if hold >= 0.0:
        return hold >= until
    leaked = step.fallen + step.leak1 + step.leak2 + step.leak3
    return due >= until and not may_fire(
        high - reference, low - reference, factor * step.fallen, factor * leaked,
        min(step.on0, step.on1), min(step.off0, step.off1),
    )  # fmt: skip


@kernel
def _bounds(x0, x1, room, most, least):
    """Bounds of the signal between two places, given it there, its curvature, and other bounds."""
    return min(max(x0, x1) + room, most), max(min(x0, x1) - room, least)


@kernel
def _fire_between(
    i, c, place, s0, span, signal, curved, most, least, step, reference, factor, t_base, circuit,
    state, own, keys, times, n,
):  # fmt: skip
    """Fire the events between samples c and c + 1 as far as they are in the substep.

    What is between is halved where something may happen, down to cells.
    """
    m, q = own[bridge.SAMPLES], np.int64(own[bridge.CELLS])
    width = 1.0 / (m * q * span)  # of a cell, as a part of the substep
    begin = (c / m - s0) / span
    corner = circuit.follower * step.h * width
    hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    bridge.enter(c, own)
    # from cell a on, up to the last of the ends
    a, depth, t0 = np.int64(0), np.int64(1), max(begin, 0.0)
    x0 = value(signal, t0)
    own[bridge.ENDS] = q
    own[bridge.SIGNALS] = value(signal, min(begin + q * width, 1.0))
    while depth > 0 and begin + a * width < 1.0:
        b, x1 = np.int64(own[bridge.ENDS + depth - 1]), own[bridge.SIGNALS + depth - 1]
        t1 = min(begin + b * width, 1.0)
        clear = t1 <= place
        if not clear:
            high, low = bridge.bounds_of_cells(a, b, corner, own)
            x_high, x_low = _bounds(x0, x1, curved * (t1 - t0) * (t1 - t0), most, least)
            clear = _is_clear(
                hold, due, step.t0 + t1 * step.h, x_high + high, x_low + low, step, reference,
                factor,
            )  # fmt: skip
        if not clear and b - a > 1:
            r = (a + b) >> 1
            bridge.draw_at(
                i, c, r, a, b, circuit.follower > 0.0, circuit.noise_rms, circuit.seed, own
            )
            own[bridge.ENDS + depth] = r
            own[bridge.SIGNALS + depth] = value(signal, min(max(begin + r * width, 0.0), 1.0))
            depth += 1
            continue
        if not clear:
            c0, c1, c2, c3 = bridge.cubic_of(a, begin + a * width, width, corner, own)
            n, stopped, reference, factor = fire_until(
                i, max(begin + a * width, place), t1, step, signal, Cubic(c0, c1, c2, c3),
                reference, factor, t_base, circuit, state, keys, times, n,
            )  # fmt: skip
            if stopped != DONE:
                return n, stopped, reference, factor
            hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
        a, x0, t0, depth = b, x1, t1, depth - 1
    return n, DONE, reference, factor


@kernel
def fire_in_cells(
    i, place, s0, span, hull, step, signal, reference, factor, t_base, circuit, state, own, keys,
    times, n,
):  # fmt: skip
    """Fire the events of pixel i in a substep from `place` on.

    Parameters
    ----------
    s0, span : float
        Where the substep is in its piece.
    hull : (2,) float
        Bounds of the signal without noise, less x at the start of the substep.
    own : flat float64
        See :mod:`adv2e.kernel.photoreceptor.bridge`.

    The others, and what is returned, are those of
    :func:`adv2e.kernel.cascade.substep.fire_until`.
    """
    m = own[bridge.SAMPLES]
    curved, most, least = 0.125 * bent(signal, signal.swing), step.x + hull[0], step.x + hull[1]
    hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    c = np.int64(min((s0 + place * span) * m, m - 1.0))
    t0 = max((c / m - s0) / span, 0.0)
    x0 = value(signal, t0)
    while c < m and t0 < 1.0:
        t1 = min(((c + 1) / m - s0) / span, 1.0)
        x1 = value(signal, t1)
        high, low = _bounds(x0, x1, curved * (t1 - t0) * (t1 - t0), most, least)
        high, low = high + own[bridge.HIGH + c], low + own[bridge.LOW + c]
        until = step.t0 + t1 * step.h
        if not _is_clear(hold, due, until, high, low, step, reference, factor):
            n, stopped, reference, factor = _fire_between(
                i, c, place, s0, span, signal, curved, most, least, step, reference, factor,
                t_base, circuit, state, own, keys, times, n,
            )  # fmt: skip
            if stopped != DONE:
                return n, stopped, reference, factor
            hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
        c, t0, x0 = c + 1, t1, x1
    return n, DONE, reference, factor
