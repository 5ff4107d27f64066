r"""The signal of a strip of pixels over one step of time.

``exact``.  x is linear over the step, the light at its start, middle and end is known, so the
corner integrated over the step is known to fourth order (Simpson).  With a that integral, c the
change of (corner times step) over the step and u = y - x,

.. math:: u_1 = e^{-a} u_0 - \Delta x\, q\,(1 - c/12), \qquad q = (1 - e^{-a})/a

which is the solution for a corner that changes linearly, but for terms of c a^2.  Within the step
the signal is the cubic (Hermite) through its values and slopes at both ends; the second pole is
solved exactly for such a cubic at its input, as the weights of value and slope are the same for
all pixels.

The K-step forms draw one line a step.
"""

from __future__ import annotations

import math

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import special
from adv2e.kernel.inputs import EULER, EXACT, PAPER, ZERO_ORDER_HOLD
from adv2e.kernel.stepped import rows

# ---- The limit on the slew rate, put on a step that the first pole has made without it.
#
# The equations are those of :mod:`adv2e.effects.pixel.slew_limit`.


_PIECES = 16
"""Parts of a step in which the limit sets in or ends."""


@kernel
def keep_first(n, strip):
    """Row CANDIDATE: the first pole before the step."""
    for k in range(n):
        strip[rows.CANDIDATE + k] = strip[rows.FIRST + k]


@kernel
def limit_slew(n, h, circuit, strip):
    """Put the limit on a step of h us that the first pole has made without it."""
    most = circuit.slew * h
    if circuit.update != EXACT:
        _limit_lines(n, most, strip)
        return
    constant, per_dn = circuit.dark * h, circuit.per_dn * h
    doubtful = np.int64(0)
    for k in range(n):
        slope0, slope1 = strip[rows.SLOPE0 + k], strip[rows.SLOPE1 + k]
        up = most if slope0 > 0.0 else -most
        ramp = strip[rows.CANDIDATE + k] + up
        wanted = (constant + per_dn * strip[rows.LIGHT1 + k]) * (strip[rows.DRIVEN1 + k] - ramp)
        limited = abs(slope0) > most
        stays = limited & (abs(wanted) >= most) & (wanted * up > 0.0)
        free = (abs(slope0) <= most) & (abs(slope1) <= most)
        strip[rows.FIRST + k] = ramp if stays else strip[rows.FIRST + k]
        strip[rows.SLOPE0 + k] = up if limited else slope0
        strip[rows.SLOPE1 + k] = up if stays else slope1
        doubt = ~(stays | free)
        strip[rows.HIT + k] = 1.0 if doubt else 0.0
        doubtful += np.int64(doubt)
    if doubtful > 0:
        for k in range(n):
            if strip[rows.HIT + k] != 0.0:
                _limit_in_pieces(k, most, constant, per_dn, strip)


@kernel
def _limit_lines(n, most, strip):
    for k in range(n):
        rise = strip[rows.SLOPE0 + k]
        rise = rise if rise < most else most
        rise = rise if rise > -most else -most
        strip[rows.FIRST + k] = strip[rows.CANDIDATE + k] + rise
        strip[rows.SLOPE0 + k] = rise
        strip[rows.SLOPE1 + k] = rise


@kernel
def _limit_in_pieces(k, most, constant, per_dn, strip):
    """Step of pixel k of the strip over which the limit sets in or ends."""
    y = strip[rows.CANDIDATE + k]
    i0, im, i1 = strip[rows.LIGHT0 + k], strip[rows.LIGHTM + k], strip[rows.LIGHT1 + k]
    bend, rise = 2.0 * (i0 + i1) - 4.0 * im, 4.0 * im - 3.0 * i0 - i1
    x0, x1 = strip[rows.DRIVEN0 + k], strip[rows.DRIVEN1 + k]
    for j in range(_PIECES):
        s = (j + 0.5) / _PIECES
        rate = constant + per_dn * (i0 + s * (rise + s * bend))
        move = (1.0 - special.exp(-rate / _PIECES)) * (x0 + (x1 - x0) * s - y)
        y += min(max(move, -most / _PIECES), most / _PIECES)
    slope = (constant + per_dn * i1) * (x1 - y)
    strip[rows.FIRST + k] = y
    strip[rows.SLOPE1 + k] = min(max(slope, -most), most)


