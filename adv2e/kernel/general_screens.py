"""Screens for the circuits that :mod:`adv2e.kernel.screen` does not cover, in double precision.

The K-step forms are bounded by the signal at their steps' ends, as it is a straight line between
them; without a low-pass the signal is x itself; with a second pole only a pixel at rest is known to
stay where it is.
"""

from __future__ import annotations

import numpy as np

from adv2e.compiled import entry, kernel
from adv2e.kernel import special
from adv2e.kernel.workspace import (
    EULER,
    PAPER,
    S_HOLD,
    S_HOT_TIME,
    S_SHOT_TIME,
    ZERO_ORDER_HOLD,
)

MARGIN = 1e-9
"""Rounding of a bound [ln units]."""

AT_REST = 1e-12
"""Lag below which a pixel counts as resting [ln units]."""


@entry
def load_strip(frame, circuit, light, x):
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
            v = v if v > circuit.floor else circuit.floor
            light[k] = v
            x[k] = special.log(v)


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
def stepped_lags(x0, x1, lag, length, circuit, count, columns, out, low, high):
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
def line_hull(x0, x1, lag_end, count, low, high):
    """Bound without a low-pass, where the signal is x itself."""
    for k in range(count):
        lag_end[k] = 0.0
        low[k] = min(x0[k], x1[k])
        high[k] = max(x0[k], x1[k])


@kernel
def rest_hull(x0, x1, lag, lag2, update, count, lag_end, low, high):
    """Bound behind a second pole: only a pixel at rest stays where it is.

    The paper's form has no rest without lag: its weights do not sum to one.
    """
    rests = update != PAPER
    for k in range(count):
        still = (x1[k] == x0[k]) & (abs(lag[k]) < AT_REST) & (abs(lag2[k]) < AT_REST)
        at_rest = rests & still
        lag_end[k] = lag[k]
        low[k] = x0[k] - AT_REST if at_rest else -1e300
        high[k] = x0[k] + AT_REST if at_rest else 1e300


@kernel
def flag_strip(low, high, reference, on, off, fall, count, flags):
    """Flag the pixels whose bound reaches a threshold."""
    for k in range(count):
        # plain | instead of or: no branches, so that the loop vectorises
        flags[k] = (high[k] + fall[k] - reference[k] >= on[k] - MARGIN) | (
            reference[k] - low[k] >= off[k] - MARGIN
        )


@kernel
def flag_due(lo, count, end, circuit, state, flags):
    """Flag the pixels in dead time, and those with a noise event due before `end`."""
    if circuit.dead_time > 0.0:
        for k in range(count):
            flags[k] |= state[S_HOLD, lo + k] >= 0.0
    if circuit.shot_rate > 0.0:
        for k in range(count):
            flags[k] |= state[S_SHOT_TIME, lo + k] < end
    if circuit.hot_rate > 0.0:
        for k in range(count):
            flags[k] |= state[S_HOT_TIME, lo + k] < end
