r"""All pixels of a strip over one interval: end values, and which pixels can fire.

End value.  With s = 0..1 over the interval, v = 1 - s and u = y - x,

.. math:: u_1 = e^{-\tau(1)} u_0 - \Delta x \int_0^1 e^{-\tau(v)} dv, \qquad
          \tau(v) = v\,(a_1 - \kappa\,v\,\psi(z v)), \quad \psi(z) = (e^z - 1 - z)/z^2

where a_1 is the corner at the end times the interval, kappa = dx B T I_1, z = -dx on the log branch
and kappa = dx B T dI/dx, z = 0 on the foot.  The integral is taken by Gauss and Legendre on [0, V],
beyond which e^-tau no longer counts.

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
clear of both thresholds cannot fire and is done; every other one is solved.  Pixels with the knee
inside the interval, a step above one e-fold, dead time, or a noise event due are always solved.

The margin covers rounding and the quadrature; crossings that are missed within it would be less
than the tolerance of a tie (see :mod:`adv2e.kernel.polynomial`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.jit import kernel
from adv2e.kernel import special
from adv2e.kernel.workspace import EULER, PAPER, ZERO_ORDER_HOLD

STRIP = 512
NODES_MAX = 32

LARGEST_STEP = 1.0
"""Change of log intensity above which a pixel is solved in any case [ln units]."""

LARGEST_LIGHT = 1.5 * 255.0
"""Light above which a pixel is solved in any case, as the quadrature is chosen for less [DN]."""

MARGIN = 1e-8
"""Rounding, and what is forgotten beyond REACH: e^-20 of a lag of a few e-folds [ln units]."""
AT_REST = 1e-12
STRAIGHT = 0.9
"""Lag below which y is convex up to its turn."""

REACH = 20.0
"""Corner times time beyond which the past is forgotten."""


def quadrature(length: float, fastest: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the fewest Gauss nodes and weights on [0, 1] good to 0.01 us of event time.

    Parameters
    ----------
    length : float
        The interval [us].
    fastest : float
        Corner at white [rad/us].

    Notes
    -----
    A relative error eps of the lag moves an event by eps / w.  The error is measured here, for
    corners up to LARGEST_LIGHT and steps of one e-fold either way, not estimated.
    """
    a1 = np.geomspace(1e-3, max(1.5 * fastest * length, 2e-3), 60)
    worst = 0.01 * a1 / length
    exact = _integral(a1, 120)
    for count in range(3, NODES_MAX):
        error = np.abs(_integral(a1, count) / exact - 1.0)
        if np.all(error <= np.maximum(worst, 1e-12)):
            break
    return _nodes(count)


