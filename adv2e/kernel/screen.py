r"""The first pass of the exact circuit: all pixels of a strip over one interval.

It moves every pixel to the end of the interval and tells which of them may fire on the way; only
those are looked at again.  All of it is single precision and free of branches, one flat
array with rows at constant offsets, so that it compiles to vector instructions throughout.

End value.  With s = 0..1 over the interval, v = 1 - s and u = y - x,

.. math:: u_1 = e^{-\tau(1)} u_0 - \Delta x \int_0^1 e^{-\tau(v)} dv, \qquad
          \tau(v) = v\,(a_1 - \kappa\,v\,\psi(z v)), \quad \psi(z) = (e^z - 1 - z)/z^2

where a_1 is the corner at the end times the interval, kappa = dx B T I_1, z = -dx on the log branch
and kappa = dx B T dI/dx, z = 0 on the foot.  The integral is taken by Gauss and Legendre on [0, V],
beyond which e^-tau no longer counts.  An error of u by the share eps moves an event by eps / w, as
dy/dt = -w u; so the single precision of u costs next to no time, where that of y would (a rounding
of y by 3e-7 is 0.2 us on a ramp of 1.5 a second).  What it does cost shows where the signal creeps:
a reference taken at the end of a dead time keeps the rounding of the lag then, up to 2e-7, which a
leak of .02 a second takes up to ten microseconds to cross when it comes to fire, seconds later.
For the same reason dx comes from the ratio of the two lights, not from a difference of logarithms.

Bound.  dy/dt = w (x - y) with w >= 0 makes y move towards x, so y turns only where it meets x,
that is, where u changes sign; between frames x is monotone, and u = y - x obeys
du/dtau = -u - dx/dtau, so u changes sign at most once.  Without a change y is monotone and stays
between y_0 and y_1.  With one, say from u_0 > 0: y falls until it meets the rising x, whose value
then is at least x_0, and rises from there; so y stays between min(x_0, y_1) and max(y_0, y_1); and
mirrored for u_0 < 0.  On the log branch the bound is tighter: up to the turn, y'' = w'(x - y) +
w(x' - y') has one sign where |u| < 1 (for u_0 < 0 both terms are negative; for u_0 > 0, with
w' <= w x', it is at least w x'(1 - |u|) + w^2 |u|), so y stays beyond its tangent at the start and
cannot meet x before that does, at s = |u_0| / (a_0 |u_0| + |dx|).

Leak only lowers the reference, by a known amount over the interval.  A pixel whose bound stays
clear of both thresholds by MARGIN cannot fire.  Always looked at again are pixels with the knee of
the log map inside the interval, a step above one e-fold, light beyond what the quadrature was
chosen for, the end of a dead time, or a noise event due.

The comparison is made on the distance of x from the reference, which is small, and which starts
from double precision at every call and after every event; MARGIN holds the rounding of what is
added to it in between.  A pixel that is looked at needlessly costs time, never an event.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import embedded, kernel
from adv2e.kernel import per_pixel, special
from adv2e.kernel.noise import next_noise
from adv2e.kernel.quadrature import REACH
from adv2e.kernel.work_queue import STRIP

LARGEST_STEP = 0.98
"""Change of log intensity above which a pixel is looked at in any case [ln units]."""

LARGEST_LIGHT = 1.5 * 255.0
"""Light above which a pixel is looked at in any case, as the quadrature is chosen for less [DN]."""

MARGIN = 1e-5
"""Rounding of a distance in single precision over a call, with room [ln units]."""

AT_REST = 1e-10
"""Lag below which it counts as none: a tenth of a tie (:data:`adv2e.kernel.comparator.TIE`)."""

NEVER = 1e30
"""Distance, or time, that is not reached."""

EARLY = 1.0 - 1e-6
"""Factor on due times: single precision must not make them late."""

STRIDE = STRIP + 16  # one cache line more: rows must not share cache sets
(
    LIGHT_0,  # light at the start of the interval [DN], and at its end
    LIGHT_1,
    LAG_0,  # y - x
    LAG_1,
    AWAY_0,  # x - reference
    AWAY_1,
    FALL,  # fall of the reference over the interval
    ON,  # thresholds, NEVER in dead time
    OFF,
    DUE,  # when something else is due: end of dead time, noise event [us since the call's start]
    DX,  # change of log intensity
    A1,
    KAPPA,
    Z,
    UPTO,
    TOTAL,
    HIT,  # whether a pixel is to be looked at, and why: see below
    WHEN,  # at rest: when a pixel is to be looked at, on the clock of DUE
    SOONEST,  # the earliest of these in each block
) = (row * STRIDE for row in range(19))
SIZE = 19 * STRIDE

_f = np.float32
_ZERO, _ONE, _TINY = _f(0.0), _f(1.0), _f(1e-30)
BY_SIGNAL, WHEN_DUE, BY_ITSELF = _f(1.0), _f(2.0), _f(3.0)
"""Values of row HIT: the signal may cross a threshold, a noise event or an end of a dead time is
due, or the bounds do not hold."""
_REACH = _f(REACH)
_MORE = _f(0.6)
_AT_REST = _f(AT_REST)
_STRAIGHT = _f(0.9)  # lag below which y is convex up to its turn
_LARGEST = (_ONE, _f(np.tanh(0.5 * LARGEST_STEP)))
_LARGEST_LIGHT = _f(LARGEST_LIGHT)


def new_rows() -> NDArray[np.float32]:
    """Return the flat array of rows of one strip; padding beyond its pixels must be harmless."""
    strip = np.zeros(SIZE, np.float32)
    strip[LIGHT_0 : LIGHT_0 + STRIDE] = 1.0
    strip[LIGHT_1 : LIGHT_1 + STRIDE] = 1.0
    for row in (ON, OFF, DUE):
        strip[row : row + STRIDE] = NEVER
    return strip


@kernel
def log_of(light, circuit):
    """Log intensity of light [DN] as loaded."""
    safe = light if light > 1e-30 else 1e-30
    x = special.log(safe)
    if circuit.slope > 0.0:
        x = x if light >= circuit.slope * circuit.knee else light / circuit.slope
    return x


@embedded
def _watched(hold, on_level, off_level, due, start):
    """Thresholds and due time of a pixel, as the rows of the screen have them.

    hold : end of its dead time, negative: it is in none; due : when a noise event is
    """
    is_held = hold >= 0.0
    return (
        NEVER if is_held else on_level - MARGIN,
        NEVER if is_held else off_level - MARGIN,
        (hold - start if is_held else min(due - start, NEVER)) * EARLY,
    )


@embedded
def watch(k, i, x1, start, circuit, state, strip):
    """Rows of the screen for pixel k of a strip, i of the state: distance, thresholds, due time."""
    strip[AWAY_1 + k] = x1 - state[per_pixel.REFERENCE, i]
    strip[ON + k], strip[OFF + k], strip[DUE + k] = _watched(
        state[per_pixel.HOLD, i], state[per_pixel.ON, i], state[per_pixel.OFF, i],
        next_noise(i, circuit, state)[1], start,
    )  # fmt: skip


@kernel
def watch_all(lo, count, start, circuit, state, strip):
    """Rows of the screen for the pixels of a strip, as :func:`watch` has them for one.

    Their distances are those at the start.
    """
    hi = lo + count
    x, reference = state[per_pixel.X, lo:hi], state[per_pixel.REFERENCE, lo:hi]
    on_level, off_level = state[per_pixel.ON, lo:hi], state[per_pixel.OFF, lo:hi]
    hold, shot = state[per_pixel.HOLD, lo:hi], state[per_pixel.SHOT_TIME, lo:hi]
    hot = state[per_pixel.HOT_TIME, lo:hi]
    for k in range(count):
        due = shot[k] if circuit.shot_rate > 0.0 else per_pixel.NEVER
        due = min(due, hot[k] if circuit.hot_rate > 0.0 else per_pixel.NEVER)
        strip[AWAY_0 + k] = x[k] - reference[k]
        strip[ON + k], strip[OFF + k], strip[DUE + k] = _watched(
            hold[k], on_level[k], off_level[k], due, start
        )


@kernel
def is_still(strip):
    """Tell whether no pixel's light changes over the interval."""
    moves = 0
    for k in range(STRIP):
        moves += strip[LIGHT_0 + k] != strip[LIGHT_1 + k]
    return moves == 0


