"""The usual crossings of a strip, gathered as items and solved together.

Where the signal is monotone over the interval (u = y - x keeps its sign and outruns the leak), the
light stays on one branch of the log map and neither dead time nor noise interferes at the start,
each threshold between the ends is crossed exactly once: these become items (see
:mod:`adv2e.kernel.items`).  Pixels with an item that does not come out, and all that do not fit the
description, are left to :mod:`adv2e.kernel.solve`.

With a dead time, the signal at its end is evaluated likewise, and the pixel goes on from there as a
new item.
"""

from __future__ import annotations

from adv2e.jit import kernel
from adv2e.kernel.items import (
    CAPACITY,
    DX,
    ERROR,
    F_HI,
    F_LO,
    FALL,
    FALL_DN,
    G_HI,
    G_LO,
    GOAL,
    I0,
    LAG_1,
    LAG_S,
    LEVEL,
    LIGHT_1,
    LIGHT_S,
    LO,
    LOG,
    PIXEL,
    SUM_S,
    TAIL,
    TOLERANCE,
    U0,
    S,
    evaluate,
    settle,
)
from adv2e.kernel.polynomial import TIE
from adv2e.kernel.screen import LARGEST_LIGHT, LARGEST_STEP
from adv2e.kernel.workspace import (
    S_HOLD,
    S_HOT_TIME,
    S_LAG,
    S_LIGHT,
    S_OFF,
    S_ON,
    S_REFERENCE,
    S_SHOT_TIME,
    S_X,
)

_MANY = 64
"""Crossings of one pixel in one interval beyond which it is solved by itself."""


@kernel
def _suits(i, x0, x1, lag, lag_end, i0, i1, length, t_end, circuit, state):
    """Tell whether pixel i fits the description at the top of this module."""
    dx = x1 - x0
    if abs(dx) > LARGEST_STEP or i1 > LARGEST_LIGHT or (x0 < circuit.knee) != (x1 < circuit.knee):
        return False
    if lag * lag_end < 0.0 or state[S_HOLD, i] >= 0.0:
        return False
    if circuit.shot_rate > 0.0 and state[S_SHOT_TIME, i] < t_end:
        return False
    if circuit.hot_rate > 0.0 and state[S_HOT_TIME, i] < t_end:
        return False
    if circuit.leak > 0.0 or circuit.photo_leak > 0.0:
        if circuit.leak_jitter > 0.0:
            return False
        if x1 + lag_end <= x0 + lag:
            # a falling signal must outrun the leak everywhere.  While u keeps its sign, |u| falls
            # no lower than at the ends or, where x runs away from y, than |dx/dt| / w
            slow = min(circuit.dark + circuit.per_dn * i0, circuit.dark + circuit.per_dn * i1)
            fast = max(circuit.dark + circuit.per_dn * i0, circuit.dark + circuit.per_dn * i1)
            least = min(abs(lag), abs(lag_end))
            if dx < 0.0:
                least = min(least, -dx / (fast * length + 1e-300))
            leak = state[S_ON, i] * (circuit.leak + circuit.photo_leak * max(i0, i1))
            if slow * least <= 1.01 * leak:
                return False
    return True


@kernel
def _put(items, m, k, lo, f_lo, g_lo, goal, level):
    """Write what differs from item to item of pixel k as item m."""
    items[LO, m] = lo
    items[F_LO, m] = f_lo
    items[G_LO, m] = g_lo
    items[GOAL, m] = goal
    items[LEVEL, m] = level
    items[PIXEL, m] = k


@kernel
def _copy_pixel(items, source, m):
    """Give item m what item `source` knows of their common pixel."""
    for row in (U0, I0, DX, LOG, FALL, FALL_DN, G_HI, TAIL, LAG_1, LIGHT_1):
        items[row, m] = items[row, source]


@kernel
def _slope(items, m, lag, light, length, circuit):
    """Slope of item m's distance where lag and light are these, per interval."""
    rate = (circuit.dark + circuit.per_dn * light) * length
    return -rate * lag + items[FALL, m] + items[FALL_DN, m] * light


@kernel
def _crossings(distance, on, off):
    """How many thresholds a monotone signal passes on its way to `distance`; signed."""
    if distance >= on + TIE:
        count = int((distance - TIE) / on)
        while count > 0 and count * on + TIE > distance:
            count -= 1
        return count
    if distance <= -off - TIE:
        count = int((-distance - TIE) / off)
        while count > 0 and count * off + TIE > -distance:
            count -= 1
        return -count
    return 0


