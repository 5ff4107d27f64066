r"""Places within an interval, found for many pixels at a time: one pixel a lane.

Three vectorised steps serve all lanes, whatever each is looking for (a threshold, the turn of the
signal, or just the signal at a given time):

1. `guess`: the root of the cubic through values and slopes at both ends of the search;
2. `evaluate`: the lag there, by the quadrature of :mod:`adv2e.kernel.screen` in double precision;
3. `refine`: the root of the Taylor polynomial of order 6 about that place.

The polynomial's remainder says how far off the root can be; a lane over the tolerance goes round
again from the better place, by itself: what its neighbours do does not count.

The end of a dead time is a given place close to one that is known, so `evaluate_release` starts
from there: over so short a time fewer nodes do.
"""

from __future__ import annotations

from adv2e.compiled import inlined, kernel
from adv2e.kernel import screen, special
from adv2e.kernel.comparator import TIE
from adv2e.kernel.lanes import rows
from adv2e.kernel.quadrature import REACH


@kernel
def guess(lanes, count, length, circuit):
    """First place: root of the cubic through both ends, by guarded Newton steps.

    What is to be zero is the lag, or its sum with x and the fall of the reference, less the goal.
    """
    dark, per_dn = circuit.dark * length, circuit.per_dn * length
    for k in range(count):
        # loaded before they are chosen from: loads in a branch do not vectorise
        on, off = lanes[rows.ON + k] + TIE, lanes[rows.OFF + k] + TIE
        s, w = lanes[rows.S + k], lanes[rows.STOP + k] - lanes[rows.S + k]
        lag_s, lag_p = lanes[rows.LAG_S + k], lanes[rows.LAG_P + k]
        away_s, away_p = lanes[rows.AWAY_S + k], lanes[rows.AWAY_P + k]
        light_s, light_p = lanes[rows.LIGHT_S + k], lanes[rows.LIGHT_P + k]
        fall, fall_dn, dx = lanes[rows.FALL + k], lanes[rows.FALL_DN + k], lanes[rows.DX + k]
        origin = lanes[rows.REFERENCE + k] - lanes[rows.X0 + k]
        seeks, place = lanes[rows.SEEKS + k], lanes[rows.PLACE + k]
        turn = seeks == rows.TURN
        level = on if seeks == rows.SEEK_ON else -off
        lanes[rows.GOAL + k] = 0.0 if turn else origin + level
        f0 = lag_s if turn else away_s - level
        f1 = lag_p if turn else away_p - level
        # the slope of the lag is -w u - dx, that of the distance -w u plus the leak
        drift_s = -dx if turn else fall + fall_dn * light_s
        drift_p = -dx if turn else fall + fall_dn * light_p
        g0 = (drift_s - (dark + per_dn * light_s) * lag_s) * w
        g1 = (drift_p - (dark + per_dn * light_p) * lag_p) * w
        c2 = 3.0 * (f1 - f0) - 2.0 * g0 - g1
        c3 = g0 + g1 - 2.0 * (f1 - f0)
        t = f0 / (f0 - f1 if f0 != f1 else 1.0)
        for _ in range(3):
            v = f0 + t * (g0 + t * (c2 + t * c3))
            dv = g0 + t * (2.0 * c2 + 3.0 * t * c3)
            q = t - v / (dv if dv != 0.0 else 1.0)
            t = q if (q > 0.0) & (q < 1.0) else t
        fresh = (lanes[rows.MOVES + k] > 0.5) & (lanes[rows.TRIED + k] < 0.5)
        lanes[rows.PLACE + k] = s + w * t if fresh else place


@inlined
def _light_after(i0, d, on_log, slope):
    """Light once x has moved by d, its mean until then, and z of the quadrature."""
    grown = i0 * special.exp(d)
    light = grown if on_log else i0 + slope * d
    z = -d if on_log else 0.0
    mean = light * (1.0 - d * special.psi(z)) if on_log else 0.5 * (i0 + light)
    return light, mean, z


@inlined
def _exponent(light, span, d, z, on_log, dark, per_dn, slope):
    """Parameters of the quadrature over `span`: a1, kappa, z, and how far back it reaches."""
    a = (dark + per_dn * light) * span
    up = d if d > 0.0 else 0.0
    v = REACH * (1.0 + 0.6 * up) / (a + 1e-30)
    v = v if v < 1.0 else 1.0
    moving = light if on_log else slope
    return a * v, d * span * per_dn * moving * v * v, z * v, v


