"""The events of pixels that may fire, side by side in lanes, through one piece of an interval.

A lane holds a pixel in one of its substeps, beside photoreceptor noise in one cell of that.  In
each round a lane goes on to where it may fire next; then the signal there, and the first level
that it crosses, are found for all lanes together.  What they cannot tell, because a signal turns
close to a level, a noise event comes, or causes are asked for,
:func:`adv2e.kernel.cascade.substep.fire_until` finds for one of them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import embedded, inlined, kernel
from adv2e.kernel import per_pixel, screen, special
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import screen as cascade
from adv2e.kernel.cascade.plan import FEWEST, GROWTH, LONGEST
from adv2e.kernel.cascade.substep import (
    DONE,
    SETTLED,
    Cubic,
    SignalCurve,
    Substep,
    fire_until,
    guess_root,
    hull,
    lag_curve,
    may_fire,
    plus,
)
from adv2e.kernel.comparator import TIE, fire, with_room
from adv2e.kernel.lanes.rows import WIDTH, whole
from adv2e.kernel.leak import fall_over, leak_rate
from adv2e.kernel.noise import NONE, next_noise
from adv2e.kernel.photoreceptor import path as noise
from adv2e.kernel.photoreceptor.law import MOST_CELLS
from adv2e.kernel.screen import STRIDE, log_of, watch

MOST = 256
"""Most lanes: their rows stay in the cache of a core."""

_A_LANE = 2 * (MOST_CELLS + 1)
"""Numbers of noise of a lane."""

_STRIDE = MOST + WIDTH + 8  # rows must not share cache sets
(
    # what holds over the piece
    _PIXEL,  # number in the strip
    _I0,  # light at its ends
    _I1,
    _X0,  # log intensity at its start, and its change
    _DX,
    _MODE,  # how the lane goes through it: see below
    _SHORTEST,  # of a lane alone: shortest substep at a bend of the light, and longest one;
    _LONGEST,
    _BEND,  # where the light bent last, and where it passes the knee; 1: nowhere
    _KNEE,
    _FROM,  # place before which there is no event
    _ON,  # thresholds without their factors
    _OFF,
    _NOISE,  # where the noise of the lane begins in `cells`, the number of its cells,
    _CELLS,
    _HIGH,  # and its bounds at the comparator
    _LOW,
    # what events change
    _REFERENCE,  # as if leak had always had its present speed
    _FACTOR,  # that speed, relative to the nominal one
    _HOLD,  # end of the dead time [us], -1: not in it
    _BEYOND,  # where the reference goes beyond the signal there
    _DUE,  # when the next noise event comes [us]
    # the present substep, and the part of it that is looked at
    _SUBSTEP,  # its number
    _S0,  # its start, end and length, as shares of the piece
    _S1,
    _SPAN,
    _U0,  # lags at its ends
    _U1,
    _Q0,
    _Q1,
    _FALLEN,  # fall of the reference before it at the nominal speed, and in it
    _FALL,
    _T,  # from here on, up to where one look is taken, and up to its own end: as shares of the
    _END,  # substep
    _UPTO,
    _STAGE,  # what is to be done next: see below
    _CELL,  # number of the cell of noise, its start and length, as shares of the substep,
    _BEGIN,
    _CELL_SPAN,
    _N0,  # and the noise at its ends, behind the first pole and at the comparator
    _NS0,
    _N1,
    _NS1,
    _KEPT,  # number of the rows that are kept from round to round
    # computed in each round
    _C0,  # coefficients of the signal, as in SignalCurve
    _C1,
    _C2,
    _C3,
    _C4,
    _C5,
    _SWING,
    _B,
    _NOISE0,  # of the noise therein
    _NOISE1,
    _NOISE2,
    _NOISE3,
    _LEAK1,  # of the fall
    _LEAK2,
    _LEAK3,
    _ON0,  # thresholds at the start of the substep, and their rise in it
    _ON_RISE,
    _OFF0,
    _OFF_RISE,
    _FOUND,  # the first crossing: 1 ON, -1 OFF, 0 none, or _UNSURE,
    _PLACE,  # and where it is
    _SEARCHED,  # 1: it is to be searched for; then
    _R0,  # distance from the level as SignalCurve, at shares of the way from T to END,
    _R1,
    _R2,
    _R3,
    _R4,
    _R5,
    _R_SWING,
    _R_B,
    _V0,  # and values and slopes of that at both
    _G0,
    _V1,
    _G1,
) = (row * _STRIDE for row in range(78))

_SKIMS, _VISITS, _RESTS, _ALONE = 0.0, 1.0, 2.0, 3.0
"""Modes: a lane takes the substeps of the screen, those in which it may fire or each of them; or
one, as nothing moves or lags; or its own, as lags of the screen do not hold."""

_ENTERS, _LOOKS, _STAYS = 0.0, 1.0, 2.0
"""Stages: to go on to the next substep, to the next cell of this one, or to look again from T."""

_UNSURE = 2.0

_NARROW = 2.0**-10
"""Share of a substep that is not halved any more: the rest of the cell is left to `fire_until`."""

(
    _TAKEN,  # lane that the root is searched for,
    _ROOT,  # where it is, and the last step to it
    _STEP,
    _FIRST_COPY,
) = (row * _STRIDE for row in range(4))
_COPIED = (_R0, _R1, _R2, _R3, _R4, _R5, _R_SWING, _R_B, _V0, _G0, _V1, _G1)
"""Rows of roots that are searched for side by side, and those of their lanes that are copied."""

_SIXTH = 1.0 / 6.0
_THIRD = 1.0 / 3.0
_LARGEST_RATIO = math.tanh(0.5 * cascade.LARGEST_STEP)


def new_lanes() -> NDArray[np.float64]:
    """Return the flat array of rows; lanes that fill up a vector must be harmless."""
    lanes = np.zeros(78 * _STRIDE)
    for row in (_I0, _I1, _SPAN, _CELL_SPAN):
        lanes[row : row + _STRIDE] = 1.0
    return lanes


def new_cells() -> NDArray[np.float32]:
    """Return memory for noise at ends of cells: behind the first pole, and at the comparator."""
    return np.zeros(MOST * _A_LANE, np.float32)


def new_roots() -> NDArray[np.float64]:
    """Return the flat array of rows of roots."""
    return np.ones((4 + len(_COPIED)) * _STRIDE)


# ---- Pixels into lanes and out of them.


@kernel
def load(lo, j, first, count, circuit, state, memory):
    """Put `count` flagged pixels in lanes from the j-th on; returns the number of lanes.

    Beside noise, those that may fire: `found` of the second look has the places from which on.

    first : number of the first one among the flagged pixels
    """
    state, memory = borrowed(state, memory)
    strip, pixels, lanes = memory.strip.rows, memory.strip.pixels, memory.cascade.lanes
    found, path, cells = memory.cascade.look.found, memory.cascade.path, memory.cascade.cells
    is_noisy, seen = circuit.noise_rms > 0.0, noise.seen_from(circuit)
    for c in range(first, first + count):
        k, place = pixels[c], found[c] if is_noisy else 0.0
        if place > 1.0:
            strip[screen.HIT + k] = 0.0
            continue
        i = lo + k
        lanes[_PIXEL + j], lanes[_FROM + j] = k, place
        lanes[_I0 + j] = strip[screen.LIGHT_0 + k]
        lanes[_I1 + j] = strip[screen.LIGHT_1 + k]
        lanes[_U1 + j] = strip[cascade.FIRST + k]
        lanes[_Q1 + j] = strip[cascade.SECOND + k]
        lanes[_BEYOND + j] = state[per_pixel.BEYOND, i]
        lanes[_ON + j] = state[per_pixel.ON, i]
        lanes[_OFF + j] = state[per_pixel.OFF, i]
        _read_state(j, i, circuit, state, lanes)
        lanes[_NOISE + j] = j * _A_LANE
        if is_noisy:
            lanes[_CELLS + j] = noise.copy_cells(c, seen, path, cells[j * _A_LANE :])
            lanes[_HIGH + j] = path.rows[noise.HIGH + c]
            lanes[_LOW + j] = path.rows[noise.LOW + c]
        j += 1
    return j


@embedded
def _read_state(j, i, circuit, state, lanes):
    """Fill the rows of lane j that events change."""
    lanes[_REFERENCE + j] = state[per_pixel.REFERENCE, i]
    lanes[_HOLD + j] = state[per_pixel.HOLD, i]
    lanes[_FACTOR + j] = state[per_pixel.LEAK_FACTOR, i] if circuit.leak_jitter > 0.0 else 1.0
    lanes[_DUE + j] = next_noise(i, circuit, state)[1]


@kernel
def _open(count, piece, circuit, lanes):
    """Fill the rows of the light, and those of how each lane goes through the piece."""
    length, knee_dn = piece.length, circuit.slope * circuit.knee
    dark, per_dn = circuit.dark * length, circuit.per_dn * length
    shared = _VISITS if circuit.photo_leak > 0.0 else _SKIMS
    for j in range(count):
        i0, i1, u, q = lanes[_I0 + j], lanes[_I1 + j], lanes[_U1 + j], lanes[_Q1 + j]
        x0 = log_of(i0, circuit)
        dx = log_of(i1, circuit) - x0
        mixed = (i0 < knee_dn) != (i1 < knee_dn)
        brightest, steep = max(i0, i1), abs(dx) / cascade.LARGEST_STEP
        # a little less than what the screen takes for steep, which rounds otherwise
        alone = (abs(i1 - i0) > 0.99 * _LARGEST_RATIO * (i0 + i1)) | (steep > 0.99)
        alone |= mixed | (brightest > 0.99 * screen.LARGEST_LIGHT)
        rests = (i0 == i1) & (u == 0.0) & (q == 0.0)
        mode = _RESTS if rests else shared
        lanes[_MODE + j] = _ALONE if alone else mode
        lanes[_X0 + j], lanes[_DX + j] = x0, dx
        corner = dark + per_dn * brightest
        knee = (circuit.knee - x0) / (dx if dx != 0.0 else 1.0)
        knee = min(max(knee, 0.0), 1.0)
        lanes[_KNEE + j] = knee if mixed & (dx != 0.0) else 1.0
        lanes[_BEND + j] = -piece.before
        lanes[_SHORTEST + j] = LONGEST / (corner if corner > LONGEST else LONGEST)
        lanes[_LONGEST + j] = 1.0 / (FEWEST * max(steep, 1.0))
        lanes[_SUBSTEP + j] = -1.0
        lanes[_S0 + j], lanes[_S1 + j], lanes[_SPAN + j] = 0.0, 0.0, 0.0
        lanes[_FALLEN + j], lanes[_FALL + j] = 0.0, 0.0
        lanes[_STAGE + j], lanes[_END + j], lanes[_UPTO + j] = _ENTERS, 1.0, 1.0


@inlined
def _close(j, lo, piece, circuit, state, strip, lanes):
    """Write what lane j holds at the end of the piece to state and strip."""
    k, mode, last = int(lanes[_PIXEL + j]), lanes[_MODE + j], piece.substeps * STRIDE
    i = lo + k
    fallen = lanes[_FALLEN + j] + lanes[_FALL + j]
    if mode == _SKIMS:
        fallen = fall_over(lanes[_ON + j], piece.length, 0.0, circuit)
    state[per_pixel.REFERENCE, i] = lanes[_REFERENCE + j] - lanes[_FACTOR + j] * fallen
    state[per_pixel.HOLD, i] = lanes[_HOLD + j]
    state[per_pixel.BEYOND, i] = lanes[_BEYOND + j]
    if mode == _ALONE:
        strip[screen.LAG_1 + k] = lanes[_U1 + j]
        strip[cascade.SECOND + last + k] = lanes[_Q1 + j]
    else:
        strip[screen.LAG_1 + k] = strip[cascade.FIRST + last + k]
    watch(k, i, lanes[_X0 + j] + lanes[_DX + j], piece.origin, circuit, state, strip)


@embedded
def _move(lanes, source, target):
    """Move what lane `source` keeps from round to round to lane `target`."""
    for row in range(0, _KEPT, _STRIDE):
        lanes[row + target] = lanes[row + source]


# ---- Where a lane may fire next (one by one).


@embedded
def _levels(j, s0, s1, piece, lanes):
    """Return the lower of the ON, and of the OFF thresholds at two places of the piece."""
    first, rise = piece.levels[0], piece.levels[1] - piece.levels[0]
    factor = min(first + rise * s0, first + rise * s1)
    return lanes[_ON + j] * factor, lanes[_OFF + j] * factor


@embedded
def _enter(j, s0, s1, piece, lanes):
    """Begin the substep from s0 to s1 of the piece; tells whether anything can happen in it."""
    span = s1 - s0
    lanes[_S0 + j], lanes[_S1 + j], lanes[_SPAN + j] = s0, s1, span
    t = max((lanes[_FROM + j] - s0) / span, 0.0)
    hold = lanes[_HOLD + j]
    if hold >= 0.0:
        t = max(t, ((hold - piece.start) / piece.length - s0) / span)
    lanes[_T + j], lanes[_END + j], lanes[_UPTO + j] = min(t, 1.0), 1.0, 1.0
    lanes[_CELL + j] = -1.0
    return t < 1.0


@embedded
def _first_busy(j, g, piece, room, fall, strip, lanes):
    """Return the first substep from g on in which lane j may fire, else the number of them.

    room : what noise may add to, and take from, the signal; fall : of the reference by leak
    """
    count, places, k, dx = piece.substeps, piece.places, int(lanes[_PIXEL + j]), lanes[_DX + j]
    on, off = _levels(j, 0.0, 1.0, piece, lanes)
    on, off = on - room[0], off + room[1]
    away, due = lanes[_X0 + j] - lanes[_REFERENCE + j], (lanes[_DUE + j] - piece.start)
    due /= piece.length
    u1 = float(strip[cascade.FIRST + g * STRIDE + k])
    q1 = float(strip[cascade.SECOND + g * STRIDE + k])
    while g < count and due >= places[g + 1]:
        u0, q0, span = u1, q1, places[g + 1] - places[g]
        away_g = away + (dx + fall) * places[g]
        u1 = float(strip[cascade.FIRST + (g + 1) * STRIDE + k])
        q1 = float(strip[cascade.SECOND + (g + 1) * STRIDE + k])
        high, low = hull(u0, u1, q0, q1, dx * span)
        if may_fire(away_g + high, away_g + low, 0.0, fall * span, on, off):
            break
        g += 1
    return g


@embedded
def _next_cell(j, piece, circuit, cells, lanes):
    """Move lane j on to the next cell of its substep in which it may fire; False: there is none."""
    s0, span, dx, factor = lanes[_S0 + j], lanes[_SPAN + j], lanes[_DX + j], lanes[_FACTOR + j]
    on, off = _levels(j, s0, s0 + span, piece, lanes)
    high, low = hull(lanes[_U0 + j], lanes[_U1 + j], lanes[_Q0 + j], lanes[_Q1 + j], dx * span)
    away = lanes[_X0 + j] + dx * s0 - lanes[_REFERENCE + j]
    fallen = lanes[_FALLEN + j]
    up = on - (away + high + factor * (fallen + lanes[_FALL + j]))
    down = off + (away + low + factor * fallen)
    count, held = lanes[_CELLS + j], lanes[_HOLD + j] >= 0.0
    due = min((lanes[_DUE + j] - piece.start) / piece.length, 1.0) * count  # in cells
    last, t = min((s0 + span) * count, count), lanes[_T + j]
    if not held and due >= last and lanes[_HIGH + j] < up and -lanes[_LOW + j] < down:
        return False
    r, begun = np.int64((s0 + t * span) * count), np.int64(lanes[_CELL + j]) + 1
    if begun > 0:
        r = max(r if held else 0, begun)
    third = np.float32(circuit.follower * piece.length / count * _THIRD)
    at = np.int64(lanes[_NOISE + j]) + 2 * r
    n1, ns1 = cells[at], cells[at + 1]
    while r < last:
        n0, ns0, n1, ns1 = n1, ns1, cells[at + 2], cells[at + 3]
        top, bottom = noise.bounds_in_cell(n0, ns0, n1, ns1, third)
        if held or due < r + 1 or top >= up or -bottom >= down:
            lanes[_N0 + j], lanes[_N1 + j], lanes[_NS0 + j], lanes[_NS1 + j] = n0, n1, ns0, ns1
            begin, width = (r / count - s0) / span, 1.0 / (count * span)
            lanes[_CELL + j], lanes[_BEGIN + j], lanes[_CELL_SPAN + j] = r, begin, width
            lanes[_T + j] = max(t, begin)
            lanes[_UPTO + j] = min(((r + 1) / count - s0) / span, 1.0)
            lanes[_END + j] = lanes[_UPTO + j]
            return True
        r, at = r + 1, at + 2
    return False


@inlined
def _skim(j, piece, circuit, cells, strip, lanes):
    """Move lane j to the next of the screen's substeps in which it may fire; False: there is none.

    Beside noise, to the next cell.
    """
    places, k = piece.places, int(lanes[_PIXEL + j])
    is_noisy, room = circuit.noise_rms > 0.0, (0.0, 0.0)
    fall = fall_over(lanes[_ON + j], piece.length, 0.0, circuit)
    if is_noisy:
        room = lanes[_HIGH + j], lanes[_LOW + j]
    g = np.int64(lanes[_SUBSTEP + j]) + 1
    while g < piece.substeps:
        if places[g + 1] <= lanes[_FROM + j]:
            g += 1
            continue
        if lanes[_HOLD + j] < 0.0:
            g = _first_busy(j, g, piece, room, lanes[_FACTOR + j] * fall, strip, lanes)
            if g >= piece.substeps:
                break
        if _enter(j, places[g], places[g + 1], piece, lanes):
            lanes[_SUBSTEP + j] = g
            lanes[_U0 + j] = strip[cascade.FIRST + g * STRIDE + k]
            lanes[_Q0 + j] = strip[cascade.SECOND + g * STRIDE + k]
            lanes[_U1 + j] = strip[cascade.FIRST + (g + 1) * STRIDE + k]
            lanes[_Q1 + j] = strip[cascade.SECOND + (g + 1) * STRIDE + k]
            lanes[_FALLEN + j] = fall * places[g]
            lanes[_FALL + j] = fall * (places[g + 1] - places[g])
            if not is_noisy or _next_cell(j, piece, circuit, cells, lanes):
                return True
        g += 1
    return False


@inlined
def _visit(j, piece, circuit, strip, lanes):
    """Move lane j to its next substep; False: there is none.

    Beside noise nothing is looked at before the lags at its end are computed.
    """
    k, g, mode = int(lanes[_PIXEL + j]), np.int64(lanes[_SUBSTEP + j]) + 1, lanes[_MODE + j]
    s0 = lanes[_S1 + j]
    if mode == _ALONE:
        if s0 >= 1.0:
            return False
        s1 = _next_place(j, s0, lanes)
    else:
        if g >= piece.substeps:
            return False
        g = piece.substeps - 1 if mode == _RESTS else g
        s0, s1 = 0.0 if mode == _RESTS else piece.places[g], piece.places[g + 1]
    lanes[_SUBSTEP + j] = g
    lanes[_FALLEN + j] += lanes[_FALL + j]
    lanes[_U0 + j], lanes[_Q0 + j] = lanes[_U1 + j], lanes[_Q1 + j]
    if mode != _ALONE:
        lanes[_U1 + j] = strip[cascade.FIRST + (g + 1) * STRIDE + k]
        lanes[_Q1 + j] = strip[cascade.SECOND + (g + 1) * STRIDE + k]
    _enter(j, s0, s1, piece, lanes)
    if circuit.noise_rms > 0.0:
        lanes[_END + j] = lanes[_UPTO + j] = lanes[_T + j]
    return True


@embedded
def _next_place(j, s, lanes):
    """End of the substep that begins at s, of a lane with substeps of its own."""
    knee = lanes[_KNEE + j]
    bend, end = (lanes[_BEND + j], knee) if s < knee else (knee, 1.0)
    after = s + min(max(lanes[_SHORTEST + j], GROWTH * (s - bend)), lanes[_LONGEST + j])
    # no short one at the end
    return after if end - after > 0.1 * (after - s) else end


@inlined
def _go_on(j, piece, circuit, cells, strip, lanes):
    """Move lane j to where it may fire next; False: nowhere, it is at the end of the piece."""
    stage, mode = lanes[_STAGE + j], lanes[_MODE + j]
    lanes[_STAGE + j] = _LOOKS if circuit.noise_rms > 0.0 else _ENTERS
    if stage == _STAYS:
        return True
    if lanes[_END + j] < lanes[_UPTO + j]:  # nothing more so far
        lanes[_T + j] = max(lanes[_T + j], lanes[_END + j])
        lanes[_END + j] = lanes[_UPTO + j]
        if lanes[_T + j] < lanes[_UPTO + j]:
            return True
    if stage == _LOOKS and lanes[_T + j] < 1.0 and _next_cell(j, piece, circuit, cells, lanes):
        return True
    if mode == _SKIMS:
        return _skim(j, piece, circuit, cells, strip, lanes)
    return _visit(j, piece, circuit, strip, lanes)


# ---- The signal of all lanes in their substeps.


@embedded
def _after(u0, d, a, c):
    """Lag of the first pole after a substep; see :mod:`adv2e.kernel.cascade`."""
    decay = special.exp(-a)
    shape = 1.0 - a * (1 / 2 - a * (1 / 6 - a * (1 / 24 - a * (1 / 120 - a / 720))))
    turn = 1 / 6 - a * (1 / 12 - a * (1 / 40 - a * (1 / 180 - a / 1008)))
    is_short = a < 0.05
    long = 1.0 if is_short else a
    shape = shape if is_short else (1.0 - decay) / long
    turn = turn if is_short else (a - 2.0 + (a + 2.0) * decay) / (long * long * long)
    u1 = decay * u0 - d * (shape - 0.5 * c * turn)
    return u1 if abs(u1) > screen.AT_REST else 0.0


@kernel
def _find_signals(count, piece, circuit, lanes):
    """Fill the rows of signal, thresholds and leak, and for lanes alone those of the lags."""
    length = piece.length
    knee, slope, is_linear = circuit.knee, circuit.slope, circuit.follower == 0.0
    first, rise = piece.levels[0], piece.levels[1] - piece.levels[0]
    for j in range(count):
        s0, span, dx = lanes[_S0 + j], lanes[_SPAN + j], lanes[_DX + j]
        u0, u1, q0, q1 = lanes[_U0 + j], lanes[_U1 + j], lanes[_Q0 + j], lanes[_Q1 + j]
        on_level, off_level = lanes[_ON + j], lanes[_OFF + j]
        alone = lanes[_MODE + j] == _ALONE
        h, d, x = span * length, span * dx, lanes[_X0 + j] + s0 * dx
        on_log = x + 0.5 * d >= knee
        grows = special.exp(0.5 * d)
        light0 = special.exp(x)
        middle, light1 = light0 * grows, light0 * grows * grows
        light0 = light0 if on_log else slope * x
        middle = middle if on_log else slope * (x + 0.5 * d)
        light1 = light1 if on_log else slope * (x + d)
        mean = (light0 + 4.0 * middle + light1) * _SIXTH
        dark, per_dn = circuit.dark * h, circuit.per_dn * h
        own = _after(u0, d, dark + per_dn * mean, per_dn * (light1 - light0))
        u1 = own if alone else u1
        w0, w1 = dark + per_dn * light0, dark + per_dn * light1
        slope0, slope1 = -(w0 * u0 + d), -(w1 * u1 + d)
        # how the corner changes: with the light, which grows by itself or in a line
        g0, g1 = light0 * d, light1 * d
        g0 = per_dn * (g0 if on_log else slope * d)
        g1 = per_dn * (g1 if on_log else slope * d)
        bend0, bend1 = -(g0 * u0 + w0 * slope0), -(g1 * u1 + w1 * slope1)
        b = circuit.follower * h
        lag = lag_curve(u0, slope0, bend0, u1, slope1, bend1, q0, d, b)
        own = lag.c0 + lag.c1 + lag.c2 + lag.c3 + lag.c4 + lag.c5
        own += lag.swing * special.exp(-lag.b)
        own = own if abs(own) > screen.AT_REST else 0.0
        lanes[_U1 + j], lanes[_Q1 + j] = u1, own if alone else q1
        fall = fall_over(on_level, h, mean, circuit)
        l0 = on_level * leak_rate(light0, circuit) * h
        l1 = on_level * leak_rate(light1, circuit) * h
        lanes[_FALL + j], lanes[_LEAK1 + j] = fall, l0
        lanes[_LEAK2 + j], lanes[_LEAK3 + j] = 3.0 * fall - 2.0 * l0 - l1, l0 + l1 - 2.0 * fall
        factor0, factor1 = first + rise * s0, rise * span
        lanes[_ON0 + j], lanes[_ON_RISE + j] = on_level * factor0, on_level * factor1
        lanes[_OFF0 + j], lanes[_OFF_RISE + j] = off_level * factor0, off_level * factor1
        lanes[_C0 + j], lanes[_C1 + j], lanes[_C2 + j] = lag.c0 + x, lag.c1 + d, lag.c2
        lanes[_C3 + j], lanes[_C4 + j], lanes[_C5 + j] = lag.c3, lag.c4, lag.c5
        lanes[_SWING + j], lanes[_B + j] = lag.swing, lag.b
    if circuit.noise_rms > 0.0:
        for j in range(count):
            width = lanes[_CELL_SPAN + j]
            corner = circuit.follower * length * lanes[_SPAN + j] * width
            c0, c1, c2, c3 = noise.cubic_of(
                lanes[_N0 + j], lanes[_NS0 + j], lanes[_N1 + j], lanes[_NS1 + j],
                lanes[_BEGIN + j], width, corner, is_linear,
            )  # fmt: skip
            lanes[_NOISE0 + j], lanes[_NOISE1 + j] = c0, c1
            lanes[_NOISE2 + j], lanes[_NOISE3 + j] = c2, c3
            lanes[_C0 + j] += c0
            lanes[_C1 + j] += c1
            lanes[_C2 + j] += c2
            lanes[_C3 + j] += c3


# ---- The first crossing of all lanes.
#
# Where one look is enough: either bounds exclude a crossing, or there is one, and the signal is
# monotone. Else the lane looks at half of what is left; at last `substep.fire_until` does.


@embedded
def _at(c0, c1, c2, c3, c4, c5, swing, b, t):
    """Return value and slope of a polynomial with an exponential term at t."""
    left = swing * special.exp(-b * t)
    t2 = t * t
    p = (c0 + t * c1) + t2 * ((c2 + t * c3) + t2 * (c4 + t * c5))
    slope = (c1 + t * (2.0 * c2)) + t2 * ((3.0 * c3 + t * (4.0 * c4)) + t2 * (5.0 * c5))
    return p + left, slope - b * left


@kernel
def _cross(count, piece, circuit, lanes):
    """End dead times, and fill the rows of the first crossing of each lane from T to END."""
    length, start = piece.length, piece.start
    for j in range(count):
        c0, c1, c2 = lanes[_C0 + j], lanes[_C1 + j], lanes[_C2 + j]
        c3, c4, c5 = lanes[_C3 + j], lanes[_C4 + j], lanes[_C5 + j]
        swing, b, t, end = lanes[_SWING + j], lanes[_B + j], lanes[_T + j], lanes[_END + j]
        l1, l2, l3, factor = (
            lanes[_LEAK1 + j], lanes[_LEAK2 + j], lanes[_LEAK3 + j], lanes[_FACTOR + j],
        )  # fmt: skip
        on0, on_rise = lanes[_ON0 + j], lanes[_ON_RISE + j]
        off0, off_rise = lanes[_OFF0 + j], lanes[_OFF_RISE + j]
        fallen, hold, reference = lanes[_FALLEN + j], lanes[_HOLD + j], lanes[_REFERENCE + j]
        beyond, h, s0 = lanes[_BEYOND + j], lanes[_SPAN + j] * length, lanes[_S0 + j]
        width = end - t
        is_open = width > 0.0
        # distance from the reference, but for the reference
        c0, c1 = c0 + factor * fallen, c1 + factor * l1
        c2, c3 = c2 + factor * l2, c3 + factor * l3
        # the same, at shares of the way from T to END
        left, b = swing * special.exp(-b * t), b * width
        p0 = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
        p1 = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
        p2 = c2 + t * (3.0 * c3 + t * (6.0 * c4 + t * 10.0 * c5))
        p3, p4 = c3 + t * (4.0 * c4 + t * 10.0 * c5), c4 + t * 5.0 * c5
        w2 = width * width
        p1, p2, p3 = p1 * width, p2 * w2, p3 * w2 * width
        p4, p5 = p4 * w2 * w2, c5 * w2 * w2 * width
        v_t, g_t = p0 + left, p1 - b * left
        gone = left * special.exp(-b)
        v_e = p0 + p1 + p2 + p3 + p4 + p5 + gone
        g_e = p1 + 2.0 * p2 + 3.0 * p3 + 4.0 * p4 + 5.0 * p5 - b * gone
        released = is_open & (hold >= 0.0) & (not circuit.causes)
        reference = v_t + beyond if released else reference
        lanes[_REFERENCE + j] = reference
        lanes[_HOLD + j] = -1.0 if released else hold
        v_t, v_e = v_t - reference, v_e - reference
        # bounds: those of the Bezier points of the cubic, and what the rest may add
        bend = max(abs(2.0 * p2), abs(2.0 * p2 + 6.0 * p3)) + 12.0 * abs(p4) + 20.0 * abs(p5)
        bend += b * b * abs(left)
        third, middle, ends = p1 * _THIRD, p1 + p2, p1 + 2.0 * p2 + 3.0 * p3
        rest = 4.0 * abs(p4) + 5.0 * abs(p5)
        lowest = min(p1, middle, ends) - rest - b * max(left, gone)
        highest = max(p1, middle, ends) + rest - b * min(left, gone)
        is_monotone = (lowest > 0.0) | (highest < 0.0)
        room = 0.0 if is_monotone else bend * 0.125
        p0 -= reference
        before, after, last = p0 + third, p0 + 2.0 * third + p2 * _THIRD, p0 + p1 + p2 + p3
        rest = abs(p4) + abs(p5)
        top = max(p0, before, after, last) + rest + max(left, gone)
        bottom = min(p0, before, after, last) - rest + min(left, gone)
        top, bottom = min(top, max(v_t, v_e) + room), max(bottom, min(v_t, v_e) - room)
        up = top >= min(on0, on0 + on_rise)
        down = -bottom >= min(off0, off0 + off_rise)
        sign = 1.0 if up else -1.0
        level0, rise = on0 if up else off0, on_rise if up else off_rise
        level0 += TIE
        level0, rise = level0 + rise * t, rise * width
        v0, v1 = sign * v_t - level0, sign * v_e - level0 - rise
        g0, g1 = sign * g_t - rise, sign * g_e - rise
        at_once = v0 >= 0.0
        both = up & down
        room = bend * 0.125 if rise != 0.0 else room  # the level moves, too
        none = (not (up | down)) | ((not both) & (max(v0, v1) + room < 0.0))
        slowest = sign * (lowest if up else highest) - rise
        rises = (slowest > 0.0) | ((min(g0, g1) > 0.0) & (max(g0, g1) > bend))
        once = (v1 >= 0.0) & rises
        is_due = start + s0 * length + lanes[_UPTO + j] * h > lanes[_DUE + j]
        alone = is_due | circuit.causes
        sure = none | ((not both) & (at_once | once))
        halves = is_open & (not (alone | sure)) & (width > _NARROW)
        found = 0.0 if none | halves else sign
        found = _UNSURE if alone | (not (sure | halves)) else found
        lanes[_FOUND + j] = found if is_open else 0.0
        lanes[_PLACE + j] = t
        lanes[_END + j] = t + 0.5 * width if halves else end
        lanes[_STAGE + j] = _STAYS if halves else lanes[_STAGE + j]
        searched = is_open & once & (not (alone | none | at_once | both))
        lanes[_SEARCHED + j] = 1.0 if searched else 0.0
        lanes[_R0 + j], lanes[_R1 + j] = sign * p0 - level0, sign * p1 - rise
        lanes[_R2 + j], lanes[_R3 + j] = sign * p2, sign * p3
        lanes[_R4 + j], lanes[_R5 + j], lanes[_R_SWING + j] = sign * p4, sign * p5, sign * left
        lanes[_R_B + j] = b
        lanes[_V0 + j], lanes[_G0 + j], lanes[_V1 + j], lanes[_G1 + j] = v0, g0, v1, g1


@kernel
def _search(m, lanes, roots):
    """Find the places of those crossings that are to be searched for."""
    count = 0
    for j in range(m):
        if lanes[_SEARCHED + j] > 0.0:
            roots[_TAKEN + count] = j
            for row in range(len(_COPIED)):
                roots[_FIRST_COPY + row * _STRIDE + count] = lanes[_COPIED[row] + j]
            count += 1
    _find_roots(whole(count), roots, roots[_FIRST_COPY:])
    for k in range(count):
        j = int(roots[_TAKEN + k])
        t = lanes[_T + j]
        lanes[_PLACE + j] = t + (lanes[_END + j] - t) * roots[_ROOT + k]
        if abs(roots[_STEP + k]) >= SETTLED:
            lanes[_FOUND + j] = _UNSURE


@kernel
def _find_roots(count, roots, copies):
    """Fill rows _ROOT and _STEP: Newton's method, from the root of a cubic on."""
    for k in range(count):
        c0, c1, c2, c3, c4, c5 = (
            copies[k], copies[_STRIDE + k], copies[2 * _STRIDE + k], copies[3 * _STRIDE + k],
            copies[4 * _STRIDE + k], copies[5 * _STRIDE + k],
        )  # fmt: skip
        swing, b, v0 = copies[6 * _STRIDE + k], copies[7 * _STRIDE + k], copies[8 * _STRIDE + k]
        g0, v1, g1 = copies[9 * _STRIDE + k], copies[10 * _STRIDE + k], copies[11 * _STRIDE + k]
        place = min(max(guess_root(v0, g0, v1, g1, 1.0), 0.0), 1.0)
        step = 0.0
        for _ in range(3):
            v, g = _at(c0, c1, c2, c3, c4, c5, swing, b, place)
            after = place - v / (g if g > 0.0 else 1.0)
            after = min(max(after, 0.0), 1.0)
            step = after - place
            place = after
        roots[_ROOT + k], roots[_STEP + k] = place, step


