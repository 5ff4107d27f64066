"""Pixels at rest: constant light, no lag left, so that only leak and noise events move anything.

The distance of the signal from the falling reference is a straight line: no place has to be
searched for, and the time at which a pixel has to be solved next is known as soon as it is at
rest.  So a strip goes block by block, not interval by interval: each from one interval in which a
pixel of it is due to the next.  The fall of the references in between is subtracted afterwards,
interval by interval all the same, as the sum must round as it would if the strip were not at rest.
"""

from __future__ import annotations

import numpy as np

from adv2e.causes import SIGNAL
from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.comparator import TIE, cause_by_leak, fire, note_reset, with_room
from adv2e.kernel.inputs import Interval
from adv2e.kernel.leak import fill_falls, leaks, lower_references
from adv2e.kernel.noise import NONE, next_noise, noise_within, take_noise
from adv2e.kernel.screen import EARLY, log_of, watch
from adv2e.kernel.work_queue import STRIP

BLOCK = 64
"""Pixels that are looked through together where something is due."""

DONE = -1.0
"""Place of a pixel that is at the end of its interval."""

_f = np.float32
_ZERO, _TINY = _f(0.0), _f(1e-30)
_EARLY, _NEVER = _f(EARLY), _f(screen.NEVER)


@kernel
def _when(k, now, strip):
    """Time at which pixel k of the strip has to be solved, from its distance at `now`."""
    away = strip[screen.AWAY_0 + k]
    left = strip[screen.ON + k] - away
    leaked = (now + left / (strip[screen.FALL + k] + _TINY)) * _EARLY
    beyond = (left <= _ZERO) | (-away >= strip[screen.OFF + k])
    return -_NEVER if beyond else min(strip[screen.DUE + k], leaked)