@inlined
def _set_up(began, light_began, lanes, count, dark, per_dn, slope):
    """Light and its integral at each place, and the parameters of the quadrature."""
    for k in range(count):
        span = lanes[rows.PLACE + k] - lanes[began + k]
        d = lanes[rows.DX + k] * span
        on_log = lanes[rows.LOG + k] > 0.5
        light, mean, z = _light_after(lanes[light_began + k], d, on_log, slope)
        lanes[rows.LIGHT_E + k] = light
        lanes[rows.SUM_E + k] = span * mean
        a1, kappa, z, v = _exponent(light, span, d, z, on_log, dark, per_dn, slope)
        lanes[rows.A1 + k] = a1
        lanes[rows.KAPPA + k] = kappa
        lanes[rows.Z + k] = z
        lanes[rows.UPTO + k] = v
        lanes[rows.TOTAL + k] = 0.0


@kernel
def _node(lanes, count, node, weight):
    """Add one node of the quadrature."""
    square = node * node
    for k in range(count):
        t = lanes[rows.A1 + k] * node - lanes[rows.KAPPA + k] * square * special.psi(
            lanes[rows.Z + k] * node
        )
        lanes[rows.TOTAL + k] += weight * special.exp(-t)


@inlined
def _evaluate_from(
    began, light_began, lag_began, lanes, count, length, circuit, nodes, weights
):  # fmt: skip
    """Lag, light and integral of the light of each lane at its place.

    The integral begins at the place in row `began`, where light and lag are in `light_began` and
    `lag_began`.
    """
    dark = circuit.dark * length
    per_dn = circuit.per_dn * length
    _set_up(began, light_began, lanes, count, dark, per_dn, circuit.slope)
    for c in range(nodes.shape[0]):
        _node(lanes, count, nodes[c], weights[c])
    for k in range(count):
        span = lanes[rows.PLACE + k] - lanes[began + k]
        t = dark * span + per_dn * lanes[rows.SUM_E + k]
        gone = lanes[rows.DX + k] * span * lanes[rows.UPTO + k] * lanes[rows.TOTAL + k]
        lanes[rows.LAG_E + k] = special.exp(-t) * lanes[lag_began + k] - gone


@kernel
def evaluate(lanes, count, length, circuit, rule):
    """Evaluate lag and light at each place, from the start of the piece on."""
    _evaluate_from(
        rows.BASE, rows.I0, rows.U0, lanes, count, length, circuit, rule.nodes, rule.weights
    )


@kernel
def evaluate_release(lanes, count, length, circuit, rule):
    """Evaluate lag and light at ends of dead times, from the last known place on."""
    _evaluate_from(
        rows.S, rows.LIGHT_S, rows.LAG_S, lanes, count, length, circuit, rule.nodes_dead,
        rule.weights_dead,
    )  # fmt: skip


