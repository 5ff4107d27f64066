"""Pixels beside photoreceptor noise that have run: their references at the first frame.

Only events take references anew, and most of the time is spent at those that noise seldom leaves.
So the last events of each pixel before the first frame are drawn, from reset to reset: where noise
is at a reset, which threshold it crosses next, and how long that takes in the mean.  One of these
times is that of the first frame, drawn in proportion to how long they are.

Times and levels are those of :mod:`adv2e.kernel.photoreceptor.exits`.  A crossing soon after a
reset, while noise still knows of it, counts as taking no time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adv2e.compiled import inlined, kernel
from adv2e.kernel import per_pixel, rng, special
from adv2e.kernel.leak import cut, leak_rate
from adv2e.kernel.noise import hot_rate_of, stationary_noise
from adv2e.kernel.photoreceptor.exits import (
    COMPARABLE_POLES,
    FARTHEST,
    FARTHEST_SHIFT,
    POLE_SHIFT,
    RAYLEIGH,
    SAMPLING_SHIFT,
    SHIFT_STEP,
    STEP,
)

_FORGET, _STEPS = 40, 200
"""Events that a pixel goes through, and pieces of the way of its reference: the first, which still
know where it began, and all."""
_HIGHEST = 8.0
"""Thresholds farther than this many standard deviations have no events: one in 1e14 time units."""
_SELDOM = 6.0
"""Mean threshold from which events are so rare that no recording tells one order of them from
another: references are then taken anew each time, at any moment of the noise."""
_PIECE = 0.25
"""Way of the leaking reference over which its hazard is constant."""
_UNIT = 1.0 / 4294967296.0
_LOW = np.uint64(0xFFFFFFFF)
_TRIES = 100
"""Noise that is drawn for a pixel; none of it is between the thresholds only where it fires."""


@inlined
def _at(values, first, step, x):
    """Value at x of a table with even steps."""
    place = min(max((x - first) / step, 0.0), values.shape[0] - 1.001)
    k = int(place)
    return values[k] + (place - k) * (values[k + 1] - values[k])


@kernel
def _seen(level, noise, exits):
    """Return where the slow part of the noise is when noise reaches a level."""
    if noise.ratio == 0.0:
        return level + noise.shift
    bent = noise.root * _at(exits.shift, -FARTHEST_SHIFT, SHIFT_STEP, level * noise.root)
    return level + bent - COMPARABLE_POLES * noise.ratio * math.exp(-0.5 * max(level, 0.0))


@kernel
def _hazard(level, exits):
    """Return the rate at which noise at rest reaches a level, as it is seen."""
    return math.exp(_at(exits.rate, -FARTHEST, STEP, level)) if level < _HIGHEST else 0.0


@kernel
def _reached(upper, lower, y, exits):
    """Return the probabilities that y reaches either level before it comes to rest."""
    rest = min(max(0.0, lower + 1.0), upper - 1.0) if upper > lower + 2.0 else 0.5 * (lower + upper)
    y = min(max(y, lower, -FARTHEST), upper, FARTHEST)
    at_rest = _at(exits.scale, -FARTHEST, STEP, rest)
    at = _at(exits.scale, -FARTHEST, STEP, y)
    if y > rest:
        return (at - at_rest) / (_at(exits.scale, -FARTHEST, STEP, upper) - at_rest), 0.0
    return 0.0, (at_rest - at) / (at_rest - _at(exits.scale, -FARTHEST, STEP, lower))


class _Noise(NamedTuple):
    """Noise of a pixel, and what is left of it after a dead time."""

    ratio: float
    root: float  # of the ratio
    shift: float
    kept: float  # share of a level, and of the slow part ahead of it,
    follows: float
    slow: float  # and of the level in the slow part
    rest: float  # variance and covariance of what is new
    both: float
    slow_rest: float


@kernel
def _noise_of(ratio, shift, dead):
    """Return the noise of a pixel with dead times of so many time constants."""
    slow = math.exp(-dead)
    fast = math.exp(-dead / ratio) if ratio > 0.0 else 0.0
    follows = dead * slow if abs(1.0 - ratio) < 1e-6 else (slow - fast) / (1.0 - ratio)
    left = fast * fast + 2.0 * fast * follows + follows * follows * (1.0 + ratio)
    return _Noise(
        ratio, math.sqrt(ratio), shift, fast + follows, follows, slow, max(1.0 - left, 0.0) + 1e-12,
        1.0 - slow * (fast + follows * (1.0 + ratio)), (1.0 + ratio) * (1.0 - slow * slow),
    )  # fmt: skip


@kernel
def _landing(level, way, noise, first, second):
    """Return noise at the end of a dead time, and its slow part in deviations of that.

    level, way : where noise crossed a threshold at the start, and whether up (1) or down (-1)
    first, second : normal numbers
    """
    # a low level is crossed faster, as mostly fast noise crosses it
    faster = (POLE_SHIFT / RAYLEIGH - 1.0) * math.exp(-abs(level) * noise.root)
    ahead = way * noise.root * RAYLEIGH * (1.0 + faster)
    spread = noise.ratio * (2.0 - 0.5 * math.pi) * (1.0 + faster) ** 2
    new = math.sqrt(noise.rest + noise.follows**2 * spread)
    both = (noise.both + noise.follows * noise.slow * spread) / new
    own = noise.slow_rest + noise.slow**2 * spread - both * both
    z = noise.kept * level + noise.follows * ahead + new * first
    y = noise.slow * (level + ahead) + both * first + math.sqrt(max(own, 0.0)) * second
    return z, y / math.sqrt(1.0 + noise.ratio)


@inlined
def _numbers(seed, pixel, draw):
    """Two uniform numbers and two standard normal ones."""
    seed, draw = np.uint64(seed), np.uint64(draw)
    a, b, c, d = rng.philox_7(
        np.uint64(pixel) & _LOW, np.uint64(rng.PHOTORECEPTOR_RUNNING), draw, np.uint64(0),
        seed & _LOW, seed >> np.uint64(32),
    )  # fmt: skip
    r = math.sqrt(-2.0 * special.log((np.float64(a) + 0.5) * _UNIT))
    turn = 2.0 * math.pi * _UNIT * np.float64(b)
    return (
        (np.float64(c) + 0.5) * _UNIT, (np.float64(d) + 0.5) * _UNIT,
        r * math.cos(turn), r * math.sin(turn),
    )  # fmt: skip


@kernel
def _seldom_left(i, a, b, other, noise, exits, circuit):
    """Draw the noise at the last reset of pixel i, whose thresholds a and b are far away.

    It is normal, and met as long as it lasts.
    """
    middle, z = _seen(0.5 * (a + b), noise, exits), 0.0
    least = other + 2.0 * _hazard(middle, exits)
    for draw in range(_TRIES):
        u, _, z, _ = _numbers(circuit.seed, i, draw)
        on, off = _seen(z + a, noise, exits), _seen(b - z, noise, exits)
        if u * (other + _hazard(on, exits) + _hazard(off, exits)) <= least:
            break
    return z


@kernel
def _last_cycle(i, a, b, leak, other, dead, noise, exits, circuit):
    """Draw what pixel i has at the first frame.

    a, b : its thresholds
    leak, other : of the reference, and rate of other events
    dead : time

    Returns
    -------
    kept, beyond : float
        Noise at the last reset, and how far the reference went beyond it.
    fallen, factor : float
        What leak has done to the reference since, and its speed in this cycle.
    left : float
        Share of the dead time that is left; below 0: it is over.
    """
    jitter, overshoot = circuit.leak_jitter, circuit.overshoot
    if leak == 0.0 and a + b > 2.0 * _SELDOM:
        return _seldom_left(i, a, b, other, noise, exits, circuit), 0.0, 0.0, 1.0, -1.0
    u, v, z, spare = _numbers(circuit.seed, i, 0)
    kept, kept_beyond, kept_fallen, kept_factor, left = z, 0.0, 0.0, 1.0, -1.0
    y, beyond, total, draw, forgotten = 0.0, 0.0, 0.0, 1, False
    while draw < _STEPS:
        if draw > _FORGET and not forgotten:
            total, forgotten = 0.0, True
        u, v, first, second = _numbers(circuit.seed, i, draw)
        draw += 1
        factor, fallen, polarity, reference = 1.0, 0.0, 0, z + beyond
        if jitter > 0.0:
            factor = 1.0 / (1.0 + jitter * cut(rng.normal(circuit.seed, rng.LEAK_RUNNING, i, draw)))
        total += dead
        if u * total < dead:
            kept, kept_beyond, left, u = z, beyond, u * total / dead, spare
        elif dead > 0.0:
            u = (u * total - dead) / (total - dead)
        on, off = _seen(reference + a, noise, exits), _seen(b - reference, noise, exits)
        up, down = _reached(on, -off, y, exits)
        if v < up:
            polarity = 1
        elif v < up + down:
            polarity = -1
        else:
            v = (v - up - down) / (1.0 - up - down)
        while polarity == 0:
            way = 0.0
            if leak > 0.0:
                way, high = _PIECE, reference - fallen + a
                if high > _HIGHEST + way and b - reference + fallen > _HIGHEST:
                    way = high - _HIGHEST
                on = _seen(high - 0.5 * way, noise, exits)
                off = _seen(b - reference + fallen + 0.5 * way, noise, exits)
            by_on, by_off = _hazard(on, exits), _hazard(off, exits)
            rate = by_on + by_off + other
            if rate == 0.0 and leak == 0.0:
                return z, beyond, 0.0, 1.0, -1.0
            rate = max(rate, 1e-30)
            ended, span = 1.0, 1.0 / rate
            if leak > 0.0:
                ended = -math.expm1(-rate * way / (leak * factor))
                span = ended / rate
            total += span
            if u * total < span:
                kept, kept_beyond, kept_factor, left = z, beyond, factor, -1.0
                kept_fallen = fallen + way * (u * total / span)
            if v < ended:
                v *= rate / ended
                polarity = 1 if v < by_on else -1 if v < by_on + by_off else 2
                fallen += 0.5 * way
            else:
                fallen += way
                u, v, first, second = _numbers(circuit.seed, i, draw)
                draw += 1
        if polarity == 2:  # at any moment of the noise
            z, y, beyond = first, (first + noise.root * second) / math.sqrt(1.0 + noise.ratio), 0.0
        else:
            level = reference - fallen + (a if polarity == 1 else -b)
            z, y = _landing(level, polarity, noise, first, second)
            beyond = overshoot * (a if polarity == 1 else -b)
    return kept, kept_beyond, kept_fallen, kept_factor, left


@kernel
def _poles(corner, circuit):
    """Return noise as the comparator sees it: rms, corner of the slower pole, and of the faster.

    Noise behind a high-pass has no such law.  It is taken for noise of poles alone that is as
    large, moves as fast, and bends as much: levels are crossed as often.
    """
    second, high = circuit.follower, circuit.high
    share = second / (second + corner) if second > 0.0 else 1.0
    rms, slow, fast = circuit.noise_rms * math.sqrt(share), corner, math.inf
    if second > 0.0:
        slow, fast = min(corner, second), max(corner, second)
    if high > 0.0:
        corner = max(corner, 1e-30)
        rms *= math.sqrt(corner / (corner + high))
        slow = corner + high
        if second > 0.0:
            rms *= math.sqrt(second / (second + high))
            both = corner * second + (corner + second) * high  # product of the two
            mean = 0.5 * (slow + second - corner * second * high / both)
            fast = max(mean + math.sqrt(max(mean * mean - both, 0.0)), math.sqrt(both))
            slow = both / fast
    return rms, slow, fast


@kernel
def fill_running_noise(lo, hi, circuit, cell, start, light, on_level, off_level, exits, state):
    """Put the pixels lo..hi where they are at `start` [us], with noise and what leak has done.

    Parameters
    ----------
    cell : float
        Longest cell of noise behind one pole [us].
    light : (pixels,)
        What the pixels have seen [DN].
    on_level, off_level : (pixels,)
        Factors on the thresholds.
    exits : Exits
    state : (rows, pixels)
        References are those of signals at rest without noise.
    """
    seed = circuit.seed
    for i in range(lo, hi):
        corner = circuit.dark + circuit.per_dn * light[i]
        rms, slow, fast = _poles(corner, circuit)
        shift = SAMPLING_SHIFT * math.sqrt(2.0 * slow * cell) if circuit.follower == 0.0 else 0.0
        ratio, slow = slow / fast, max(slow, 1e-30)
        on = state[per_pixel.ON, i]
        a, b = on * on_level[i] / rms, state[per_pixel.OFF, i] * off_level[i] / rms
        leak, dead = leak_rate(light[i], circuit) * on / (rms * slow), circuit.dead_time * slow
        other = circuit.shot_rate * max(1.0 - circuit.shot_fall * light[i], 0.0)
        if circuit.hot_rate > 0.0 and state[per_pixel.HOT_TIME, i] < per_pixel.NEVER:
            other += hot_rate_of(i, seed, circuit.hot_rate, circuit.hot_spread)
        noise = _noise_of(ratio, shift, dead)
        kept, beyond, fallen, factor, left = _last_cycle(
            i, a, b, leak, other / slow, dead, noise, exits, circuit
        )
        reference = kept + beyond - fallen
        lower, upper = -_seen(b - reference, noise, exits), _seen(reference + a, noise, exits)
        first = seen = past = 0.0
        for draw in range(_TRIES):
            first, seen, past = stationary_noise(i, draw, corner, circuit)
            if left >= 0.0 or lower < (seen - past) / rms < upper:
                break
        state[per_pixel.NOISE, i], state[per_pixel.SEEN, i] = first, seen
        if circuit.high > 0.0:
            state[per_pixel.SLOW, i] = past
        state[per_pixel.HOLD, i] = start + left * circuit.dead_time if left >= 0.0 else -1.0
        if circuit.causes:
            rest = state[per_pixel.REFERENCE, i]
            state[per_pixel.RESET_LIGHT, i], state[per_pixel.RESET_NOISE, i] = rest, rms * kept
            began = rest + rms * (kept + beyond)
            state[per_pixel.RESET, i] = began if left < 0.0 else per_pixel.NEVER
        state[per_pixel.REFERENCE, i] += rms * reference
        if circuit.overshoot != 0.0:
            state[per_pixel.BEYOND, i] = rms * beyond
        if circuit.leak_jitter > 0.0:
            state[per_pixel.LEAK_FACTOR, i] = factor
