"""One pixel over one interval: the circuit as short power series (exact), or K steps.

``exact``.  On a piece where x is linear in time and the light follows one branch of the log map,

    du/dt = -(A + B I) u - dx/dt,      u = y - x

has an analytic solution whose Taylor coefficients follow from a recurrence: I is an exponential
(log branch) or linear (foot), so is the product's Cauchy sum.  Sub-steps are so short that the
series converges to 1e-11 (radius (w + |dx/dt|) h <= 1.6, order up to 16); the leak is one more
polynomial, and event times are roots of polynomials.  No step depends on K, tiles, chunks or
threads.

The K-step forms make one straight line a step, of the second pole, too, and go through the same
comparator.

References
----------
.. [1] A. Jorba, M. Zou, "A software package for the numerical integration of ODEs by means of
   high-order Taylor methods", Experimental Mathematics 14(1), 2005,
   doi:10.1080/10586458.2005.10128904.
"""

from __future__ import annotations

import math

from adv2e.compiled import inlined, kernel
from adv2e.effects.pixel.leak import leak_series
from adv2e.effects.pixel.low_pass import lag_series, ramp_response, stepped
from adv2e.kernel.comparator import events_of_series
from adv2e.kernel.polynomial import at_end
from adv2e.kernel.workspace import (
    EXACT,
    LAG,
    LAG2,
    LIGHT,
    ORDER_MAX,
    S_LAG,
    S_LAG2,
    S_ON,
    SIGNAL,
)

RADIUS = 1.6
_TOLERANCE = 1e-11


@kernel
def light_of(x, circuit):
    """Light [DN] that log intensity x stands for."""
    if circuit.slope > 0.0 and x < circuit.knee:
        return x * circuit.slope
    return math.exp(x)


@kernel
def _order_for(radius):
    """Order at which the series of e^radius has converged."""
    term = radius
    k = 1
    while term > _TOLERANCE and k < ORDER_MAX:
        k += 1
        term *= radius / k
    return max(k, 2)


@inlined
def _light_series(ws, order, light, dx, log_branch, slope):
    """Row LIGHT on one sub-step over which x moves by dx."""
    ws[LIGHT, 0] = light
    if log_branch:
        for k in range(order):
            ws[LIGHT, k + 1] = ws[LIGHT, k] * dx / (k + 1)
    else:
        ws[LIGHT, 1] = slope * dx
        for k in range(2, order + 1):
            ws[LIGHT, k] = 0.0


@kernel
def _substep_length(rest, rate, rate_end, speed):
    """Length of the next sub-step: the rest, or an equal part of it short enough to converge."""
    fastest = rate if rate > rate_end else rate_end
    # the small number: nothing moves in full darkness without a dark corner
    limit = RADIUS / (fastest + speed + 1e-300)
    if rest <= limit:
        return rest, fastest
    return rest / math.ceil(rest / limit), fastest


@inlined
def _line_series(i, ws, x, dx, light, light_end, rate, rate_end, length, circuit, state):
    """Rows LAG and LIGHT for one step of the forms that draw a straight line."""
    y = x + state[S_LAG, i]
    after = x + dx
    if circuit.filtered:
        after = stepped(y, x, x + dx, rate * length, rate_end * length, circuit.update)
    state[S_LAG, i] = after - (x + dx)
    ws[LAG, 0] = y - x
    ws[LAG, 1] = state[S_LAG, i] - ws[LAG, 0]
    ws[LIGHT, 0] = light
    ws[LIGHT, 1] = light_end - light


@inlined
def _follower_line(i, ws, x, dx, length, circuit, state):
    """Row LAG2 for one step of the forms that draw a straight line."""
    before = x + state[S_LAG2, i]
    first = x + ws[LAG, 0]
    second = x + dx + ws[LAG, 0] + ws[LAG, 1]
    after = ramp_response(before, first, second, circuit.follower * length)
    ws[LAG2, 0] = state[S_LAG2, i]
    state[S_LAG2, i] = after - (x + dx)
    ws[LAG2, 1] = state[S_LAG2, i] - ws[LAG2, 0]


