"""Circuits without a filter: the signal is a line from instant to instant, through the light there.

From one frame to the next the light of a pixel only rises or only falls, and its logarithm with it.
So the signal at the next frame shows which pixels may fire before it, and only these go through the
instants in between.  They are solved as the stepped solver does, in rows of their own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import SIGNAL
from adv2e.compiled import kernel
from adv2e.kernel import per_pixel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.comparator import TIE, fire, with_room
from adv2e.kernel.inputs import EXACT, Circuit, rests
from adv2e.kernel.stepped import events, rows
from adv2e.kernel.stepped.driver import ROOM, TimeStep, load_x
from adv2e.kernel.stepped.signal import NO_POLE, log_of_light
from adv2e.kernel.work_queue import claim


class UnfilteredMemory(NamedTuple):
    """Memory of whoever works on a strip."""

    strip: NDArray[np.float64]  # rows of all of its pixels
    few: NDArray[np.float64]  # rows of those that may fire before the next frame
    light: NDArray[np.float32]
    pixels: NDArray[np.int64]  # numbers of the latter within the strip
    hits: NDArray[np.int64]  # and, within those, of the ones that may fire before the next instant


def new_memory() -> UnfilteredMemory:
    """Return fresh memory."""
    numbers = np.zeros((2, rows.WIDTH + 16), np.int64)
    light = np.zeros(rows.WIDTH, np.float32)
    return UnfilteredMemory(rows.new_rows(), rows.new_rows(), light, *numbers)


def covers(circuit: Circuit) -> bool:
    """Tell whether this module advances the circuit, where nothing is added to it at steps."""
    plain = circuit.update == EXACT and not circuit.printed and not circuit.filtered
    poles = max(circuit.slew, circuit.follower, circuit.high, circuit.noise_rms)
    return plain and max(poles, circuit.leak, circuit.photo_leak) == 0.0


@kernel
def _next_frame(schedule, f, intervals):
    """Return the end of the intervals from f on within which no pixel's light turns."""
    end = f + 1
    if not schedule.frames.coded:
        before = schedule.before
        while end < intervals and before[end + 1] == before[f + 1]:
            end += 1
    return end


@kernel
def _load_few(at, lo, m, schedule, circuit, memory):
    """Log intensity of the pixels that may fire at an instant between two frames."""
    before, share = schedule.before[at], schedule.share[at]
    first, second = schedule.frames.light[before], schedule.frames.light[before + 1]
    for j in range(m):
        i = lo + memory.pixels[j]
        a = first[i]
        memory.light[j] = max(a + (second[i] - a) * share, np.float32(0.0))
    log_of_light(memory.light[:m], circuit, memory.few[rows.SIGNAL1 : rows.SIGNAL1 + m])


@kernel
def _may_fire(n, x, end, strip, numbers):
    """Return how many of n pixels may fire before `end` [us], their signal going to row `x`."""
    for k in range(n):
        rise = strip[x + k] - strip[rows.REFERENCE + k]
        hit = (rise >= strip[rows.ON + k]) | (-rise >= strip[rows.OFF + k])
        strip[rows.HIT + k] = 1.0 if hit | (strip[rows.DUE + k] < end) else 0.0
    return events.gather(n, strip, numbers)


@kernel
def _happens_alone(circuit):
    """Tell whether pixels fire by their signal alone, and at once again."""
    noise = max(circuit.shot_rate, circuit.hot_rate)
    return max(noise, circuit.dead_time, abs(circuit.overshoot)) == 0.0 and not circuit.causes


@kernel
def _fire_line(j, i, step, circuit, state, few, buffer, n):
    """Fire the events of a pixel to which nothing else happens, as `fire_step` does."""
    rise = few[rows.SLOPE0 + j]
    if rise == 0.0:  # at rest within the tolerance of a level
        return n, True
    polarity = 1 if rise > 0.0 else -1
    level = few[(rows.ON if rise > 0.0 else rows.OFF) + j]
    while n < buffer.keys.shape[0]:
        start = few[rows.SIGNAL0 + j] - few[rows.REFERENCE + j]
        s = -(polarity * start - level - TIE) / (polarity * rise)
        if not s <= 1.0:
            return n, True
        n = fire(i, step.start + max(s, 0.0) * step.h, polarity, SIGNAL, circuit, state, buffer, n)
        few[rows.REFERENCE + j] += polarity * level
    return n, False