NO_POLE = 1.0, 0.0, 0.0, 0.0, 0.0
"""Weights where there is no second pole, or no high-pass."""

_SIXTH = 1.0 / 6.0
_NODES, _WEIGHTS = (0.5 * v for v in np.polynomial.legendre.leggauss(12))
_NODES = _NODES + 0.5


@kernel
def log_of_light(frame, circuit, x):
    """Log intensity of light [DN], (pixels,)."""
    knee_dn = circuit.slope * circuit.knee
    least = knee_dn if circuit.slope > 0.0 else circuit.floor
    for k in range(frame.shape[0]):
        v = np.float64(frame[k])
        x[k] = special.log(v if v > least else least)
    if circuit.slope > 0.0:
        for k in range(frame.shape[0]):
            v = np.float64(frame[k])
            v = v if v > 0.0 else 0.0
            x[k] = x[k] if v >= knee_dn else v / circuit.slope


@kernel
def begin_block(n, share, half, circuit, strip):
    """Rows of a piece from `share` of it on, in steps of two times `half` of it."""
    for k in range(n):
        x = strip[rows.PIECE + k] + strip[rows.MOVE + k] * share
        grown = special.exp(x)
        strip[rows.GROWN + k] = grown
        strip[rows.RATIO + k] = special.exp(strip[rows.MOVE + k] * half)
        foot = x * circuit.slope
        strip[rows.LIGHT1 + k] = foot if x < circuit.knee else grown
        strip[rows.X1 + k] = x
        strip[rows.DRIVEN1 + k] = x


@kernel
def next_sample(n, circuit, strip):
    """Light, and log intensity at the end of one of the K steps, which is a sample.

    The next one begins with the same bits, so that no block has to.
    """
    knee, slope = circuit.knee, circuit.slope
    for k in range(n):
        x = strip[rows.UNTIL + k]
        grown, foot = special.exp(x), x * slope
        strip[rows.LIGHT0 + k] = strip[rows.LIGHT1 + k]
        strip[rows.LIGHT1 + k] = foot if x < knee else grown
        strip[rows.X1 + k] = x
        strip[rows.DRIVEN0 + k] = strip[rows.DRIVEN1 + k]
        strip[rows.DRIVEN1 + k] = x


@kernel
def advance_light(n, share, half, circuit, strip):
    """Light, and log intensity at the end of a step that ends at `share` of the piece."""
    knee, slope = circuit.knee, circuit.slope
    for k in range(n):
        x1 = strip[rows.PIECE + k] + strip[rows.MOVE + k] * share
        xm = x1 - strip[rows.MOVE + k] * half
        ratio = strip[rows.RATIO + k]
        middle = strip[rows.GROWN + k] * ratio
        end = middle * ratio
        strip[rows.GROWN + k] = end
        foot_m, foot_1 = xm * slope, x1 * slope
        strip[rows.LIGHT0 + k] = strip[rows.LIGHT1 + k]
        strip[rows.LIGHTM + k] = foot_m if xm < knee else middle
        strip[rows.LIGHT1 + k] = foot_1 if x1 < knee else end
        strip[rows.X1 + k] = x1
        strip[rows.DRIVEN0 + k] = strip[rows.DRIVEN1 + k]
        strip[rows.DRIVEN1 + k] = x1


@kernel
def add_course(n, lo, count, course, m, row, strip):
    """Add instant m of a course to a row."""
    if course.shape[1] == 1:
        value = course[m, 0]
        for k in range(n):
            strip[row + k] += value
    else:
        values = course[m, lo : lo + count]
        for k in range(count):
            strip[row + k] += values[k]