@kernel
def _note_soonest(b, strip):
    """Row SOONEST of the block that begins at pixel b."""
    # by halves, as a minimum over a row does not vectorise; the quadrature's row is free at rest
    half = BLOCK // 2
    for k in range(half):
        strip[screen.TOTAL + k] = min(strip[screen.WHEN + b + k], strip[screen.WHEN + b + half + k])
    for k in range(half // 2):
        strip[screen.TOTAL + k] = min(strip[screen.TOTAL + k], strip[screen.TOTAL + half // 2 + k])
    soonest = strip[screen.TOTAL]
    for k in range(1, half // 2):
        soonest = min(soonest, strip[screen.TOTAL + k])
    strip[screen.SOONEST + b // BLOCK] = soonest


@kernel
def begin_rest(now, strip):
    """Set the times at which pixels have to be solved, for a strip that comes to rest at `now`.

    Row FALL holds the fall of the references in a microsecond.
    """
    for k in range(STRIP):
        strip[screen.WHEN + k] = _when(k, now, strip)
    for b in range(0, STRIP, BLOCK):
        _note_soonest(b, strip)


@kernel
def end_rest(lo, count, circuit, state, strip):
    """Row AWAY_0 of a strip that is at rest no longer: leak has gone on."""
    for k in range(count):
        x = log_of(np.float64(strip[screen.LIGHT_0 + k]), circuit)
        strip[screen.AWAY_0 + k] = x - state[per_pixel.REFERENCE, lo + k]


@kernel
def _lower_block(i, b, size, state, falls):
    """Take the falls from the references of a block."""
    reference, fall = state[per_pixel.REFERENCE, i : i + size], falls[b : b + size]
    for k in range(size):
        reference[k] -= fall[k]


@kernel
def next_due(b, first, last, starts, strip):
    """Return the first of the intervals first..last in which a pixel of the block is due."""
    soonest = strip[screen.SOONEST + b // BLOCK]
    f = first
    while f < last and soonest >= _f(starts[f + 1] - starts[0]):
        f += 1
    return f


@kernel
def flag_block(b, size, end, strip, index):
    """Flag the pixels of a block that are due before `end`, and fill `index` with them.

    Returns their number.
    """
    for k in range(BLOCK):
        strip[screen.HIT + b + k] = _f(1.0) if strip[screen.WHEN + b + k] < end else _ZERO
    m = 0
    for k in range(size):
        index[m] = b + k
        m += 1 if strip[screen.HIT + b + k] > _ZERO else 0
    return m


@kernel
def _go_on(b, m, end, strip, index):
    """Make the end of an interval the start of the next, for the m pixels that were flagged."""
    for j in range(m):
        k = index[j]
        strip[screen.AWAY_0 + k] = strip[screen.AWAY_1 + k]
        strip[screen.LAG_0 + k] = strip[screen.LAG_1 + k]
        strip[screen.WHEN + k] = _when(k, end, strip)
    _note_soonest(b, strip)


@kernel
def _solve(k, i, s, interval, circuit, state, memory, buffer, n):
    """Events of one pixel, number k of its strip and i of all, over an interval at rest.

    Returns the number of events and DONE, or, where there is no room left for them, the place from
    which to go on.  Leaves the pixel's rows of the screen as they are at the end of the interval.
    """
    strip, falls = memory.rows, memory.falls
    ta, length, most = interval.start, interval.length, buffer.keys.shape[0]
    light = np.float64(strip[screen.LIGHT_1 + k])
    x, fall = log_of(light, circuit), falls[k]
    on, off = state[per_pixel.ON, i] + TIE, state[per_pixel.OFF, i] + TIE
    reference = state[per_pixel.REFERENCE, i]
    noise = next_noise(i, circuit, state)[1]
    while True:
        if n == most:
            state[per_pixel.REFERENCE, i] = reference
            return n, s
        hold = state[per_pixel.HOLD, i]
        if hold >= 0.0:
            s = max(s, (hold - ta) / length)
            if s >= 1.0:
                break
            reference = x + fall * s
            state[per_pixel.HOLD, i] = -1.0
            if circuit.causes:
                state[per_pixel.RESET, i] = x
        kind, t_end, s_end = NONE, ta + length, 1.0
        if noise < ta + length:
            kind, t_end = noise_within(i, ta + s * length, ta + length, circuit, state)
            noise = next_noise(i, circuit, state)[1]
            if kind != NONE:
                s_end = max(s, (t_end - ta) / length)
        away = x - reference
        polarity, level, cause = 0, 0.0, kind
        if away + fall * s_end >= on:
            polarity, level = 1, state[per_pixel.ON, i]
            s = max(s, min(s_end, (on - away) / fall if fall > 0.0 else 0.0))
            cause = cause_by_leak(i, polarity, reference - fall * s, circuit, state)
        elif away + fall * s <= -off:
            polarity, level, cause = -1, -state[per_pixel.OFF, i], SIGNAL
        elif kind == NONE:
            break
        else:
            s = s_end
            polarity = take_noise(i, kind, light, circuit, state)
            noise = next_noise(i, circuit, state)[1]
            if polarity == 0:
                continue
            level = away + fall * s
        when = ta + s * length
        n = fire(i, when, polarity, cause, circuit, state, buffer, n)
        if circuit.leak_jitter > 0.0:
            fill_falls(i, k, 1, 1.0, circuit, state, memory)
            strip[screen.FALL + k] = falls[k]
            fill_falls(i, k, 1, length, circuit, state, memory)
            reference += (falls[k] - fall) * s
            fall = falls[k]
        if circuit.dead_time > 0.0:
            state[per_pixel.HOLD, i] = when + circuit.dead_time
        else:
            reference += level
        note_reset(i, reference - fall * s, circuit, state)
    state[per_pixel.REFERENCE, i] = reference - fall
    strip[screen.LAG_1 + k] = 0.0
    watch(k, i, x, interval.origin, circuit, state, strip)
    return n, DONE


@kernel
def _solve_block(lo, j, m, s, interval, circuit, state, memory, buffer, n):
    """Events of the flagged pixels, from the j-th of m on, which is solved from place s on.

    Returns the number of events, and j and s where it stopped: j = m, or there was no room left.
    """
    (buffer,) = borrowed(buffer)
    while j < m:
        k = memory.pixels[j]
        n, s = _solve(k, lo + k, s, interval, circuit, state, memory, buffer, n)
        if s != DONE:
            return n, j, s
        j, s = j + 1, 0.0
    return n, j, s


@kernel
def go_through(lo, count, first, last, starts, circuit, state, memory, buffer, n):
    """Advance a strip at rest over the intervals first..last; returns number of events and buffer.

    starts : (intervals + 1,) ends of all intervals [us]
    """
    strip, pixels, origin, has_leak = memory.rows, memory.pixels, starts[0], leaks(circuit)
    for b in range(0, count, BLOCK):
        i, size, f = lo + b, min(BLOCK, count - b), first
        while True:
            due = next_due(b, f, last, starts, strip)
            if has_leak:
                for c in range(f, due):
                    length = starts[c + 1] - starts[c]
                    fill_falls(i, b, size, length, circuit, state, memory)
                    _lower_block(i, b, size, state, memory.falls)
            if due == last:
                break
            f = due + 1
            length, end = starts[f] - starts[due], _f(starts[f] - origin)
            m = flag_block(b, size, end, strip, pixels)
            if has_leak:
                fill_falls(i, b, size, length, circuit, state, memory)
                lower_references(i, b, size, state, memory)
            interval = Interval(due, origin, starts[due], length)
            j, s = np.int64(0), 0.0
            while j < m:
                buffer = with_room(buffer, n, n + 1)
                n, j, s = _solve_block(lo, j, m, s, interval, circuit, state, memory, buffer, n)
            _go_on(b, m, end, strip, pixels)
    return n, buffer