@kernel
def refine(lanes, count, length, circuit):
    """Move each place to the root of the Taylor polynomial there; note what may be left.

    Light and its integral move along.
    """
    dark = circuit.dark * length
    per_dn = circuit.per_dn * length
    slope = circuit.slope
    for k in range(count):
        s = lanes[rows.PLACE + k]
        d = lanes[rows.DX + k]
        on_log = lanes[rows.LOG + k] > 0.5
        i0 = lanes[rows.LIGHT_E + k]
        i1 = d * i0 if on_log else slope * d
        e = d if on_log else 0.0
        i2 = i1 * e / 2.0
        i3 = i2 * e / 3.0
        i4 = i3 * e / 4.0
        w0 = dark + per_dn * i0
        w1, w2, w3 = per_dn * i1, per_dn * i2, per_dn * i3
        w4, w5 = per_dn * i4, per_dn * i4 * e / 5.0
        u0 = lanes[rows.LAG_E + k]
        u1 = -w0 * u0 - d
        u2 = -(w0 * u1 + w1 * u0) / 2.0
        u3 = -(w0 * u2 + w1 * u1 + w2 * u0) / 3.0
        u4 = -(w0 * u3 + w1 * u2 + w2 * u1 + w3 * u0) / 4.0
        u5 = -(w0 * u4 + w1 * u3 + w2 * u2 + w3 * u1 + w4 * u0) / 5.0
        u6 = -(w0 * u5 + w1 * u4 + w2 * u3 + w3 * u2 + w4 * u1 + w5 * u0) / 6.0
        turn = lanes[rows.SEEKS + k] == rows.TURN
        root = 0.0 if turn else 1.0
        fall = root * lanes[rows.FALL + k]
        q = root * lanes[rows.FALL_DN + k]
        fallen = (
            root * lanes[rows.FALLEN_B + k]
            + fall * (s - lanes[rows.BASE + k])
            + q * lanes[rows.SUM_E + k]
        )
        f0 = root * d * s + u0 + fallen - lanes[rows.GOAL + k]
        f1 = root * d + u1 + fall + q * i0
        f2 = u2 + q * i1 / 2.0
        f3 = u3 + q * i2 / 3.0
        f4 = u4 + q * i3 / 4.0
        f5 = u5 + q * i4 / 5.0
        t = -f0 / (f1 if f1 != 0.0 else 1.0)
        dv = f1
        last = t
        for _ in range(3):
            v = f0 + t * (f1 + t * (f2 + t * (f3 + t * (f4 + t * (f5 + t * u6)))))
            dv = f1 + t * (
                2.0 * f2 + t * (3.0 * f3 + t * (4.0 * f4 + t * (5.0 * f5 + t * 6.0 * u6)))
            )
            dv = dv if dv != 0.0 else 1.0
            last = v / dv
            t = t - last
        t = t if lanes[rows.MOVES + k] > 0.5 else 0.0
        place = s + t
        lo, hi = lanes[rows.S + k], lanes[rows.STOP + k]
        # the end values are single precision: a root beyond them by that is a root at the end, if
        # the slope there is not that of a second one close by
        inside = (place >= lo - 1e-6) & (place <= hi + 1e-6)
        lag_rise = lanes[rows.LAG_P + k] - lanes[rows.LAG_S + k]
        rise = lanes[rows.AWAY_P + k] - lanes[rows.AWAY_S + k]
        rise = lag_rise if turn else rise
        inside &= (dv > 0.0) == (rise > 0.0)
        place = place if place > lo else lo
        place = place if place < hi else hi
        reach = (w0 * (1.0 + abs(t * e)) + abs(d)) * abs(t)
        r2 = reach * reach
        remainder = (abs(u0) + abs(d)) * r2 * r2 * r2 * reach / 5040.0 / abs(dv)
        # close to a turn the steps only halve what is left: the next one tells how much
        left = (remainder + last * last * (abs(f2) + abs(f3)) / abs(dv)) * length
        lanes[rows.ERROR + k] = left if inside & (reach < 0.8) else 1e30
        moves = (lanes[rows.MOVES + k] > 0.5) & (abs(t) < 10.0)
        lanes[rows.PLACE + k] = place if moves else s
        lanes[rows.SUM_E + k] += t * (i0 + t * (i1 / 2.0 + t * (i2 / 3.0 + t * i3 / 4.0)))
        lanes[rows.LIGHT_E + k] = i0 + t * (i1 + t * (i2 + t * (i3 + t * i4)))


# ---- Pieces of an interval over which the light stays on one branch and moves by less than an
# e-fold.
#
# Above the light that the quadrature is chosen for, they are shorter by as much as the corner is
# faster.
#
# The screen knows the signal at the end of an interval that is one piece.  In any other interval
# the end of each piece is a target of its lane, before the piece is solved.


BEFORE_END = 1.0 - 2.0**-53
"""The last place before 1."""

_PIECE = 0.95  # longest piece of a step over LARGEST_STEP [ln units]


@kernel
def set_stop(j, place, lag, light, fallen, lanes):
    """Set the next known place, and the signal there."""
    lanes[rows.STOP + j] = place
    lanes[rows.LAG_P + j] = lag
    lanes[rows.LIGHT_P + j] = light
    lanes[rows.FALLEN_P + j] = fallen
    x = lanes[rows.X0 + j] + lanes[rows.DX + j] * place
    lanes[rows.AWAY_P + j] = x + lag + fallen - lanes[rows.REFERENCE + j]