@kernel
def change_light(lo, count, course, m, circuit, strip):
    """Put the factors of instant m of a course on the light at the end of a step, and on its x."""
    if course.shape[1] == 1:
        _change_alike(course[m, 0], count, circuit, strip)
        return
    knee_dn = math.exp(circuit.knee)
    for k in range(count):
        factor = course[m, lo + k]
        light = strip[rows.LIGHT1 + k]
        changed = factor * light
        strip[rows.LIGHT1 + k] = changed
        if changed < knee_dn:
            strip[rows.DRIVEN1 + k] = changed / circuit.slope
        else:
            strip[rows.DRIVEN1 + k] = special.log(changed)


@kernel
def _change_alike(factor, count, circuit, strip):
    """Put one factor on the light of all pixels: its logarithm is added, but in the foot."""
    knee, slope, knee_dn = circuit.knee, circuit.slope, math.exp(circuit.knee)
    rise, of_foot, doubtful = math.log(factor), 1.0 / (slope if slope > 0.0 else 1.0), 0
    for k in range(count):
        x, light = strip[rows.X1 + k], factor * strip[rows.LIGHT1 + k]
        strip[rows.LIGHT1 + k] = light
        strip[rows.DRIVEN1 + k] = light * of_foot if light < knee_dn else x + rise
        doubtful += int((light >= knee_dn) & (x < knee))
    if doubtful > 0:
        for k in range(count):
            light = strip[rows.LIGHT1 + k]
            if light >= knee_dn and strip[rows.X1 + k] < knee:  # it has left the foot
                strip[rows.DRIVEN1 + k] = special.log(light)


@kernel
def change_middle(lo, count, course, m, strip):
    """Put the factors half-way between instants m and m + 1 of a course on the light there."""
    wide = course.shape[1] > 1
    for k in range(count):
        i = lo + k if wide else 0
        strip[rows.LIGHTM + k] *= 0.5 * (course[m, i] + course[m + 1, i])


@kernel
def first_pole_exact(n, h, circuit, strip):
    """Advance row FIRST by a step of h us; its slopes; and the pole's DECAY."""
    constant, per_dn = circuit.dark * h, circuit.per_dn * h
    for k in range(n):
        i0, im, i1 = strip[rows.LIGHT0 + k], strip[rows.LIGHTM + k], strip[rows.LIGHT1 + k]
        x0, x1 = strip[rows.DRIVEN0 + k], strip[rows.DRIVEN1 + k]
        a = constant + per_dn * ((i0 + 4.0 * im + i1) * _SIXTH)
        decay = special.exp(-a)
        q = (1.0 - decay) / (a + 1e-300)
        q = q if a > 1e-4 else 1.0 - 0.5 * a + a * a * _SIXTH
        change = per_dn * (i1 - i0)
        turn = 1.0 - change * (1.0 / 12.0)
        turn = turn if abs(change) < 1.0 else 1.0
        u0 = strip[rows.FIRST + k] - x0
        u1 = decay * u0 - (x1 - x0) * q * turn
        strip[rows.FIRST + k] = x1 + u1
        strip[rows.SLOPE0 + k] = -(constant + per_dn * i0) * u0
        strip[rows.SLOPE1 + k] = -(constant + per_dn * i1) * u1
        strip[rows.DECAY + k] = decay


