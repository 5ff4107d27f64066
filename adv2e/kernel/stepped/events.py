"""Events of a strip over one step: all pixels are screened, those that may fire go one by one.

Within the step the signal is the cubic through its values and slopes at both ends, and so is the
reference, which leak lowers.  Thresholds are lines.  A pixel whose Bezier points stay within its
thresholds cannot fire by its signal; the rest is as :mod:`adv2e.kernel.comparator` has it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import OWN_EFFECT
from adv2e.compiled import embedded, inlined, kernel
from adv2e.kernel import per_pixel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.comparator import TIE, cause_by_most, fire, note_parts
from adv2e.kernel.inputs import EXACT
from adv2e.kernel.leak import leak_over
from adv2e.kernel.noise import NONE, next_noise, noise_within, take_noise
from adv2e.kernel.stepped import rows

_THIRD = 1.0 / 3.0
_SIXTH = 1.0 / 6.0
_NEWTON = 50
_NOWHERE = 2.0
_STRAIGHT = 1e-14
"""Curvature over slope that rounding gives a line."""
INJECTED = OWN_EFFECT
"""Kind of an event from outside, beside those of noise."""


class Injected(NamedTuple):
    """Events from outside, pixel by pixel: those of pixel i from next[i] to stop[i]."""

    times: NDArray[np.float64]  # [us]
    on: NDArray[np.bool_]
    next: NDArray[np.int64]
    stop: NDArray[np.int64]


def injected_of(
    times: NDArray[Any], pixel: NDArray[Any], on: NDArray[Any], pixels: int
) -> Injected:
    """Return events (n,) sorted by time, in us, as the kernel takes them."""
    order = np.argsort(pixel, kind="stable")
    ends = np.searchsorted(pixel[order], np.arange(pixels + 1)).astype(np.int64)
    return Injected(
        np.ascontiguousarray(times[order], np.float64),
        np.ascontiguousarray(on[order], np.bool_),
        ends[:-1].copy(),
        ends[1:].copy(),
    )


@kernel
def watch(k, i, circuit, injected, state, strip):
    """Rows of the screen for pixel k of a strip, i of the state."""
    injected, state, strip = borrowed(injected, state, strip)
    hold = state[per_pixel.HOLD, i]
    if hold >= 0.0:
        on, off, due = per_pixel.NEVER, per_pixel.NEVER, hold
    else:
        on, off = state[per_pixel.ON, i], state[per_pixel.OFF, i]
        due = next_noise(i, circuit, state)[1]
        if injected.next.shape[0] > 0 and injected.next[i] < injected.stop[i]:
            due = min(due, injected.times[injected.next[i]])
    strip[rows.ON + k] = on
    strip[rows.OFF + k] = off
    strip[rows.ON_STEP + k] = on
    strip[rows.OFF_STEP + k] = off
    strip[rows.DUE + k] = due
    strip[rows.FROM + k] = 0.0


@kernel
def step_thresholds(count, lo, course, m, row, step_row, strip):
    """Least threshold of each pixel over the step that instant m of a course ends."""
    before, after = course[m - 1, lo : lo + count], course[m, lo : lo + count]
    for k in range(count):
        least = before[k] if before[k] < after[k] else after[k]
        strip[step_row + k] = strip[row + k] * least


@kernel
def _fall(k, on, leak, strip):
    """Fall of the reference of pixel k over the step, and its slope at both ends [ln a step].

    leak: over the step, constant part and for each DN; on: ON threshold times the leak's speed.
    """
    constant, per_dn = leak
    i0, im, i1 = strip[rows.LIGHT0 + k], strip[rows.LIGHTM + k], strip[rows.LIGHT1 + k]
    fall = on * (constant + per_dn * ((i0 + 4.0 * im + i1) * _SIXTH))
    return fall, on * (constant + per_dn * i0), on * (constant + per_dn * i1)


@embedded
def may_fire(k, d1, d2, d3, on, off, end, strip):
    """Tell whether pixel k may fire before `end`, given Bezier points of its distance.

    on, off: factors on the rows of thresholds.
    """
    high = d1 if d1 > d2 else d2
    high = high if high > d3 else d3
    low = d1 if d1 < d2 else d2
    low = low if low < d3 else d3
    hit = (high >= strip[rows.ON_STEP + k] * on) | (-low >= strip[rows.OFF_STEP + k] * off)
    return hit | (strip[rows.DUE + k] < end)


@kernel
def screen(n, end, leak, on, off, strip):
    """Row HIT: pixels that may fire before `end` [us]; REFERENCE: at the end of the step.

    on, off: factors on the rows of thresholds.  Returns the number of pixels that may fire.
    """
    hits = np.int64(0)
    for k in range(n):
        fall, slope0, slope1 = _fall(k, strip[rows.LEAK_ON + k], leak, strip)
        reference = strip[rows.REFERENCE + k]
        d0, d3 = strip[rows.SIGNAL0 + k] - reference, strip[rows.SIGNAL1 + k] - reference + fall
        d1 = d0 + (strip[rows.SLOPE0 + k] + slope0) * _THIRD
        d2 = d3 - (strip[rows.SLOPE1 + k] + slope1) * _THIRD
        hit = may_fire(k, d1, d2, d3, on, off, end, strip)
        strip[rows.REFERENCE + k] = reference - fall
        strip[rows.HIT + k] = 1.0 if hit else 0.0
        hits += np.int64(hit)
    return hits


@kernel
def gather(n, strip, pixels):
    """Numbers of the pixels that may fire, of which there are few."""
    m, hits = np.int64(0), strip[rows.HIT : rows.HIT + n].view(np.int64)
    whole = n - n % 16
    for first in range(0, whole, 16):
        some, group = np.int64(0), hits[first : first + 16]
        for k in range(16):
            some |= group[k]
        if some != 0:
            for k in range(16):
                pixels[m] = first + k
                m += np.int64(group[k] != 0)
    for k in range(whole, n):
        pixels[m] = k
        m += np.int64(hits[k] != 0)
    return m


@kernel
def _light_of(x, circuit):
    """Light [DN] that log intensity x stands for."""
    if circuit.slope > 0.0 and x < circuit.knee:
        return x * circuit.slope
    return math.exp(x)


@kernel
def _cubic(v0, v1, slope0, slope1):
    """Coefficients of the cubic through values and slopes at both ends of 0..1."""
    rise = v1 - v0
    return v0, slope0, 3.0 * rise - 2.0 * slope0 - slope1, slope0 + slope1 - 2.0 * rise


@kernel
def _at(p0, p1, p2, p3, s):
    return p0 + s * (p1 + s * (p2 + s * p3))


@kernel
def _root(p0, p1, p2, p3, a, b):
    """Root of a cubic that rises through zero once in [a, b]: Newton, else halving."""
    s = 0.5 * (a + b)
    for _ in range(_NEWTON):
        v = _at(p0, p1, p2, p3, s)
        if v >= 0.0:
            b = s
        else:
            a = s
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3))
        next_s = s - v / slope if slope != 0.0 else -1.0
        if not a <= next_s <= b:
            next_s = 0.5 * (a + b)
        if abs(next_s - s) < 1e-13:
            return next_s
        s = next_s
    return s


@kernel
def first_reach(p0, p1, p2, p3, start, end):
    """First place in [start, end] at which a cubic is at or above zero; beyond 1: none."""
    if _at(p0, p1, p2, p3, start) >= 0.0:
        return start
    if p3 == 0.0 and abs(p2) <= _STRAIGHT * abs(p1):
        s = -p0 / p1 if p1 > 0.0 else _NOWHERE
        return s if s <= end else _NOWHERE
    first, second = end, end
    inner = p2 * p2 - 3.0 * p1 * p3
    if inner > 0.0:
        q = -(p2 + math.copysign(math.sqrt(inner), p2))
        r1 = q / (3.0 * p3) if p3 != 0.0 else end
        r2 = p1 / q if q != 0.0 else end
        first, second = min(r1, r2), max(r1, r2)
    a = start
    for j in range(3):
        b = first if j == 0 else second if j == 1 else end
        if a < b <= end:
            if _at(p0, p1, p2, p3, b) >= 0.0:
                return _root(p0, p1, p2, p3, a, b)
            a = b
    return _NOWHERE


@inlined
def _due_within(i, now, t_end, circuit, injected, state):
    """Kind and time of what happens to pixel i by itself in [now, t_end); earlier ones are lost."""
    kind, t = noise_within(i, now, t_end, circuit, state)
    if injected.next.shape[0] > 0:
        while injected.next[i] < injected.stop[i] and injected.times[injected.next[i]] < now:
            injected.next[i] += 1
        if injected.next[i] < injected.stop[i] and injected.times[injected.next[i]] < t:
            kind, t = INJECTED, injected.times[injected.next[i]]
    return kind, t


@inlined
def _take_due(i, kind, light, circuit, injected, state):
    """Polarity of what happens to pixel i by itself, 0 where it is nothing; goes on to the next."""
    if kind == INJECTED:
        polarity = 1 if injected.on[injected.next[i]] else -1
        injected.next[i] += 1
    else:
        polarity = take_noise(i, kind, light, circuit, state)
    return polarity


@kernel
def _parts(k, s, signal, strip):
    """Return the parts of the signal of pixel k at s: by the light, by noise, and what is added."""
    noise = strip[rows.SEEN0 + k] + (strip[rows.SEEN + k] - strip[rows.SEEN0 + k]) * s
    added = strip[rows.ADDED0 + k] + (strip[rows.ADDED + k] - strip[rows.ADDED0 + k]) * s
    return signal - noise - added, noise, added


@kernel
def fire_step(k, i, step, levels, circuit, injected, state, strip, buffer, n):
    """Fire the events of pixel k of a strip, i of the state, in a step.

    levels: factors on the ON threshold at both ends of the step, on OFF likewise.  Returns the
    number of events so far, and whether there was room for all; if not, the next call goes on.
    """
    injected, state, strip, buffer = borrowed(injected, state, strip, buffer)
    on0, on1, off0, off1 = levels
    ta, h, most = step.start, step.h, buffer.keys.shape[0]
    tb = ta + h
    s = strip[rows.FROM + k]
    on_level, off_level = state[per_pixel.ON, i], state[per_pixel.OFF, i]
    jitter = circuit.leak_jitter > 0.0
    factor = state[per_pixel.LEAK_FACTOR, i] if jitter else 1.0
    c0, c1, c2, c3 = _cubic(
        strip[rows.SIGNAL0 + k], strip[rows.SIGNAL1 + k],
        strip[rows.SLOPE0 + k], strip[rows.SLOPE1 + k],
    )  # fmt: skip
    fallen, slope0, slope1 = _fall(k, on_level, leak_over(h, circuit), strip)
    _, l1, l2, l3 = _cubic(0.0, fallen, slope0, slope1)
    reference = strip[rows.REFERENCE + k] + factor * fallen
    if state[per_pixel.HOLD, i] >= 0.0:
        s = max(s, (state[per_pixel.HOLD, i] - ta) / h)
        reference = _at(c0, c1, c2, c3, s) + factor * _at(0.0, l1, l2, l3, s)
        reference += state[per_pixel.BEYOND, i]
        state[per_pixel.HOLD, i] = -1.0
        if circuit.causes:
            now = reference - factor * _at(0.0, l1, l2, l3, s)
            note_parts(i, now, *_parts(k, s, _at(c0, c1, c2, c3, s), strip), state)
    whole = True
    while True:
        if n == most:
            whole = False
            break
        kind, t_end = _due_within(i, ta + s * h, tb, circuit, injected, state)
        s_end = 1.0 if kind == NONE else max(s, (t_end - ta) / h)
        d0 = c0 - reference
        d1, d2, d3 = c1 + factor * l1, c2 + factor * l2, c3 + factor * l3
        up = first_reach(d0 - on_level * on0 - TIE, d1 - on_level * (on1 - on0), d2, d3, s, s_end)
        down = first_reach(
            -d0 - off_level * off0 - TIE, -d1 - off_level * (off1 - off0), -d2, -d3, s, s_end
        )
        s_event = min(up, down)
        signal_event = s_event <= 1.0
        polarity = 1 if up <= down else -1
        if not signal_event:
            if kind == NONE:
                break
            s_event = s_end
            light0, light1 = strip[rows.LIGHT0 + k], strip[rows.LIGHT1 + k]
            light = light0 + (light1 - light0) * s_end
            if circuit.update == EXACT:
                x = strip[rows.X1 + k] - strip[rows.MOVE + k] * (2.0 * step.half) * (1.0 - s_end)
                light = _light_of(x, circuit)
            polarity = _take_due(i, kind, light, circuit, injected, state)
            if polarity == 0:
                s = s_end
                continue
        t, cause = ta + s_event * h, kind
        if circuit.causes and signal_event:
            now = reference - factor * _at(0.0, l1, l2, l3, s_event)
            light, noise, added = _parts(k, s_event, _at(c0, c1, c2, c3, s_event), strip)
            cause = cause_by_most(i, polarity, now, light, noise, added, circuit, state)
        n = fire(i, t, polarity, cause, circuit, state, buffer, n)
        before = factor
        factor = state[per_pixel.LEAK_FACTOR, i] if jitter else 1.0
        s = s_event
        level = on_level if polarity > 0 else -off_level
        beyond = circuit.overshoot * level
        if circuit.dead_time > 0.0:
            hold = t + circuit.dead_time
            if hold >= tb:
                state[per_pixel.HOLD, i] = hold
                state[per_pixel.BEYOND, i] = beyond
                break
            s = (hold - ta) / h
        if circuit.dead_time > 0.0 or not signal_event:
            reference = _at(c0, c1, c2, c3, s) + factor * _at(0.0, l1, l2, l3, s) + beyond
        else:
            level *= on0 + (on1 - on0) * s if polarity > 0 else off0 + (off1 - off0) * s
            reference += level * (1.0 + circuit.overshoot)
            reference += (factor - before) * _at(0.0, l1, l2, l3, s)
        if circuit.causes:
            now = reference - factor * _at(0.0, l1, l2, l3, s)
            note_parts(i, now, *_parts(k, s, _at(c0, c1, c2, c3, s), strip), state)
    strip[rows.REFERENCE + k] = reference - factor * fallen
    strip[rows.LEAK_ON + k] = factor * on_level
    if whole:
        watch(k, i, circuit, injected, state, strip)
    else:
        strip[rows.FROM + k] = s
    return n, whole