@kernel
def gather(
    start, lo, count, i1, x1, lag_end, fall, ta, length, circuit, state, flags, items
):  # fmt: skip
    """Fill items with the crossings of flagged pixels from `start` on, until there is no room.

    Returns (items, the pixel to go on from).  Pixels that turn out to cross nothing are finished.
    """
    m = 0
    for k in range(start, count):
        if not flags[k]:
            continue
        if m + _MANY > CAPACITY:
            return m, k
        i = lo + k
        x0, i0, lag = state[S_X, i], state[S_LIGHT, i], state[S_LAG, i]
        if not _suits(
            i, x0, x1[k], lag, lag_end[k], i0, i1[k], length, ta + length, circuit, state
        ):
            continue
        reference = state[S_REFERENCE, i]
        distance = x1[k] + lag_end[k] + fall[k] - reference
        crossings = _crossings(distance, state[S_ON, i], state[S_OFF, i])
        if crossings == 0:
            state[S_LAG, i] = lag_end[k]
            state[S_REFERENCE, i] = reference - fall[k]
            flags[k] = False
            continue
        if abs(crossings) > _MANY:
            continue
        level = state[S_ON, i] if crossings > 0 else -state[S_OFF, i]
        sign = 1.0 if crossings > 0 else -1.0
        items[U0, m], items[I0, m], items[DX, m] = lag, i0, x1[k] - x0
        items[LOG, m] = 1.0 if min(x0, x1[k]) >= circuit.knee else 0.0
        items[FALL, m] = state[S_ON, i] * length * circuit.leak
        items[FALL_DN, m] = state[S_ON, i] * length * circuit.photo_leak
        items[TAIL, m], items[LAG_1, m], items[LIGHT_1, m] = fall[k], lag_end[k], i1[k]
        items[G_HI, m] = _slope(items, m, lag_end[k], i1[k], length, circuit)
        g_lo = _slope(items, m, lag, i0, length, circuit)
        rounds = 1 if circuit.dead_time > 0.0 else abs(crossings)
        for j in range(rounds):
            goal = reference - x0 + (j + 1) * level + sign * TIE
            if j > 0:
                _copy_pixel(items, m - j, m)
            _put(items, m, k, 0.0, lag - goal, g_lo, goal, level)
            items[F_HI, m] = items[DX, m] + lag_end[k] + fall[k] - goal
            m += 1
    return m, count


@kernel
def _is_good(items, m, keep):
    """Fill keep[pixel]: whether all items of that pixel came out."""
    for j in range(m):
        keep[int(items[PIXEL, j])] = True
    for j in range(m):
        if not items[ERROR, j] <= TOLERANCE:
            keep[int(items[PIXEL, j])] = False


@kernel
def solve_items(
    lo, m, ta, length, circuit, nodes, weights, state, flags, items, keep, found_time, found_pixel,
):  # fmt: skip
    """Solve m gathered items; update the state of the pixels that came out, and clear their flags.

    Returns the number of events found: times [us], and pixel and polarity as 2 k + p.  Pixels that
    did not come out keep their flag and their state.
    """
    if circuit.dead_time > 0.0:
        return _solve_with_dead_time(
            lo, m, ta, length, circuit, nodes, weights, state, flags, items, keep, found_time,
            found_pixel,
        )  # fmt: skip
    settle(items, m, length, circuit, nodes, weights)
    _is_good(items, m, keep)
    n = 0
    for j in range(m):
        k = int(items[PIXEL, j])
        if not keep[k]:
            continue
        found_time[n] = ta + items[S, j] * length
        found_pixel[n] = 2 * k + (1 if items[LEVEL, j] > 0.0 else 0)
        n += 1
        if flags[k]:
            state[S_LAG, lo + k] = items[LAG_1, j]
            state[S_REFERENCE, lo + k] -= items[TAIL, j]
            flags[k] = False
        state[S_REFERENCE, lo + k] += items[LEVEL, j]
    return n


@kernel
def _solve_with_dead_time(
    lo, m, ta, length, circuit, nodes, weights, state, flags, items, keep, found_time, found_pixel,
):  # fmt: skip
    """As solve_items: one crossing, dead time, and on from its end, round after round."""
    for j in range(m):
        keep[int(items[PIXEL, j])] = True
    n = 0
    dead = circuit.dead_time / length
    while m > 0:
        settle(items, m, length, circuit, nodes, weights)
        for j in range(m):
            k = int(items[PIXEL, j])
            if not items[ERROR, j] <= TOLERANCE or n >= found_time.shape[0]:
                keep[k] = False
            else:
                found_time[n] = ta + items[S, j] * length
                found_pixel[n] = 2 * k + (1 if items[LEVEL, j] > 0.0 else 0)
                n += 1
            items[LO, j] = items[S, j] + dead
            items[S, j] = min(items[LO, j], 1.0)
        evaluate(items, m, length, circuit, nodes, weights)
        left = 0
        for j in range(m):
            k = int(items[PIXEL, j])
            i = lo + k
            if not keep[k]:
                continue
            end = items[LO, j]
            if end >= 1.0:
                state[S_HOLD, i] = ta + end * length
                state[S_LAG, i] = items[LAG_1, j]
                flags[k] = False
                continue
            # the reference is taken again here; both counted from x at the start of the interval
            fallen = items[FALL, j] * end + items[FALL_DN, j] * items[SUM_S, j]
            here = items[DX, j] * end + items[LAG_S, j] + fallen
            final = items[DX, j] + items[LAG_1, j] + items[TAIL, j]
            crossings = _crossings(final - here, state[S_ON, i], state[S_OFF, i])
            if crossings == 0:
                state[S_REFERENCE, i] = state[S_X, i] + here - items[TAIL, j]
                state[S_LAG, i] = items[LAG_1, j]
                flags[k] = False
                continue
            sign = 1.0 if crossings > 0 else -1.0
            level = state[S_ON, i] if crossings > 0 else -state[S_OFF, i]
            goal = here + level + sign * TIE
            slope = _slope(items, j, items[LAG_S, j], items[LIGHT_S, j], length, circuit)
            if left != j:
                _copy_pixel(items, j, left)
            _put(items, left, k, end, here - goal, slope, goal, level)
            items[F_HI, left] = final - goal
            left += 1
        m = left
    # events of pixels that failed on the way do not count: they are solved again from the start
    kept = 0
    for j in range(n):
        if keep[found_pixel[j] // 2]:
            found_time[kept] = found_time[j]
            found_pixel[kept] = found_pixel[j]
            kept += 1
    return kept