@kernel
def first_pole_stepped(n, h, circuit, strip):
    """Advance row FIRST by one of the K steps of low_pass; its slope is the line's."""
    constant, per_dn, update = circuit.dark * h, circuit.per_dn * h, circuit.update
    for k in range(n):
        a1 = constant + per_dn * strip[rows.LIGHT1 + k]
        a = 0.5 * (constant + per_dn * strip[rows.LIGHT0 + k] + a1)
        strip[rows.LIGHTM + k] = 0.5 * (strip[rows.LIGHT0 + k] + strip[rows.LIGHT1 + k])
        strip[rows.SLOPE0 + k] = strip[rows.FIRST + k]
        strip[rows.SLOPE1 + k] = a1
        strip[rows.DECAY + k] = a
    if update == EULER:
        for k in range(n):
            a = strip[rows.SLOPE1 + k]
            a = a if a < 1.0 else 1.0
            strip[rows.FIRST + k] = (1.0 - a) * strip[rows.FIRST + k] + a * strip[rows.DRIVEN1 + k]
    elif update in (PAPER, ZERO_ORDER_HOLD):
        for k in range(n):
            a = strip[rows.SLOPE1 + k]
            decay = special.exp(-a)
            share = a if update == PAPER else 1.0 - decay
            strip[rows.FIRST + k] = decay * strip[rows.FIRST + k] + share * strip[rows.DRIVEN1 + k]
    else:
        for k in range(n):
            a = strip[rows.DECAY + k]
            decay = special.exp(-a)
            mean = (1.0 - decay) / (a + 1e-300)
            mean = mean if a > 1e-4 else 1.0 - a / 2.0 + a * a / 6.0
            first = strip[rows.FIRST + k]
            first = decay * first + (mean - decay) * strip[rows.DRIVEN0 + k]
            strip[rows.FIRST + k] = first + (1.0 - mean) * strip[rows.DRIVEN1 + k]
    for k in range(n):
        rise = strip[rows.FIRST + k] - strip[rows.SLOPE0 + k]
        strip[rows.SLOPE0 + k] = rise
        strip[rows.SLOPE1 + k] = rise
    if circuit.noise_rms > 0.0:
        for k in range(n):
            strip[rows.DECAY + k] = special.exp(-strip[rows.DECAY + k])


@kernel
def no_pole(n, strip):
    """Row FIRST without a low-pass: what drives it."""
    for k in range(n):
        rise = strip[rows.DRIVEN1 + k] - strip[rows.DRIVEN0 + k]
        strip[rows.FIRST + k] = strip[rows.DRIVEN1 + k]
        strip[rows.SLOPE0 + k] = rise
        strip[rows.SLOPE1 + k] = rise


@kernel
def add_noise(n, rms, normals, strip):
    """Make the photoreceptor noise at the end of the step of `normals`; it is a line over it."""
    for k in range(n):
        decay, before = strip[rows.DECAY + k], strip[rows.NOISE + k]
        after = decay * before + rms * math.sqrt(1.0 - decay * decay) * normals[k]
        strip[rows.NOISE + k] = after
        strip[rows.INPUT0 + k] = strip[rows.INPUT1 + k]
        strip[rows.INPUT1 + k] = strip[rows.FIRST + k] + after
        strip[rows.SLOPE0 + k] += after - before
        strip[rows.SLOPE1 + k] += after - before


@kernel
def no_noise(n, strip):
    """Rows INPUT without photoreceptor noise."""
    for k in range(n):
        strip[rows.INPUT0 + k] = strip[rows.INPUT1 + k]
        strip[rows.INPUT1 + k] = strip[rows.FIRST + k]


@kernel
def keep_parts(n, strip):
    """Rows of the parts of the signal at the start of a step, as the end of the last one."""
    for k in range(n):
        strip[rows.NOISE0 + k] = strip[rows.NOISE + k]
        strip[rows.SEEN0 + k] = strip[rows.SEEN + k]
        strip[rows.ADDED0 + k] = strip[rows.ADDED + k]


@kernel
def see_noise(n, follows, weights, strip):
    """Row SEEN: photoreceptor noise behind the second pole, if there is one."""
    decay, w0, w1, v0, v1 = weights
    for k in range(n):
        before, after = strip[rows.NOISE0 + k], strip[rows.NOISE + k]
        seen = decay * strip[rows.SEEN + k] + w0 * before + w1 * after
        seen += (v0 + v1) * (after - before)
        strip[rows.SEEN + k] = seen if follows else after