# ---- What was found is applied (one by one).


@kernel
def _decide_alone(j, i, piece, circuit, state, lanes, buffer, n):
    """Fire the events of a lane from T to END that lanes cannot tell; returns their number."""
    s0, span = lanes[_S0 + j], lanes[_SPAN + j]
    state[per_pixel.REFERENCE, i] = lanes[_REFERENCE + j]
    state[per_pixel.HOLD, i] = lanes[_HOLD + j]
    on0, off0 = lanes[_ON0 + j], lanes[_OFF0 + j]
    step = Substep(
        s0, span, piece.start + s0 * piece.length, span * piece.length,
        lanes[_X0 + j] + s0 * lanes[_DX + j], span * lanes[_DX + j], on0, on0 + lanes[_ON_RISE + j],
        off0, off0 + lanes[_OFF_RISE + j], lanes[_FALLEN + j], lanes[_LEAK1 + j],
        lanes[_LEAK2 + j], lanes[_LEAK3 + j],
    )  # fmt: skip
    signal = SignalCurve(
        lanes[_C0 + j], lanes[_C1 + j], lanes[_C2 + j], lanes[_C3 + j], lanes[_C4 + j],
        lanes[_C5 + j], lanes[_SWING + j], lanes[_B + j],
    )  # fmt: skip
    by_noise = Cubic(0.0, 0.0, 0.0, 0.0)
    if circuit.noise_rms > 0.0:
        by_noise = Cubic(
            lanes[_NOISE0 + j], lanes[_NOISE1 + j], lanes[_NOISE2 + j], lanes[_NOISE3 + j]
        )
        signal = plus(signal, -by_noise.c0, -by_noise.c1, -by_noise.c2, -by_noise.c3)
    n, place = fire_until(
        i, lanes[_T + j], lanes[_UPTO + j], step, signal, by_noise, circuit, state, buffer, n
    )
    _read_state(j, i, circuit, state, lanes)
    lanes[_BEYOND + j] = state[per_pixel.BEYOND, i]
    if place == DONE:
        t = (lanes[_HOLD + j] - step.t0) / step.h
        lanes[_END + j] = lanes[_UPTO + j]
        lanes[_T + j] = min(max(t, lanes[_END + j]), 1.0)
    else:  # there was no room for more
        lanes[_T + j], lanes[_STAGE + j] = place, _STAYS
    return n