@kernel
def _fire_some(c, count, lo, step, circuit, injected, state, memory, buffer, number):
    """Fire the events of the hits c to count, while there is room.

    Returns the first hit that is not done, and the number of events so far.
    """
    injected, state, memory, buffer = borrowed(injected, state, memory, buffer)
    few, levels, alone = memory.few, (1.0, 1.0, 1.0, 1.0), _happens_alone(circuit)
    while c < count and number + ROOM <= buffer.keys.shape[0]:
        j = memory.hits[c]
        rise = few[rows.SIGNAL1 + j] - few[rows.SIGNAL0 + j]
        few[rows.SLOPE0 + j] = few[rows.SLOPE1 + j] = few[rows.MOVE + j] = rise
        few[rows.X1 + j] = few[rows.SIGNAL1 + j]
        i = lo + memory.pixels[j]
        if alone:
            number, whole = _fire_line(j, i, step, circuit, state, few, buffer, number)
        else:
            number, whole = events.fire_step(
                j, i, step, levels, circuit, injected, state, few, buffer, number
            )
        c += whole
    return c, number


@kernel
def _go_through(lo, m, f, end, schedule, circuit, injected, state, memory, buffer, number):
    """Advance the m pixels that may fire from instant f to `end`."""
    strip, few, pixels, starts = memory.strip, memory.few, memory.pixels, schedule.starts
    for row in (rows.REFERENCE, rows.ON, rows.OFF, rows.DUE, rows.FROM, rows.XA):
        for j in range(m):
            few[row + j] = strip[row + pixels[j]]
    for j in range(m):
        few[rows.SIGNAL1 + j] = few[rows.XA + j]
    for s in range(f, end):
        for j in range(m):
            few[rows.SIGNAL0 + j] = few[rows.SIGNAL1 + j]
        if s + 1 < end:
            _load_few(s + 1, lo, m, schedule, circuit, memory)
        else:
            for j in range(m):
                few[rows.SIGNAL1 + j] = strip[rows.XB + pixels[j]]
        length = starts[s + 1] - starts[s]
        step = TimeStep(0, 0, starts[s], length, 1.0, 0.5, NO_POLE, NO_POLE)
        c = np.int64(0)
        count = _may_fire(m, rows.SIGNAL1, starts[s] + length, few, memory.hits)
        while c < count:
            buffer = with_room(buffer, number, number + ROOM)
            c, number = _fire_some(
                c, count, lo, step, circuit, injected, state, memory, buffer, number
            )
    for row in (rows.REFERENCE, rows.ON, rows.OFF, rows.DUE):
        for j in range(m):
            strip[row + pixels[j]] = few[row + j]
    return number, buffer


@kernel
def _strip(lo, count, schedule, circuit, injected, state, memory, buffer, number):
    """Advance one strip over all intervals."""
    schedule, injected, state, memory = borrowed(schedule, injected, state, memory)
    strip, starts = memory.strip, schedule.starts
    f, intervals = np.int64(0), starts.shape[0] - 1
    if _happens_alone(circuit) and not schedule.begins:
        while f < intervals:
            end = _next_frame(schedule, f, intervals)
            if not rests(schedule, end, lo, count):
                break
            f = end
        if f == intervals:  # no signal moves, so that none meets a level
            return number, buffer
    for k in range(count):
        strip[rows.REFERENCE + k] = state[per_pixel.REFERENCE, lo + k]
        events.watch(k, lo + k, circuit, injected, state, strip)
    if schedule.begins:
        load_x(schedule, 0, lo, count, circuit, memory, rows.XA)
    else:
        for k in range(count):
            strip[rows.XA + k] = state[per_pixel.X, lo + k]
    f = np.int64(0)
    while f < intervals:
        end = _next_frame(schedule, f, intervals)
        if rests(schedule, end, lo, count):
            for k in range(count):
                strip[rows.XB + k] = strip[rows.XA + k]
        else:
            load_x(schedule, end, lo, count, circuit, memory, rows.XB)
        m = _may_fire(count, rows.XB, starts[end] + 1.0, strip, memory.pixels)
        if m > 0:
            number, buffer = _go_through(
                lo, m, f, end, schedule, circuit, injected, state, memory, buffer, number
            )
        for k in range(count):
            strip[rows.XA + k] = strip[rows.XB + k]
        f = end
    for k in range(count):
        state[per_pixel.X, lo + k] = strip[rows.XA + k]
        state[per_pixel.FIRST, lo + k] = strip[rows.XA + k]
        state[per_pixel.REFERENCE, lo + k] = strip[rows.REFERENCE + k]
    return number, buffer


@kernel
def run_unfiltered(claimed, most, schedule, circuit, injected, state, memory, buffer):
    """Advance strips that nobody else works on over the intervals between neighbouring frames.

    The arguments, and what is returned, are those of :func:`adv2e.kernel.exact.run_exact`;
    `injected` holds no events.
    """
    number = np.int64(0)
    for _ in range(most):
        lo, hi = claim(claimed, state.shape[1])
        if lo == hi:
            break
        for s in range(lo, hi, rows.WIDTH):
            number, buffer = _strip(
                s, min(rows.WIDTH, hi - s), schedule, circuit, injected, state, memory, buffer,
                number,
            )  # fmt: skip
    return number, buffer