@kernel
def second_pole_weights(b, line):
    """Return the weights of the second pole in a step: of its own value, and of its input.

    Five numbers: for its value, the input at both ends, and the slope of the input at both ends.
    b is its corner times the step; with `line` the input is a line, its slopes do not count.
    """
    if b == 0.0:
        return NO_POLE
    decay = math.exp(-b)
    if line:
        mean = 1.0 - b / 2.0 + b * b / 6.0 if b < 1e-4 else -math.expm1(-b) / b
        return decay, mean - decay, 1.0 - mean, 0.0, 0.0
    w0, w1, v0, v1 = 0.0, 0.0, 0.0, 0.0
    for j in range(_NODES.shape[0]):
        s = _NODES[j]
        part = _WEIGHTS[j] * b * math.exp(-b * (1.0 - s))
        w1 += part * s * s * (3.0 - 2.0 * s)
        w0 += part * (1.0 - s) * (1.0 - s) * (1.0 + 2.0 * s)
        v0 += part * s * (1.0 - s) * (1.0 - s)
        v1 -= part * s * s * (1.0 - s)
    return decay, w0, w1, v0, v1


@kernel
def second_pole(n, b, line, weights, strip):
    """Advance row SECOND by a step; its slopes.  The others: see `second_pole_weights`."""
    decay, w0, w1, v0, v1 = weights
    for k in range(n):
        before, in0, in1 = strip[rows.SECOND + k], strip[rows.INPUT0 + k], strip[rows.INPUT1 + k]
        after = decay * before + w0 * in0 + w1 * in1
        after += v0 * strip[rows.SLOPE0 + k] + v1 * strip[rows.SLOPE1 + k]
        strip[rows.SECOND + k] = after
        rise = after - before
        strip[rows.SLOPE0 + k] = rise if line else b * (in0 - before)
        strip[rows.SLOPE1 + k] = rise if line else b * (in1 - after)


@kernel
def high_pass(n, b, line, weights, row, strip):
    """Subtract from a row what follows it as a second pole does; rows SIGNAL, and its slopes.

    The equation is that of :mod:`adv2e.effects.pixel.high_pass`.
    """
    decay, w0, w1, v0, v1 = weights
    for k in range(n):
        before, in0, in1 = strip[rows.SLOW + k], strip[rows.BEHIND + k], strip[row + k]
        slope0, slope1 = strip[rows.SLOPE0 + k], strip[rows.SLOPE1 + k]
        after = decay * before + w0 * in0 + w1 * in1 + v0 * slope0 + v1 * slope1
        strip[rows.SLOW + k] = after
        strip[rows.BEHIND + k] = in1
        strip[rows.SIGNAL0 + k] = strip[rows.SIGNAL1 + k]
        strip[rows.SIGNAL1 + k] = in1 - after
        rise = (in1 - after) - (in0 - before)
        strip[rows.SLOPE0 + k] = rise if line else slope0 - b * (in0 - before)
        strip[rows.SLOPE1 + k] = rise if line else slope1 - b * (in1 - after)


@kernel
def take_signal(n, row, strip):
    """Rows SIGNAL: what the comparator saw at the start of the step, and sees at its end."""
    for k in range(n):
        strip[rows.SIGNAL0 + k] = strip[rows.SIGNAL1 + k]
        strip[rows.SIGNAL1 + k] = strip[row + k]


@kernel
def add_to_signal(n, lo, count, course, m, strip):
    """Add a course, of which instant m begins the step, to the signal."""
    if course.shape[1] == 1:
        before, after = course[m, 0], course[m + 1, 0]
        for k in range(n):
            _add(k, before, after, strip)
    else:
        all_before, all_after = course[m, lo : lo + count], course[m + 1, lo : lo + count]
        for k in range(count):
            _add(k, all_before[k], all_after[k], strip)


@kernel
def _add(k, before, after, strip):
    strip[rows.SIGNAL1 + k] += after
    strip[rows.SLOPE0 + k] = strip[rows.SLOPE0 + k] - before + after
    strip[rows.SLOPE1 + k] = strip[rows.SLOPE1 + k] - before + after
    strip[rows.ADDED + k] = after
