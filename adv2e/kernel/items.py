r"""Crossings solved many at a time: one event an item, all items of a batch together.

The signal is monotone over the interval and stays on one branch of the log map, so each item has
one root.  It is found in three steps:

1. a guess: the root of the cubic through values and slopes at both ends;
2. one evaluation of the closed form there (the quadrature of :mod:`adv2e.kernel.screen`);
3. the root of the signal's Taylor polynomial of order 6 about that place.

The polynomial's remainder says how far off the root can be; items over the tolerance go round again
from the better place.
"""

from __future__ import annotations

from adv2e.jit import kernel
from adv2e.kernel import special
from adv2e.kernel.screen import REACH, quadrature_node

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
    LAG_S,  # lag, light and integral of the light there
    LIGHT_S,
    SUM_S,
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
) = range(27)
ROWS = 27


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
        quadrature_node(a1, kappa, z, nodes[c], weights[c], count, total)
    u0, lag = items[U0], items[LAG_S]
    for k in range(count):
        s = place[k]
        t = dark * s + per_dn * integral[k]
        lag[k] = special.exp(-t) * u0[k] - dx[k] * s * upto[k] * total[k]


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
def settle(items, count, length, circuit, nodes, weights):
    """Bring every item to its crossing; ERROR says which did not come."""
    _guess(items, count)
    for _ in range(_ROUNDS):
        evaluate(items, count, length, circuit, nodes, weights)
        _refine(items, count, length, circuit)
        worst = 0.0
        for k in range(count):
            e = items[ERROR, k]
            worst = e if not e <= worst else worst
        if worst <= TOLERANCE:
            return
