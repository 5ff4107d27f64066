"""Next crossing of all lanes together, without branches.

Between two known places the signal is monotone, or it has its extremum where it cannot cross.  So
the distance at both places tells whether a threshold is crossed, and that it is crossed once.
Extrema, noise events and crossings that leak may cause are left to
:mod:`adv2e.kernel.lanes.slow_path`.
"""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel.comparator import TIE
from adv2e.kernel.lanes import rows


@kernel
def sure_of_leak(away_s, away_p, lag_s, lag_p, span, dx, rate_s, rate_p, leak, on, off):
    """Tell whether the distances at S and STOP show all crossings of a falling signal.

    Its distance from the falling reference moves by leak - z, z = w u being the fall of the signal.

    * Where z stays above the leak, the distance is monotone.  While u keeps its sign, it gets
      no smaller than at the ends or, where x runs away from y, than |dx/ds| / w.  What the leak
      exceeds that least z by, times the span, is the most that the distance can rise.
    * dz/ds = w (p - z (1 + q)) with p = -dx/ds and q = |dw/ds| / w^2, which is at most p / w where
      x falls.  So where p exceeds the leak by the share q, z passes the leak only upwards: the
      distance rises at first, if at all.
    * Where x rises or rests, dz/ds <= z (dx/ds - w) - w dx/ds: with w > dx/ds, z only falls, and
      the distance rises at last, if at all.  Then it may only dip below the lower level and return.

    The first and the last two lines hold for all three: far from both levels nothing is crossed.
    """
    slowest = min(rate_s, rate_p)
    least = min(abs(lag_s), abs(lag_p))
    follows = -dx / (max(rate_s, rate_p) + 1e-300) if dx < 0.0 else least
    rise = span * (leak - slowest * min(least, follows))
    driven = (dx < 0.0) & (-dx > leak * (1.0 - dx / (slowest + 1e-300)))
    settling = (dx >= 0.0) & (slowest > dx)
    may_rise = away_s + rise >= on
    may_dip = away_p - rise <= -off
    dips = may_dip & (away_p > -off)
    return (
        (rise < 0.0)
        | (driven & (not may_rise))
        | (settling & (not dips))
        | ((not may_rise) & (not may_dip))
    )


@kernel
def choose(count, ta, length, circuit, lanes):
    """Choose the first threshold crossing of lanes that are READY, or mark them DOUBTFUL."""
    dark, per_dn = circuit.dark * length, circuit.per_dn * length
    for j in range(count):
        seeks = lanes[rows.SEEKS + j]
        ready = seeks == rows.READY
        on, off = lanes[rows.ON + j] + TIE, lanes[rows.OFF + j] + TIE
        away_s, away_p = lanes[rows.AWAY_S + j], lanes[rows.AWAY_P + j]
        lag_s, lag_p = lanes[rows.LAG_S + j], lanes[rows.LAG_P + j]
        span = lanes[rows.STOP + j] - lanes[rows.S + j]
        light_s, light_p = lanes[rows.LIGHT_S + j], lanes[rows.LIGHT_P + j]
        rate_s, rate_p = dark + per_dn * light_s, dark + per_dn * light_p
        dx = lanes[rows.DX + j]
        leak = 1.01 * (lanes[rows.FALL + j] + lanes[rows.FALL_DN + j] * max(light_s, light_p))
        sure = sure_of_leak(away_s, away_p, lag_s, lag_p, span, dx, rate_s, rate_p, leak, on, off)
        doubtful = (
            (lag_s * lag_p < 0.0)
            | (lanes[rows.NOISE + j] < ta + lanes[rows.END + j] * length)
            | (lanes[rows.KNOWN + j] > 0.5)
            | (away_s >= on)
            | (away_s <= -off)
            | ((leak > 0.0) & (lag_s + lag_p > 0.0) & (not sure))
        )
        what = rows.SEEK_ON if away_p >= on else (rows.SEEK_OFF if away_p <= -off else rows.DONE)
        what = rows.DOUBTFUL if doubtful else what
        what = what if ready else seeks
        lanes[rows.SEEKS + j] = what
        crosses = ready & ((what == rows.SEEK_ON) | (what == rows.SEEK_OFF))
        lanes[rows.MOVES + j] = 1.0 if crosses else lanes[rows.MOVES + j]