@kernel
def is_settled(strip):
    """Tell whether every pixel's lag is gone."""
    lags = 0
    for k in range(STRIP):
        lags += strip[LAG_0 + k] != _ZERO
    return lags == 0


@kernel
def _prepare(strip, dark, per_dn, knee_dn, slope, inverse_slope):
    """Change of log intensity, and the parameters of the quadrature."""
    foot = slope * per_dn
    for k in range(STRIP):
        i0 = strip[LIGHT_0 + k]
        i1 = strip[LIGHT_1 + k]
        change = i1 - i0
        on_log = min(i0, i1) >= knee_dn
        straight = change * inverse_slope
        dx = special.log_ratio32(change / (i1 + i0 + _TINY))
        dx = dx if on_log else straight
        moving = per_dn * i1 if on_log else foot
        rate = dark + per_dn * i1
        up = dx if dx > _ZERO else _ZERO
        v = _REACH * (_ONE + _MORE * up) / (rate + _TINY)
        v = v if v < _ONE else _ONE
        z = dx * v
        strip[DX + k] = dx
        strip[A1 + k] = rate * v
        strip[KAPPA + k] = z * v * moving
        strip[Z + k] = -z if on_log else _ZERO
        strip[UPTO + k] = v
        strip[TOTAL + k] = _ZERO


@kernel
def _node(strip, node, weight):
    """Add one node of the quadrature."""
    square = node * node
    for k in range(STRIP):
        t = strip[KAPPA + k] * square * special.psi32(strip[Z + k] * node) - strip[A1 + k] * node
        strip[TOTAL + k] += weight * special.exp32(t)