@inlined
def _fire_found(j, i, piece, circuit, state, lanes, buffer, n):
    """Fire the event that was found in lane j, and reset its reference."""
    t, polarity, h = lanes[_PLACE + j], lanes[_FOUND + j], lanes[_SPAN + j] * piece.length
    t0 = piece.start + lanes[_S0 + j] * piece.length
    when = t0 + t * h
    n = fire(i, when, polarity, NONE, circuit, state, buffer, n)
    before = lanes[_FACTOR + j]
    if circuit.leak_jitter > 0.0:
        lanes[_FACTOR + j] = state[per_pixel.LEAK_FACTOR, i]
    lanes[_STAGE + j] = _STAYS
    if circuit.dead_time > 0.0:
        level = lanes[_ON + j] if polarity > 0 else -lanes[_OFF + j]
        lanes[_HOLD + j] = when + circuit.dead_time
        lanes[_BEYOND + j] = circuit.overshoot * level
        t = (when + circuit.dead_time - t0) / h
        if t >= lanes[_END + j]:
            lanes[_STAGE + j] = _LOOKS if circuit.noise_rms > 0.0 else _ENTERS
        lanes[_T + j] = min(t, 1.0)
        return n
    level0, rise = lanes[_ON0 + j], lanes[_ON_RISE + j]
    if polarity < 0.0:
        level0, rise = -lanes[_OFF0 + j], -lanes[_OFF_RISE + j]
    lanes[_REFERENCE + j] += (level0 + rise * t) * (1.0 + circuit.overshoot)
    fallen = lanes[_LEAK1 + j] + t * (lanes[_LEAK2 + j] + t * lanes[_LEAK3 + j])
    lanes[_REFERENCE + j] += (lanes[_FACTOR + j] - before) * (lanes[_FALLEN + j] + t * fallen)
    lanes[_T + j] = t
    return n


