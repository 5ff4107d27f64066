"""The first pass of the cascade: all pixels of a strip over one piece of an interval.

It moves every pixel through the substeps of the piece, keeps both lags at the end of each, and
tells which pixels may fire.  All of it is single precision and free of branches, as in
:mod:`adv2e.kernel.screen`, whose rows these follow.

Bound.  The second pole moves its output towards its input, so over the piece it stays between its
value at the start and the extremes of its input, which :mod:`adv2e.kernel.screen` bounds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import screen, special
from adv2e.kernel.cascade.plan import MOST
from adv2e.kernel.photoreceptor import strip as photoreceptor
from adv2e.kernel.screen import STRIDE
from adv2e.kernel.work_queue import STRIP

LARGEST_STEP = 0.3
"""Change of log intensity over a piece above which a pixel is solved by itself [ln units]."""

LARGEST = (np.float32(LARGEST_STEP), np.float32(np.tanh(0.5 * LARGEST_STEP)))
"""LARGEST_STEP as :func:`adv2e.kernel.screen.flag` takes it: on the foot, as a ratio on the log
branch."""

_BEGIN = screen.SIZE
LIGHT = _BEGIN  # at the start of the substep [DN]
GROWS = _BEGIN + STRIDE  # change of its logarithm in the piece, 0 on the foot
RISES = _BEGIN + 2 * STRIDE  # change of the light itself there, 0 on the log branch
FIRST = _BEGIN + 3 * STRIDE  # lag of the first pole at the start, and after each substep
SECOND = FIRST + (MOST + 1) * STRIDE  # the same of the second pole: y - x
ON = SECOND + (MOST + 1) * STRIDE  # what noise leaves of the thresholds
OFF = ON + STRIDE
SIZE = OFF + STRIDE

_f = np.float32
_ZERO, _ONE, _HALF, _TINY = _f(0.0), _f(1.0), _f(0.5), _f(1e-30)
_FOUR, _TWO, _SIXTH = _f(4.0), _f(2.0), _f(1.0 / 6.0)
_AT_REST = _f(screen.AT_REST)
_FORGOTTEN = _f(80.0)
_P0, _P1, _P2, _P3, _P4, _P5, _P6, _P7 = (
    _f(c)
    for c in (
        *(0.9999999905459108, -0.4999993866158137, 0.1666601111568939, -0.04163981341361955),
        *(0.008278784004239178, -0.001327672549396723, 0.0001590395143157818),
        -1.0502782956506526e-05,
    )
)
_M0, _M1, _M2, _M3, _M4 = (
    _f(c)
    for c in (
        *(0.1666619514550658, -0.08321197508047128, 0.02449272805990381),
        *(-0.004791065575097462, 0.00048696300379811474),
    )
)


def new_rows() -> NDArray[np.float32]:
    """Return the flat array of rows of one strip."""
    strip = np.zeros(SIZE, np.float32)
    strip[: screen.SIZE] = screen.new_rows()
    return strip


@kernel
def decay32(a):
    """e^-a, (1 - e^-a)/a, and half the integral of v (1 - v) e^(-a v) over 0..1.

    In single precision, for a >= 0; the last one is good to 6e-5 of it.
    """
    decay = special.exp32(-min(a, _FORGOTTEN))
    short = min(a, _TWO)
    p = _P3 + short * (_P4 + short * (_P5 + short * (_P6 + short * _P7)))
    p = _P0 + short * (_P1 + short * (_P2 + short * p))
    turn = _M0 + short * (_M1 + short * (_M2 + short * (_M3 + short * _M4)))
    one_over = _ONE / max(a, _TWO)
    is_short = a < _TWO
    p = p if is_short else (_ONE - decay) * one_over
    long_turn = ((a - _TWO) + (a + _TWO) * decay) * one_over * one_over * one_over
    return decay, p, _HALF * (turn if is_short else long_turn)


@kernel
def _grow32(z):
    """e^z in single precision for |z| < 0.16."""
    p = _ONE + z * (_HALF + z * (_SIXTH + z * (_f(1 / 24) + z * _f(1 / 120))))
    return _ONE + z * p


@kernel
def _prepare(strip, knee_dn, inverse_slope):
    """Rows DX, of the piece, and those of the light."""
    for k in range(STRIP):
        i0, i1 = strip[screen.LIGHT_0 + k], strip[screen.LIGHT_1 + k]
        change = i1 - i0
        on_log = min(i0, i1) >= knee_dn
        ratio = change / (i1 + i0 + _TINY)
        ratio = min(max(ratio, -LARGEST[1]), LARGEST[1])  # beyond, it is solved by itself
        dx = special.log_ratio32(ratio) if on_log else change * inverse_slope
        strip[screen.DX + k] = dx
        strip[LIGHT + k] = i0
        strip[GROWS + k] = dx if on_log else _ZERO
        strip[RISES + k] = _ZERO if on_log else change


@kernel
def _substep(strip, first, second, share, dark, per_dn, weights):
    """Rows `first` and `second` after the one substep that begins with the rows of that name.

    share : of the piece that the substep takes
    dark, per_dn : corner in darkness, and for each DN, times the substep [rad].
    """
    # slices: indices that count from zero need no test of their sign, which vectors bear ill
    lag, lag_after = strip[first : first + STRIP], strip[first + STRIDE : first + STRIDE + STRIP]
    seen = strip[second : second + STRIP]
    seen_after = strip[second + STRIDE : second + STRIDE + STRIP]
    keep, ramp = _f(weights[0]), _f(weights[7])
    p0, s0, c0 = _f(weights[1]), _f(weights[2]), _f(weights[3])
    p1, s1, c1 = _f(weights[4]), _f(weights[5]), _f(weights[6])
    half = _HALF * share
    for k in range(STRIP):
        bend, rise = strip[GROWS + k] * share, strip[RISES + k] * share
        growth = _grow32(strip[GROWS + k] * half)
        d, i0 = strip[screen.DX + k] * share, strip[LIGHT + k]
        middle = i0 * growth + _HALF * rise
        i1 = middle * growth + _HALF * rise
        a = dark + per_dn * ((i0 + _FOUR * middle + i1) * _SIXTH)
        c = per_dn * (i1 - i0)
        u0 = lag[k]
        decay, shape, turn = decay32(a)
        u1 = decay * u0 - d * (shape - c * turn)
        u1 = u1 if abs(u1) > _AT_REST else _ZERO
        w0, w1 = dark + per_dn * i0, dark + per_dn * i1
        # how the corner changes at both ends: with the light, which grows by itself or in a line
        g0, g1 = per_dn * (i0 * bend + rise), per_dn * (i1 * bend + rise)
        slope0, slope1 = -(w0 * u0 + d), -(w1 * u1 + d)
        curve0, curve1 = -(g0 * u0 + w0 * slope0), -(g1 * u1 + w1 * slope1)
        q1 = keep * seen[k] - ramp * d
        q1 += (p0 * u0 + p1 * u1) + (s0 * slope0 + s1 * slope1) + (c0 * curve0 + c1 * curve1)
        strip[LIGHT + k] = i1
        lag_after[k] = u1
        seen_after[k] = q1 if abs(q1) > _AT_REST else _ZERO


@kernel
def follow(strip, substeps, places, length, circuit, weights):
    """Move every pixel through the substeps of a piece of `length` us, which end at `places` of it.

    weights : (substeps, WEIGHTS)
    """
    slope = _f(circuit.slope)
    inverse_slope = _ONE / slope if slope > _ZERO else _ZERO
    _prepare(strip, _f(circuit.slope * circuit.knee), inverse_slope)
    for k in range(STRIP):
        strip[FIRST + k] = strip[screen.LAG_0 + k]
    for j in range(substeps):
        span = places[j + 1] - places[j]
        h = span * length
        _substep(
            strip, FIRST + j * STRIDE, SECOND + j * STRIDE, _f(span), _f(circuit.dark * h),
            _f(circuit.per_dn * h), weights[j],
        )  # fmt: skip
    last = strip[FIRST + substeps * STRIDE : FIRST + substeps * STRIDE + STRIP]
    for k in range(STRIP):
        strip[screen.LAG_1 + k] = last[k]


@kernel
def stay(strip):
    """Rows of a piece over which nothing moves and no lag is left, as one substep."""
    for k in range(STRIP):
        strip[screen.DX + k] = _ZERO
        strip[screen.LAG_1 + k] = _ZERO
        strip[FIRST + k] = _ZERO
        strip[SECOND + k] = _ZERO
    for k in range(STRIP):
        strip[FIRST + STRIDE + k] = _ZERO
        strip[SECOND + STRIDE + k] = _ZERO


@kernel
def flag_still(strip, end, on, off, factor):
    """Rows AWAY_1 and HIT of :func:`adv2e.kernel.screen.flag`, where nothing moves or lags."""
    on_level, off_level = strip[on : on + STRIP], strip[off : off + STRIP]
    for k in range(STRIP):
        away = strip[screen.AWAY_0 + k]
        after = away + strip[screen.FALL + k]
        strip[screen.AWAY_1 + k] = after
        hit = (after >= on_level[k] * factor) | (-away >= off_level[k] * factor)
        reason = screen.BY_SIGNAL if hit else _ZERO
        strip[screen.HIT + k] = screen.WHEN_DUE if strip[screen.DUE + k] < end else reason


@kernel
def leave_room(strip, factor, noise):
    """Rows ON and OFF: what is left of the thresholds, which have a factor, beside noise."""
    for k in range(STRIP):
        strip[ON + k] = strip[screen.ON + k] * factor - noise[photoreceptor.HIGH + k]
        strip[OFF + k] = strip[screen.OFF + k] * factor + noise[photoreceptor.LOW + k]


@kernel
def step_on(strip, substeps, still):
    """Make the end of this piece the start of the next; `still`: nothing moves or lags."""
    if still:
        for k in range(STRIP):
            strip[screen.AWAY_0 + k] = strip[screen.AWAY_1 + k]
        return
    screen.step_on(strip)
    last = strip[SECOND + substeps * STRIDE : SECOND + substeps * STRIDE + STRIP]
    for k in range(STRIP):
        strip[SECOND + k] = last[k]


@kernel
def is_settled(strip):
    """Tell whether no pixel has a lag."""
    lags = 0
    for k in range(STRIP):
        lags += (strip[screen.LAG_0 + k] != _ZERO) | (strip[SECOND + k] != _ZERO)
    return lags == 0
