"""The events of one pixel that may fire, substep by substep through one piece of an interval."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen, special
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import screen as cascade
from adv2e.kernel.cascade.plan import FEWEST, GROWTH, LONGEST
from adv2e.kernel.cascade.substep import (
    DONE,
    NO_NOISE,
    Cubic,
    Substep,
    fire_until,
    hull,
    lag_curve,
    leak_factor,
    light_of,
    may_fire,
    plus,
    value,
)
from adv2e.kernel.leak import fall_over, leak_rate
from adv2e.kernel.noise import next_noise
from adv2e.kernel.photoreceptor import path as noise
from adv2e.kernel.screen import STRIDE, log_of, watch

# ---- The events of one pixel within a substep, with photoreceptor noise: where that may matter.


_THIRD = 1.0 / 3.0


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
def fire_in_cells(i, c, place, hull, step, signal, circuit, state, path, buffer, n):
    """Fire the events of pixel i, which is in lane c, in a substep from `place` on.

    hull : (2,) float
        Bounds of the signal without noise, less x at the start of the substep.
    path : NoisePath
        Of the noise.

    The others, and what is returned, are those of
    :func:`adv2e.kernel.cascade.substep.fire_until`.
    """
    rows, seen, s0, span = path.rows, noise.seen_from(circuit), step.place, step.span
    samples, levels = noise.grid(path)
    cells = samples << levels
    reference, factor = state[per_pixel.REFERENCE, i], leak_factor(i, circuit, state)
    width = 1.0 / (cells * span)  # of a cell, as a part of the substep
    corner = circuit.follower * step.h * width
    least, most = step.x + hull[1], step.x + hull[0]
    hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    r, fired = np.int64(min((s0 + place * span) * cells, cells - 1.0)), False
    begin = (r / cells - s0) / span
    while r < cells and begin < 1.0:
        if fired:
            high, low = most + rows[noise.HIGH + c], least + rows[noise.LOW + c]
            if _is_clear(hold, due, step.t0 + step.h, high, low, step, reference, factor):
                break
        fired, j, after = False, r >> levels, r + 1
        if noise.is_known(j, c, rows):
            high, low = noise.bounds_of_cell(r, c, np.float32(corner * _THIRD), seen, rows)
        else:
            after = (j + 1) << levels
            high, low = noise.bounds_of_stretch(j, c, levels, seen, rows)
        end = min((after / cells - s0) / span, 1.0)
        until = step.t0 + end * step.h
        if not _is_clear(hold, due, until, most + high, least + low, step, reference, factor):
            if not noise.is_known(j, c, rows):
                noise.wait(0, c, j, path)
                noise.draw_stretches(1, levels, circuit, path)
                continue
            c0, c1, c2, c3 = noise.cubic_of(r, c, begin, width, corner, seen, rows)
            n, stopped = fire_until(
                i, max(begin, place), end, step, signal, Cubic(c0, c1, c2, c3), circuit, state,
                buffer, n,
            )  # fmt: skip
            if stopped != DONE:
                return n, stopped
            reference, factor = state[per_pixel.REFERENCE, i], leak_factor(i, circuit, state)
            hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
            fired = True
        r, begin = after, end
    return n, DONE


_SIXTH = 1.0 / 6.0
_LARGEST_RATIO = math.tanh(0.5 * cascade.LARGEST_STEP)


class _Passage(NamedTuple):
    """Course of a pixel's light through a piece, and the substeps that it needs."""

    x0: float  # log intensity at its start
    dx: float  # by which that changes
    rests: bool  # whether neither light nor lag changes
    alone: bool  # whether the lags that the screen keeps do not hold; then:
    knee: float  # where the light passes the knee of the log map; 1: nowhere
    bend: float  # where the light bent before that; at the start of the piece or before
    shortest: float  # substep at a bend,
    longest: float  # and anywhere


