"""Leak of the reference: how far it falls, and where in its cycle a pixel is at the start.

The equations are those of :mod:`adv2e.effects.pixel.leak`.
"""

from __future__ import annotations

import math

import numpy as np

from adv2e.compiled import inlined, kernel
from adv2e.kernel import per_pixel, rng, screen, special
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.noise import hot_rate_of
from adv2e.kernel.work_queue import STRIP

_f = np.float32

_MOST = 3.0
"""Largest deviation of a period, in standard deviations."""

_TRIES = 100
"""Ages that are drawn for a pixel; none of them is left only where noise leaves leak no time."""


@inlined
def leak_rate(light, circuit):
    """Speed at which leak lowers the reference in `light` [DN], in ON thresholds a us."""
    return circuit.leak + circuit.photo_leak * light


@inlined
def fall_over(on, length, mean, circuit):
    """Fall of the reference over `length` us [ln units]; `on`: ON threshold, `mean`: light [DN].

    Parts of leak are added up here, where :func:`leak_over` has them over the time for all pixels:
    the two do not round alike.
    """
    fall = on * circuit.leak * length
    if circuit.photo_leak > 0.0:
        fall += on * circuit.photo_leak * mean * length
    return fall


@kernel
def leak_over(length, circuit):
    """Fall of the reference over `length` us in ON thresholds: constant part, and for each DN."""
    return circuit.leak * length, circuit.photo_leak * length


@kernel
def fill_falls(i, b, count, length, circuit, state, memory):
    """Fall of the references over `length` us, from pixel b of a strip on, which is i of all."""
    on, falls, mean = state[per_pixel.ON, i : i + count], memory.falls[b:], memory.means[b:]
    constant, per_dn = leak_over(length, circuit)
    if per_dn > 0.0:
        for k in range(count):
            falls[k] = on[k] * (constant + per_dn * mean[k])
    else:
        for k in range(count):
            falls[k] = on[k] * constant
    if circuit.leak_jitter > 0.0:
        factor = state[per_pixel.LEAK_FACTOR, i : i + count]
        for k in range(count):
            falls[k] *= factor[k]


@kernel
def leaks(circuit):
    """Tell whether there is any leak."""
    return circuit.leak > 0.0 or circuit.photo_leak > 0.0


@kernel
def _mean_lights(strip, knee_dn, means):
    """Mean light of each pixel over the interval [DN]."""
    for k in range(STRIP):
        i0, i1 = strip[screen.LIGHT_0 + k], strip[screen.LIGHT_1 + k]
        dx = special.log_ratio32((i1 - i0) / (i1 + i0 + _f(1e-30)))
        grown = i1 * (_f(1.0) - dx * special.psi32(-dx))
        means[k] = grown if min(i0, i1) >= knee_dn else _f(0.5) * (i0 + i1)


@kernel
def leak_strip(lo, count, length, circuit, state, memory):
    """Fall of the reference of a strip over `length` us, with the light of the screen's rows."""
    strip, falls = memory.rows, memory.falls
    if circuit.photo_leak > 0.0:
        _mean_lights(strip, _f(circuit.slope * circuit.knee), memory.means)
    fill_falls(lo, 0, count, length, circuit, state, memory)
    for k in range(count):
        strip[screen.FALL + k] = falls[k]


@kernel
def lower_references(i, b, count, state, memory):
    """Take the fall from the references of the pixels that are not flagged."""
    falls, reference = memory.falls[b:], state[per_pixel.REFERENCE, i : i + count]
    hit = memory.rows[screen.HIT + b : screen.HIT + b + count]
    for k in range(count):
        fall = falls[k] if hit[k] == 0.0 else 0.0
        reference[k] -= fall


@kernel
def _factor(seed, jitter, i, draw):
    """Leak speed of one cycle of pixel i, relative to the nominal one."""
    return 1.0 / (1.0 + jitter * cut(rng.normal(seed, rng.LEAK_PERIOD, i, draw)))


@kernel
def cut(g):
    """Cut a deviation of a period."""
    return min(max(g, -_MOST), _MOST)


@kernel
def begin_leak_cycle(i, circuit, state):
    """Draw the leak speed of the cycle that now begins."""
    (state,) = borrowed(state)
    state[per_pixel.LEAK_DRAW, i] += 1
    state[per_pixel.LEAK_FACTOR, i] = _factor(
        circuit.seed, circuit.leak_jitter, i, state[per_pixel.LEAK_DRAW, i]
    )


@kernel
def fill_first_factors(seed, jitter, factors):
    """Draw the leak speed of every pixel's first cycle."""
    for i in range(factors.shape[0]):
        factors[i] = _factor(seed, jitter, i, 0)


@kernel
def _met(dead, noise, period):
    """Return the mean time that a cycle of this period lasts beside noise of rate `noise` [us]."""
    return dead + (-math.expm1(-noise * period) / noise if noise > 0.0 else period)


@kernel
def fill_running(lo, hi, circuit, start, light, level, state):
    """Put the pixels lo..hi somewhere in their leak cycles at `start` [us].

    Their references are those right after an event, beside signals at rest without photoreceptor
    noise; `light` (pixels,) is what they have seen [DN], `level` (pixels,) the factor on the ON
    threshold.
    """
    seed, jitter, dead = circuit.seed, circuit.leak_jitter, circuit.dead_time
    for i in range(lo, hi):
        rate = leak_rate(light[i], circuit)
        factor = _factor(seed, jitter, i, 0) if jitter > 0.0 else 1.0
        way = level[i] + circuit.overshoot
        fallen, hold = 0.0, -1.0
        if rate > 0.0 and way > 0.0:
            noise = circuit.shot_rate * max(1.0 - circuit.shot_fall * light[i], 0.0)
            if circuit.hot_rate > 0.0 and state[per_pixel.HOT_TIME, i] < per_pixel.NEVER:
                noise += hot_rate_of(i, seed, circuit.hot_rate, circuit.hot_spread)
            longest = way / rate * (1.0 + jitter * _MOST)
            most = _met(dead, noise, longest)
            for draw in range(_TRIES):
                slowness = 1.0
                if jitter > 0.0:
                    slowness += jitter * cut(rng.normal(seed, rng.LEAK_RUNNING, i, draw))
                period = way / rate * slowness
                mean = _met(dead, noise, period)
                u, v = rng.uniforms(seed, rng.LEAK_AGE, i, draw)
                if u * most >= mean:
                    continue
                age = v * mean - dead
                if age < 0.0:
                    factor, fallen, hold = 1.0 / slowness, 0.0, start - age
                    break
                if noise > 0.0:
                    age = -math.log1p(-noise * age) / noise
                fallen = way * min(age / period, 1.0) - circuit.overshoot
                factor = 1.0 / slowness
                break
        state[per_pixel.REFERENCE, i] -= fallen * state[per_pixel.ON, i]
        state[per_pixel.HOLD, i] = hold
        if circuit.overshoot != 0.0:
            state[per_pixel.BEYOND, i] = circuit.overshoot * state[per_pixel.ON, i]
        if jitter > 0.0:
            state[per_pixel.LEAK_FACTOR, i] = factor
