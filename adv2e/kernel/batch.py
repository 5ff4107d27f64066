r"""The usual crossing, many at a time: one event an item, solved for all items together.

Where the signal is monotone over the interval (u = y - x keeps its sign and outruns the leak), the
light stays on one branch of the log map and neither dead time nor noise interferes at the start,
each threshold between the ends is crossed exactly once.  An item holds one such crossing:

1. a guess: the root of the cubic through values and slopes at both ends;
2. one evaluation of the closed form there (the quadrature of :mod:`adv2e.kernel.screen`);
3. the root of the signal's Taylor polynomial of order 6 about that place.

The polynomial's remainder says how far off the root can be; items over the tolerance go round
again from the better place.  After the last round pixels with an item that is still not good
enough, as all pixels that do not fit the description, are left to :mod:`adv2e.kernel.solve`.

With a dead time, the signal at its end is evaluated likewise, and the pixel goes on from there as a
new item.
"""

from __future__ import annotations

from adv2e.jit import kernel
from adv2e.kernel import special
from adv2e.kernel.polynomial import TIE
from adv2e.kernel.screen import LARGEST_LIGHT, LARGEST_STEP, REACH
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

CAPACITY = 512
TOLERANCE = 0.002
"""Largest remainder of the Taylor polynomial that is accepted [us]."""

_ROUNDS = 3

# rows of the array of items
(
    U0,  # lag at the start of the interval
    I0,  # light there
    DX,  # change of log intensity
    LOG,  # 1: on the logarithmic branch
    GOAL,  # level + reference - x at the start
    FALL,  # fall of the reference over the interval, constant part
    FALL_DN,  # the same for each DN
    LO,  # where the search begins
    F_LO,  # distance from the goal at LO, and its slope
    G_LO,
    F_HI,  # the same at the end of the interval
    G_HI,
    S,  # present place
    LAG_S,  # lag, light, integral of the light and distance there
    LIGHT_S,
    SUM_S,
    F_S,
    ERROR,  # what the place may still be off [us]
    A1,
    KAPPA,
    Z,
    UPTO,
    TOTAL,
    PIXEL,  # index within the strip
    LEVEL,  # signed threshold
    TAIL,  # fall, lag and light at the end of the interval
    LAG_1,
    LIGHT_1,
) = range(28)
ROWS = 28

_MANY = 64  # crossings of one pixel in one interval beyond which it is solved by itself


@kernel
def evaluate(items, count, length, circuit, nodes, weights):
    """Lag, light and integral of the light of each item at its place S."""
    dark = circuit.dark * length
    per_dn = circuit.per_dn * length
    foot = circuit.slope
    a1, kappa, z = items[A1], items[KAPPA], items[Z]
    upto, total = items[UPTO], items[TOTAL]
    place, dx, log_branch = items[S], items[DX], items[LOG]
    i0, light, integral = items[I0], items[LIGHT_S], items[SUM_S]
    for k in range(count):
        s = place[k]
        d = dx[k] * s
        on_log = log_branch[k] > 0.5
        grown = i0[k] * special.exp(d)
        i = grown if on_log else i0[k] + foot * d
        zz = -d if on_log else 0.0
        half = special.psi(zz)
        mean = i * (1.0 - d * half) if on_log else 0.5 * (i0[k] + i)
        light[k] = i
        integral[k] = s * mean
        a = (dark + per_dn * i) * s
        up = d if d > 0.0 else 0.0
        v = REACH * (1.0 + 0.6 * up) / (a + 1e-30)
        v = v if v < 1.0 else 1.0
        kap = d * s * per_dn * (i if on_log else foot)
        a1[k] = a * v
        kappa[k] = kap * v * v
        z[k] = zz * v
        upto[k] = v
        total[k] = 0.0
    for c in range(nodes.shape[0]):
        _add_node(a1, kappa, z, nodes[c], weights[c], count, total)
    u0, lag = items[U0], items[LAG_S]
    for k in range(count):
        s = place[k]
        t = dark * s + per_dn * integral[k]
        lag[k] = special.exp(-t) * u0[k] - dx[k] * s * upto[k] * total[k]


@kernel
def _add_node(a1, kappa, z, node, weight, count, total):
    for k in range(count):
        t = a1[k] * node - kappa[k] * (node * node) * special.psi(z[k] * node)
        total[k] += weight * special.exp(-t)