@kernel
def _passage(k, length, before, circuit, strip):
    """Return the course of light and the substeps of pixel k in a piece of `length` us.

    before : time from the interval's start to that of the piece, in lengths of the piece
    """
    i0, i1 = float(strip[screen.LIGHT_0 + k]), float(strip[screen.LIGHT_1 + k])
    x0 = log_of(i0, circuit)
    dx = log_of(i1, circuit) - x0
    knee_dn = circuit.slope * circuit.knee
    mixed = (i0 < knee_dn) != (i1 < knee_dn)
    brightest, steep = max(i0, i1), abs(dx) / cascade.LARGEST_STEP
    # a little less than what the screen takes for steep, which rounds otherwise
    alone = abs(i1 - i0) > 0.99 * _LARGEST_RATIO * (i0 + i1) or steep > 0.99
    if not (alone or mixed or brightest > 0.99 * screen.LARGEST_LIGHT):
        rests = i0 == i1 and strip[screen.LAG_0 + k] == 0.0 and strip[cascade.SECOND + k] == 0.0
        return _Passage(x0, dx, rests, False, 1.0, 0.0, 1.0, 1.0)
    corner = (circuit.dark + circuit.per_dn * brightest) * length
    knee = min(max((circuit.knee - x0) / dx, 0.0), 1.0) if mixed and dx != 0.0 else 1.0
    shortest = LONGEST / corner if corner > LONGEST else 1.0
    return _Passage(x0, dx, False, True, knee, -before, shortest, 1.0 / (FEWEST * max(steep, 1.0)))


@kernel
def _next_place(way, s):
    """End of the substep that begins at s, for a pixel with substeps of its own."""
    bend, end = (way.bend, way.knee) if s < way.knee else (way.knee, 1.0)
    after = s + min(max(way.shortest, GROWTH * (s - bend)), way.longest)
    # no short one at the end
    return after if end - after > 0.1 * (after - s) else end


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
def _first_busy(k, j, count, places, away, dx, fall, on, off, due, strip):
    """Return the first substep from j on in which pixel k may fire, else `count`.

    places : ends of the substeps in the piece; away : distance of x from the reference at its
    start; dx, fall : change of that distance by x and by leak over the piece; due : place of the
    next noise event.
    """
    u1 = float(strip[cascade.FIRST + j * STRIDE + k])
    q1 = float(strip[cascade.SECOND + j * STRIDE + k])
    while j < count and due >= places[j + 1]:
        u0, q0, span = u1, q1, places[j + 1] - places[j]
        away_j = away + (dx + fall) * places[j]
        u1 = float(strip[cascade.FIRST + (j + 1) * STRIDE + k])
        q1 = float(strip[cascade.SECOND + (j + 1) * STRIDE + k])
        high, low = hull(u0, u1, q0, q1, dx * span)
        if may_fire(away_j + high, away_j + low, 0.0, fall * span, on, off):
            break
        j += 1
    return j