@inlined
def solve_interval(
    i, xa, base, step, xb, ta, length, t_base, circuit, state, ws, keys, times, n
):  # fmt: skip
    """Events of pixel i over one interval.

    The continuity samples are base + step k/K for k = 1 .. K-1, from xa at the start to xb at the
    end.  With base = xa and step = xb - xa they lie on one line, which ``exact`` takes whole.  A
    straight part is split where it passes the knee of the log map, and each piece is taken in
    sub-steps short enough for its series, or as one line.
    """
    exact = circuit.update == EXACT
    leaks = circuit.leak > 0.0 or circuit.photo_leak > 0.0
    count = 1 if exact and base == xa and step == xb - xa else circuit.steps
    part = length / count
    k = 0
    x = xa  # where the signal's input is
    part_end = xa  # where it is at the end of the present sample, piece
    piece_end = xa
    t = 0.0  # since the start of the interval
    t_part = 0.0
    t_piece = 0.0
    log_branch = True
    rate_end = 0.0
    speed = 0.0
    while True:
        if t >= t_piece:
            x = piece_end
            if t >= t_part:
                if k == count:
                    return n
                k += 1
                part_end = xb if k == count else base + step * (k / count)
                t_part = length if k == count else k * part
            piece_end = part_end
            t_piece = t_part
            if exact and circuit.slope > 0.0:
                knee = circuit.knee
                if (x < knee and part_end > knee) or (x > knee and part_end < knee):
                    t_piece = t + (t_part - t) * ((knee - x) / (part_end - x))
                    piece_end = knee
                log_branch = x + piece_end > 2.0 * knee or (x == knee and piece_end == knee)
            rate_end = circuit.dark + circuit.per_dn * light_of(piece_end, circuit)
            speed = abs(piece_end - x) / (t_piece - t) if t_piece > t else 0.0
            if t >= t_piece:
                continue
        rest = t_piece - t
        if exact:
            light = math.exp(x) if log_branch else x * circuit.slope
        else:
            light = light_of(x, circuit)
        rate = circuit.dark + circuit.per_dn * light
        lag = state[S_LAG, i]
        h = rest
        dx = piece_end - x
        order = 1
        monotone = False
        if exact:
            h, fastest = _substep_length(rest, rate, rate_end, speed)
            dx *= h / rest
            radius = abs(dx)
            if circuit.filtered:
                radius += fastest * h
            order = _order_for(radius)
            _light_series(ws, order, light, dx, log_branch, circuit.slope)
            if circuit.filtered:
                lag_series(ws, order, lag, dx, h, circuit)
                end = at_end(ws, LAG, order)
                state[S_LAG, i] = end if abs(end) > 1e-30 else 0.0
            else:
                for j in range(order + 1):
                    ws[LAG, j] = 0.0
        else:
            light_end = light_of(piece_end, circuit)
            _line_series(i, ws, x, dx, light, light_end, rate, rate_end, h, circuit, state)
        row = LAG
        if circuit.follower > 0.0:
            row = LAG2
            _follower_line(i, ws, x, dx, h, circuit, state)
        for j in range(order + 1):
            ws[SIGNAL, j] = ws[row, j]
        ws[SIGNAL, 0] += x
        ws[SIGNAL, 1] += dx
        if order == 1:
            end = ws[SIGNAL, 0] + ws[SIGNAL, 1]
            low, high = min(ws[SIGNAL, 0], end), max(ws[SIGNAL, 0], end)
        else:
            # y turns only where it meets x, see screen.py
            end = x + dx + state[S_LAG, i]
            low, high = min(x + lag, end), max(x + lag, end)
            monotone = not leaks
            if lag * state[S_LAG, i] < 0.0:
                low, high, monotone = min(low, x), max(high, x), False
        if leaks:
            leak_series(ws, order, h, state[S_ON, i], circuit)
        n = events_of_series(
            i, ta + t, h, order, low, high, monotone, t_base, circuit, state, ws, keys, times, n
        )
        if h >= rest:
            t = t_piece
        else:
            t += h
            x += dx