@kernel
def _end_lags(strip):
    """Row LAG_1, once the integral is known."""
    for k in range(STRIP):
        v = strip[UPTO + k]
        # tau over the whole interval from that over [0, V]: equal where V = 1, else beyond reach
        t = strip[KAPPA + k] * special.psi32(strip[Z + k]) - strip[A1 + k]
        decay = special.exp32(t)
        decay = decay if v >= _ONE else _ZERO
        u = decay * strip[LAG_0 + k] - strip[DX + k] * (v * strip[TOTAL + k])
        strip[LAG_1 + k] = u if abs(u) > _AT_REST else _ZERO


@kernel
def flag(strip, end, dark, per_dn, knee_dn, seen, seen_after, on, off, factor, largest_step):
    """Rows AWAY_1 and HIT: distance at the end, and which pixels are to be looked at.

    Parameters
    ----------
    strip : flat float32
    end : float32
        End of the interval [us], on the clock of row DUE.
    dark, per_dn : float32
        Corner in darkness, and for each DN, times the interval [rad].
    knee_dn : float32
        Knee of the log map [DN].
    seen, seen_after : int
        Rows of the lag that the comparator sees, at the start and at the end: that of a second pole
        follows the first one's.
    on, off : int
        Rows of thresholds.
    factor : float32
        Least factor on these.
    largest_step : (2,) float32
        Change of log intensity above which a pixel is looked at in any case, on the foot and on the
        log branch; the latter as a ratio, (b - a)/(b + a).
    """
    # slices: indices that count from zero need no test of their sign, which vectors bear ill
    lag, lag_after = strip[seen : seen + STRIP], strip[seen_after : seen_after + STRIP]
    on_level, off_level = strip[on : on + STRIP], strip[off : off + STRIP]
    for k in range(STRIP):
        i0, i1 = strip[LIGHT_0 + k], strip[LIGHT_1 + k]
        u0, u1 = strip[LAG_0 + k], strip[LAG_1 + k]
        dx, fall = strip[DX + k], strip[FALL + k]
        d0 = strip[AWAY_0 + k]
        d1 = d0 + dx
        strip[AWAY_1 + k] = d1 + fall
        y0, y1 = d0 + u0, d1 + u1
        low, high = min(y0, y1), max(y0, y1)
        size = abs(u0)
        meet = size / ((dark + per_dn * i0) * size + abs(dx) + _TINY)
        meet = meet if meet < _ONE else _ONE
        meet = meet if (min(i0, i1) >= knee_dn) & (size < _STRAIGHT) else _ZERO
        turn = d0 + dx * meet
        turns = u0 * u1 < _ZERO
        low = min(low, turn) if turns else low
        high = max(high, turn) if turns else high
        # a second pole that is on its way to a first one that runs away from it does not turn
        q0, q1 = lag[k], lag_after[k]
        flees = ((u0 + u1 <= _ZERO) & (q0 <= u0)) | ((u0 + u1 >= _ZERO) & (q0 >= u0))
        low = min(d0 + q0, d1 + q1 if flees & (not turns) else low)
        high = max(d0 + q0, d1 + q1 if flees & (not turns) else high)
        hit = (high + fall >= on_level[k] * factor) | (-low >= off_level[k] * factor)
        mixed = (i0 < knee_dn) != (i1 < knee_dn)
        steep = (min(i0, i1) >= knee_dn) & (abs(i1 - i0) > largest_step[1] * (i0 + i1))
        far = steep | (abs(dx) > largest_step[0]) | (i1 > _LARGEST_LIGHT)
        reason = BY_SIGNAL if hit else _ZERO
        reason = WHEN_DUE if strip[DUE + k] < end else reason
        strip[HIT + k] = BY_ITSELF if mixed | far else reason


@kernel
def screen(strip, end, dark, per_dn, knee_dn, slope, rule):
    """Move every pixel of the strip to the end of the interval and flag those that may fire.

    Parameters
    ----------
    rows : flat float32
    end : float32
        End of the interval [us], on the clock of row DUE.
    dark, per_dn : float32
        Corner in darkness, and for each DN, times the interval [rad].
    knee_dn, slope : float32
        Knee of the log map [DN], light over log intensity on the foot; 0 without a knee.
    rule : Rule
    """
    inverse_slope = _ONE / slope if slope > _ZERO else _ZERO
    _prepare(strip, dark, per_dn, knee_dn, slope, inverse_slope)
    for c in range(rule.nodes.shape[0]):
        _node(strip, _f(rule.nodes[c]), _f(rule.weights[c]))
    _end_lags(strip)
    flag(strip, end, dark, per_dn, knee_dn, LAG_0, LAG_1, ON, OFF, _ONE, _LARGEST)


@kernel
def flagged(strip, index):
    """Fill `index` with the flagged pixels; returns their number."""
    m = 0
    for k in range(STRIP):
        index[m] = k
        m += 1 if strip[HIT + k] > _ZERO else 0
    return m


@kernel
def step_on(strip):
    """Make the end of this interval the start of the next."""
    for k in range(STRIP):
        strip[LIGHT_0 + k] = strip[LIGHT_1 + k]
        strip[LAG_0 + k] = strip[LAG_1 + k]
        strip[AWAY_0 + k] = strip[AWAY_1 + k]