@kernel
def _go_on_all(lo, m, piece, circuit, state, memory):
    """Move all lanes to where they may fire next; returns how many there are still."""
    piece, state, memory = borrowed(piece, state, memory)
    strip, cells, lanes = memory.strip.rows, memory.cascade.cells, memory.cascade.lanes
    j = 0
    while j < m:
        if _go_on(j, piece, circuit, cells, strip, lanes):
            j += 1
        else:
            _close(j, lo, piece, circuit, state, strip, lanes)
            m -= 1
            _move(lanes, m, j)
    return m


@kernel
def _fire_all(lo, m, piece, circuit, state, lanes, buffer, n):
    """Apply what was found in each lane; returns the number of events."""
    piece, state, lanes, buffer = borrowed(piece, state, lanes, buffer)
    for j in range(m):
        found, i = lanes[_FOUND + j], lo + int(lanes[_PIXEL + j])
        if found == 0.0:
            continue
        if n >= buffer.keys.shape[0]:
            lanes[_STAGE + j] = _STAYS
        elif found == _UNSURE:
            n = _decide_alone(j, i, piece, circuit, state, lanes, buffer, n)
        else:
            n = _fire_found(j, i, piece, circuit, state, lanes, buffer, n)
    return n


@kernel
def solve(lo, m, piece, circuit, state, memory, buffer, n):
    """Fire the events of the pixels in m lanes over a piece.

    Returns the number of events, and their buffer.
    """
    lanes = memory.cascade.lanes
    _open(whole(m), piece, circuit, lanes)
    while True:
        m = _go_on_all(lo, m, piece, circuit, state, memory)
        if m == 0:
            return n, buffer
        buffer = with_room(buffer, n, n + m)
        count = whole(m)
        _find_signals(count, piece, circuit, lanes)
        _cross(count, piece, circuit, lanes)
        _search(m, lanes, memory.cascade.roots)
        n = _fire_all(lo, m, piece, circuit, state, lanes, buffer, n)