@kernel
def _solve(k, i, c, s_from, piece, circuit, path, state, strip, buffer, n):
    """Events of one pixel, number k of its strip and i of all, over a piece.

    Parameters
    ----------
    c : int
        Lane of its noise.
    s_from : float
        Place before which there is no event, or from which to go on.
    path : NoisePath
        Photoreceptor noise.

    Returns
    -------
    Number of events so far, and DONE, or, where there is no room left for them, the place from
    which to go on.  The rows of the pixel are then those at the end of the piece.
    """
    length, substeps, places, levels = piece.length, piece.substeps, piece.places, piece.levels
    way = _passage(k, length, piece.before, circuit, strip)
    on_level, off_level = state[per_pixel.ON, i], state[per_pixel.OFF, i]
    on_0, on_rise = on_level * levels[0], on_level * (levels[1] - levels[0])
    off_0, off_rise = off_level * levels[0], off_level * (levels[1] - levels[0])
    reference, factor = state[per_pixel.REFERENCE, i], leak_factor(i, circuit, state)
    light1, fallen1, s1 = float(strip[screen.LIGHT_0 + k]), 0.0, 0.0
    u1, q1 = float(strip[cascade.FIRST + k]), float(strip[cascade.SECOND + k])
    follows_light = way.alone or circuit.photo_leak > 0.0
    hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    # substeps in which nothing happens are passed quickly, where they differ in lags alone
    skims, fall_all = not (follows_light or way.rests), fall_over(on_level, length, 0.0, circuit)
    least_on, least_off = min(on_0, on_0 + on_rise), min(off_0, off_0 + off_rise)
    is_noisy, noise_high, noise_low = circuit.noise_rms > 0.0, 0.0, 0.0
    if is_noisy:
        noise_high, noise_low = float(path.rows[noise.HIGH + c]), float(path.rows[noise.LOW + c])
    j = 0
    while s1 < 1.0:
        if skims and (hold < 0.0 or s1 < s_from):
            while j < substeps and places[j + 1] <= s_from:
                j += 1
            if hold < 0.0:
                j = _first_busy(
                    k, j, substeps, places, way.x0 - reference, way.dx, factor * fall_all,
                    least_on - noise_high, least_off + noise_low, (due - piece.start) / length,
                    strip,
                )  # fmt: skip
            s1, fallen1 = places[j], fall_all * places[j]
            u1 = float(strip[cascade.FIRST + j * STRIDE + k])
            q1 = float(strip[cascade.SECOND + j * STRIDE + k])
            if j == substeps:
                break
        s0, u0, q0, light0, fallen0 = s1, u1, q1, light1, fallen1
        if way.alone:
            s1 = _next_place(way, s0)
        else:
            j = substeps if way.rests else j + 1
            s1 = places[j]
            u1 = float(strip[cascade.FIRST + j * STRIDE + k])
            q1 = float(strip[cascade.SECOND + j * STRIDE + k])
        span = s1 - s0
        h, d, x = span * length, span * way.dx, way.x0 + s0 * way.dx
        t0 = piece.start + s0 * length
        on_log = x + 0.5 * d >= circuit.knee
        dark, per_dn = circuit.dark * h, circuit.per_dn * h
        mean = 0.0
        if follows_light:
            middle = light_of(x + 0.5 * d, on_log, circuit)
            light1 = light_of(x + d, on_log, circuit)
            mean = (light0 + 4.0 * middle + light1) * _SIXTH
        fall = fall_over(on_level, h, mean, circuit)
        fallen1 = fallen0 + fall
        if way.alone:
            u1 = _after(u0, d, dark + per_dn * mean, per_dn * (light1 - light0))
        on0, on1 = on_0 + on_rise * s0, on_0 + on_rise * s1
        off0, off1 = off_0 + off_rise * s0, off_0 + off_rise * s1
        idle = hold >= t0 + h or s1 <= s_from
        if hold < 0.0 and due >= t0 + h and not (skims or way.alone):
            high, low = hull(u0, u1, q0, q1, d)
            high, low = high + noise_high, low + noise_low
            idle |= not may_fire(
                x - reference + high, x - reference + low, factor * fallen0, factor * fallen1,
                min(on0, on1), min(off0, off1),
            )  # fmt: skip
        if idle and not way.alone:
            continue
        if not follows_light:
            light0, light1 = light_of(x, on_log, circuit), light_of(x + d, on_log, circuit)
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
        l0 = on_level * leak_rate(light0, circuit) * h
        l1 = on_level * leak_rate(light1, circuit) * h
        step = Substep(
            s0, span, t0, h, x, d, on0, on1, off0, off1, fallen0, l0,
            3.0 * fall - 2.0 * l0 - l1, l0 + l1 - 2.0 * fall,
        )  # fmt: skip
        signal = plus(lag, x, d, 0.0, 0.0)
        place = max((s_from - s0) / span, 0.0)
        if is_noisy:
            n, place = fire_in_cells(
                i, c, place, hull(u0, u1, q0, q1, d), step, signal, circuit, state, path, buffer, n
            )
        else:
            n, place = fire_until(i, place, 1.0, step, signal, NO_NOISE, circuit, state, buffer, n)
        if place != DONE:
            return n, s0 + place * span
        reference, factor = state[per_pixel.REFERENCE, i], leak_factor(i, circuit, state)
        hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    state[per_pixel.REFERENCE, i] = reference - factor * fallen1
    strip[screen.LAG_1 + k] = u1
    strip[cascade.SECOND + substeps * STRIDE + k] = q1
    watch(k, i, way.x0 + way.dx, piece.origin, circuit, state, strip)
    return n, DONE


@kernel
def solve_flagged(lo, j, m, s, piece, circuit, state, memory, buffer, n):
    """Events of the flagged pixels, from the j-th of m on, which is solved from place s on.

    Beside noise, `found` of the second look has the places from which on there may be events;
    beyond 1: none.

    Returns the number of events, and j and s where it stopped: j = m, or there was no room left.
    """
    piece, state, memory, buffer = borrowed(piece, state, memory, buffer)
    strip, pixels, path = memory.strip.rows, memory.strip.pixels, memory.cascade.path
    is_noisy, found = circuit.noise_rms > 0.0, memory.cascade.look.found
    while j < m:
        k, first = pixels[j], found[j] if is_noisy else 0.0
        if first > 1.0:
            strip[screen.HIT + k] = 0.0
        else:
            n, s = _solve(
                k, lo + k, j, max(s, first), piece, circuit, path, state, strip, buffer, n
            )
            if s != DONE:
                break
        j, s = j + 1, 0.0
    return n, j, s