@kernel
def _guess(items, count):
    """First place: root of the cubic through both ends, by guarded Newton steps."""
    lo, f0, g0, f1, g1 = items[LO], items[F_LO], items[G_LO], items[F_HI], items[G_HI]
    place = items[S]
    for k in range(count):
        w = 1.0 - lo[k]
        a, b = f0[k], f1[k]
        da, db = g0[k] * w, g1[k] * w
        c2 = 3.0 * (b - a) - 2.0 * da - db
        c3 = da + db - 2.0 * (b - a)
        t = a / (a - b)
        for _ in range(4):
            v = a + t * (da + t * (c2 + t * c3))
            dv = da + t * (2.0 * c2 + 3.0 * t * c3)
            q = t - v / dv
            t = q if (q > 0.0) & (q < 1.0) else t
        place[k] = lo[k] + w * t


@kernel
def _refine(items, count, length, circuit):
    """Move each place to the root of the Taylor polynomial there; note what may be left."""
    dark = circuit.dark * length
    per_dn = circuit.per_dn * length
    foot = circuit.slope
    place, lag, light, integral = items[S], items[LAG_S], items[LIGHT_S], items[SUM_S]
    dx, log_branch, goal = items[DX], items[LOG], items[GOAL]
    fall, fall_dn, lo, error = items[FALL], items[FALL_DN], items[LO], items[ERROR]
    for k in range(count):
        s = place[k]
        d = dx[k]
        on_log = log_branch[k] > 0.5
        i0 = light[k]
        i1 = d * i0 if on_log else foot * d
        e = d if on_log else 0.0
        i2 = i1 * e / 2.0
        i3 = i2 * e / 3.0
        i4 = i3 * e / 4.0
        w0 = dark + per_dn * i0
        w1, w2, w3 = per_dn * i1, per_dn * i2, per_dn * i3
        w4, w5 = per_dn * i4, per_dn * i4 * e / 5.0
        u0 = lag[k]
        u1 = -w0 * u0 - d
        u2 = -(w0 * u1 + w1 * u0) / 2.0
        u3 = -(w0 * u2 + w1 * u1 + w2 * u0) / 3.0
        u4 = -(w0 * u3 + w1 * u2 + w2 * u1 + w3 * u0) / 4.0
        u5 = -(w0 * u4 + w1 * u3 + w2 * u2 + w3 * u1 + w4 * u0) / 5.0
        u6 = -(w0 * u5 + w1 * u4 + w2 * u3 + w3 * u2 + w4 * u1 + w5 * u0) / 6.0
        q = fall_dn[k]
        f0 = d * s + u0 + fall[k] * s + q * integral[k] - goal[k]
        f1 = d + u1 + fall[k] + q * i0
        f2 = u2 + q * i1 / 2.0
        f3 = u3 + q * i2 / 3.0
        f4 = u4 + q * i3 / 4.0
        f5 = u5 + q * i4 / 5.0
        f6 = u6
        t = -f0 / f1
        for _ in range(4):
            v = f0 + t * (f1 + t * (f2 + t * (f3 + t * (f4 + t * (f5 + t * f6)))))
            dv = f1 + t * (
                2.0 * f2 + t * (3.0 * f3 + t * (4.0 * f4 + t * (5.0 * f5 + t * 6.0 * f6)))
            )
            t = t - v / dv
        root = s + t
        good = (root >= lo[k]) & (root <= 1.0)
        reach = (w0 * (1.0 + abs(t * e)) + abs(d)) * abs(t)
        r2 = reach * reach
        left = (abs(u0) + abs(d)) * r2 * r2 * r2 * reach / 5040.0 / abs(f1) * length
        bounded = root if root > lo[k] else lo[k]
        bounded = bounded if bounded < 1.0 else 1.0
        place[k] = bounded if good | (abs(t) < 10.0) else s
        error[k] = left if good & (reach < 0.8) else 1.0


@kernel
def _settle(items, count, length, circuit, nodes, weights):
    """Bring every item to its crossing; ERROR says which did not come."""
    _guess(items, count)
    worst = 1.0
    for _ in range(_ROUNDS):
        evaluate(items, count, length, circuit, nodes, weights)
        _refine(items, count, length, circuit)
        worst = 0.0
        for k in range(count):
            e = items[ERROR, k]
            worst = e if not e <= worst else worst
        if worst <= TOLERANCE:
            break
    return worst


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
    _settle(items, m, length, circuit, nodes, weights)
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
        _settle(items, m, length, circuit, nodes, weights)
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