def _nodes(count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    node, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (node + 1.0), 0.5 * weight


def _integral(a1: NDArray[Any], count: int) -> NDArray[Any]:
    """Integral of e^-tau for a light that is exponential in time, dx = -1, 0, 1."""
    node, weight = _nodes(count)
    rows = []
    for dx in (-1.0, -0.3, 0.0, 0.3, 1.0):
        upto = np.minimum(1.0, REACH * (1.0 + 0.6 * max(dx, 0.0)) / a1)
        v = upto[:, None] * node
        z = -dx * v
        half = np.where(np.abs(z) < 1e-4, 0.5 + z / 6, (np.expm1(z) - z) / np.where(z, z, 1) ** 2)
        tau = v * a1[:, None] * (1.0 - dx * v * half)
        rows.append(upto * (np.exp(-tau) @ weight))
    return np.array(rows)


@kernel
def load_strip(frame, circuit, floor, light, x):
    """Light that counts, and log intensity, of one strip of a frame [DN]."""
    knee_dn = circuit.slope * circuit.knee
    if circuit.slope > 0.0:
        for k in range(frame.shape[0]):
            v = np.float64(frame[k])
            v = v if v > 0.0 else 0.0
            light[k] = v
            w = v if v > knee_dn else knee_dn
            x[k] = special.log(w)
        for k in range(frame.shape[0]):
            x[k] = x[k] if light[k] >= knee_dn else light[k] / circuit.slope
    else:
        for k in range(frame.shape[0]):
            v = np.float64(frame[k])
            v = v if v > floor else floor
            light[k] = v
            x[k] = special.log(v)


@kernel
def _prepare(i0, i1, x0, x1, length, circuit, count, a1, kappa, z, upto):
    """Parameters of the quadrature, one column a pixel."""
    dark = circuit.dark * length
    per_dn = circuit.per_dn * length
    foot = circuit.slope * per_dn
    knee = circuit.knee
    for k in range(count):
        dx = x1[k] - x0[k]
        on_log = min(x0[k], x1[k]) >= knee
        a = dark + per_dn * i1[k]
        up = dx if dx > 0.0 else 0.0
        v = REACH * (1.0 + 0.6 * up) / (a + 1e-30)
        v = v if v < 1.0 else 1.0
        kap = dx * per_dn * i1[k] if on_log else dx * foot
        a1[k] = a * v
        kappa[k] = kap * v * v
        z[k] = -dx * v if on_log else 0.0
        upto[k] = v


@kernel
def quadrature_node(a1, kappa, z, node, weight, count, total):
    """Add one node of the quadrature to the totals of `count` columns."""
    for k in range(count):
        t = a1[k] * node - kappa[k] * (node * node) * special.psi(z[k] * node)
        total[k] += weight * special.exp(-t)


@kernel
def end_lags(i0, i1, x0, x1, lag, length, circuit, nodes, weights, count, columns, out):
    """Lag y - x at the end of the interval for every pixel of a strip."""
    a1, kappa, z = columns[0], columns[1], columns[2]
    upto, total = columns[3], columns[4]
    _prepare(i0, i1, x0, x1, length, circuit, count, a1, kappa, z, upto)
    for k in range(count):
        total[k] = 0.0
    for c in range(nodes.shape[0]):
        quadrature_node(a1, kappa, z, nodes[c], weights[c], count, total)
    for k in range(count):
        v = upto[k]
        # tau over the whole interval from that over [0, V]: equal where V = 1, else beyond reach
        t = a1[k] - kappa[k] * special.psi(z[k])
        decay = special.exp(-t) if v >= 1.0 else 0.0
        u = decay * lag[k] - (x1[k] - x0[k]) * v * total[k]
        out[k] = u if abs(u) > 1e-30 else 0.0


@kernel
def _step_rates(x, circuit, part, count, rate):
    """Corner times sub-step at log intensity x."""
    if circuit.slope > 0.0:
        for k in range(count):
            foot = x[k] * circuit.slope
            light = special.exp(x[k])
            light = foot if x[k] < circuit.knee else light
            rate[k] = part * (circuit.dark + circuit.per_dn * light)
    else:
        for k in range(count):
            rate[k] = part * (circuit.dark + circuit.per_dn * special.exp(x[k]))


@kernel
def stepped_lags(i0, i1, x0, x1, lag, length, circuit, count, columns, out, low, high):
    """End lags of the K-step forms, and the least and greatest signal at the steps' ends.

    The signal is a straight line in each step, so these bound it.
    """
    y, before, after = columns[0], columns[1], columns[2]
    part = length / circuit.steps
    for k in range(count):
        y[k] = x0[k] + lag[k]
        low[k] = y[k]
        high[k] = y[k]
    _step_rates(x0, circuit, part, count, before)
    xs, dx = columns[3], columns[4]
    for k in range(count):
        dx[k] = x1[k] - x0[k]
    for step in range(1, circuit.steps + 1):
        share = step / circuit.steps
        if step == circuit.steps:
            for k in range(count):
                xs[k] = x1[k]
        else:
            for k in range(count):
                xs[k] = x0[k] + dx[k] * share
        _step_rates(xs, circuit, part, count, after)
        _step(y, x0, xs, dx, 1.0 / circuit.steps, before, after, circuit.update, count)
        for k in range(count):
            v = y[k]
            low[k] = v if v < low[k] else low[k]
            high[k] = v if v > high[k] else high[k]
            before[k] = after[k]
    for k in range(count):
        out[k] = y[k] - x1[k]


@kernel
def _step(y, x0, xs, dx, share, before, after, update, count):
    """One step of each pixel of a strip, as low_pass.stepped."""
    if update == PAPER:
        for k in range(count):
            y[k] = special.exp(-after[k]) * y[k] + after[k] * xs[k]
    elif update == EULER:
        for k in range(count):
            a = after[k] if after[k] < 1.0 else 1.0
            y[k] = (1.0 - a) * y[k] + a * xs[k]
    elif update == ZERO_ORDER_HOLD:
        for k in range(count):
            e = special.exp(-after[k])
            y[k] = e * y[k] + (1.0 - e) * xs[k]
    else:
        for k in range(count):
            a = 0.5 * (before[k] + after[k])
            e = special.exp(-a)
            mean = (1.0 - e) / a if a > 1e-3 else 1.0 - a / 2.0 + a * a / 6.0
            y[k] = e * y[k] + (mean - e) * (xs[k] - dx[k] * share) + (1.0 - mean) * xs[k]


@kernel
def hull(i0, x0, x1, lag, lag_end, length, circuit, count, low, high):
    """Bound of the exact signal over the interval, see the top of this module."""
    dark = circuit.dark * length
    per_dn = circuit.per_dn * length
    for k in range(count):
        y0 = x0[k] + lag[k]
        y1 = x1[k] + lag_end[k]
        turns = lag[k] * lag_end[k] < 0.0
        lo = y0 if y0 < y1 else y1
        hi = y0 if y0 > y1 else y1
        away = abs(lag[k])
        dx = x1[k] - x0[k]
        meet = away / ((dark + per_dn * i0[k]) * away + abs(dx) + 1e-300)
        meet = meet if meet < 1.0 else 1.0
        on_log = (x0[k] >= circuit.knee) & (x1[k] >= circuit.knee)
        turn = x0[k] + dx * meet if on_log & (away < STRAIGHT) else x0[k]
        lo = turn if turns & (turn < lo) else lo
        hi = turn if turns & (turn > hi) else hi
        low[k] = lo
        high[k] = hi


@kernel
def rest_hull(x0, x1, lag, lag2, count, low, high):
    """Bound for circuits that are not screened: only a pixel at rest stays where it is."""
    for k in range(count):
        at_rest = (x1[k] == x0[k]) & (abs(lag[k]) < AT_REST) & (abs(lag2[k]) < AT_REST)
        low[k] = x0[k] - AT_REST if at_rest else -1e300
        high[k] = x0[k] + AT_REST if at_rest else 1e300


@kernel
def flag_strip(light, x0, x1, low, high, reference, on, off, fall, knee, count, flags):
    """Flag the pixels whose bound reaches a threshold, or that must be solved in any case."""
    any_flag = False
    for k in range(count):
        below = (x0[k] < knee) != (x1[k] < knee)
        # plain | instead of or: no branches, so that the loop vectorises
        hit = (
            (high[k] + fall[k] - reference[k] >= on[k] - MARGIN)
            | (reference[k] - low[k] >= off[k] - MARGIN)
            | below
            | (abs(x1[k] - x0[k]) > LARGEST_STEP)
            | (light[k] > LARGEST_LIGHT)
        )
        flags[k] = hit
        any_flag |= hit
    return any_flag