@kernel
def fallen_at_place(j, lanes):
    """Fall of the reference until the place that was evaluated."""
    since = lanes[rows.FALL + j] * (lanes[rows.PLACE + j] - lanes[rows.BASE + j])
    return lanes[rows.FALLEN_B + j] + since + lanes[rows.FALL_DN + j] * lanes[rows.SUM_E + j]


@kernel
def end_of_piece(base, x0, dx, knee, mixed, brightest):
    """End of the piece that begins at `base`: at the knee, after about an e-fold, or at 1.

    brightest: the larger of the light at its start and at 1 [DN].  Also returns whether the piece
    is on the logarithmic branch, as far as the knee decides that.
    """
    at_knee = (knee - x0) / (dx if dx != 0.0 else 1.0)
    at_knee = at_knee if at_knee > 0.0 else 0.0
    ahead = mixed & (at_knee > base) & (at_knee < 1.0)
    end = at_knee if ahead else 1.0
    step = abs(dx)
    longest = _PIECE / (step if step > _PIECE else 1.0)
    end = base + longest if step * (end - base) > screen.LARGEST_STEP else end
    longest = screen.LARGEST_LIGHT / (
        brightest if brightest > screen.LARGEST_LIGHT else screen.LARGEST_LIGHT
    )
    end = base + longest if end - base > longest else end
    return end, x0 + dx * 0.5 * (base + end) >= knee


@kernel
def first_place(j, interval, lanes):
    """Return the first target of a lane at the start of its piece, and its place."""
    base, end = lanes[rows.BASE + j], lanes[rows.END + j]
    hold = lanes[rows.HOLD + j]
    held = hold >= 0.0
    ta, length = interval.start, interval.length
    release = (hold - ta) / length
    injected = (lanes[rows.NOISE + j] - ta) / length
    seeks = rows.INJECTED if injected < end else rows.READY
    seeks = rows.RELEASE if held else seeks
    seeks = rows.DONE if held & (release >= end) else seeks
    place = release if held else min(injected, end * BEFORE_END)
    return seeks, place if place > base else base


@kernel
def open_piece(j, interval, lanes):
    """Begin a piece at whose end the signal was evaluated."""
    lag = lanes[rows.LAG_E + j]
    lag = lag if abs(lag) > screen.AT_REST else 0.0
    fallen = fallen_at_place(j, lanes)
    lanes[rows.U1 + j] = lag
    lanes[rows.I1 + j] = lanes[rows.LIGHT_E + j]
    lanes[rows.TAIL + j] = fallen
    set_stop(j, lanes[rows.END + j], lag, lanes[rows.LIGHT_E + j], fallen, lanes)
    lanes[rows.KNOWN + j] = 0.0
    seeks, place = first_place(j, interval, lanes)
    lanes[rows.SEEKS + j] = seeks
    lanes[rows.PLACE + j] = place


@kernel
def next_piece(j, circuit, lanes):
    """Move a lane to the next piece; its target is the end of that piece."""
    base, dx, x0 = lanes[rows.END + j], lanes[rows.DX + j], lanes[rows.X0 + j]
    lag, fallen = lanes[rows.U1 + j], lanes[rows.TAIL + j]
    light = lanes[rows.I1 + j]
    x1 = x0 + dx
    mixed = (x0 < circuit.knee) != (x1 < circuit.knee)
    brightest = max(light, special.exp(x1) if x1 >= circuit.knee else 0.0)
    end, on_log = end_of_piece(base, x0, dx, circuit.knee, mixed, brightest)
    lanes[rows.LOG + j] = 1.0 if on_log or circuit.slope == 0.0 else 0.0
    lanes[rows.BASE + j] = base
    lanes[rows.END + j] = end
    lanes[rows.U0 + j] = lag
    lanes[rows.I0 + j] = light
    lanes[rows.FALLEN_B + j] = fallen
    lanes[rows.S + j] = base
    lanes[rows.LAG_S + j] = lag
    lanes[rows.LIGHT_S + j] = light
    lanes[rows.FALLEN_S + j] = fallen
    lanes[rows.AWAY_S + j] = x0 + dx * base + lag + fallen - lanes[rows.REFERENCE + j]
    lanes[rows.KNOWN + j] = 0.0
    lanes[rows.SEEKS + j] = rows.OPEN
    lanes[rows.PLACE + j] = end
    lanes[rows.MOVES + j] = 0.0
