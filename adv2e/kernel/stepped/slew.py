"""The limit on the slew rate, put on a step that the first pole has made without it.

The equations are those of :mod:`adv2e.effects.pixel.slew_limit`.
"""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import special
from adv2e.kernel.stepped.rows import (
    CANDIDATE,
    DRIVEN0,
    DRIVEN1,
    FIRST,
    HIT,
    LIGHT0,
    LIGHT1,
    LIGHTM,
    SLOPE0,
    SLOPE1,
)
from adv2e.kernel.workspace import EXACT, Array, Circuit

_PIECES = 16
"""Parts of a step in which the limit sets in or ends."""


@kernel
def keep_first(n: int, rows: Array) -> None:
    """Row CANDIDATE: the first pole before the step."""
    for k in range(n):
        rows[CANDIDATE + k] = rows[FIRST + k]


@kernel
def limit_slew(n: int, h: float, circuit: Circuit, rows: Array) -> None:
    """Put the limit on a step of h us that the first pole has made without it."""
    most = circuit.slew * h
    if circuit.update != EXACT:
        _limit_lines(n, most, rows)
        return
    constant, per_dn = circuit.dark * h, circuit.per_dn * h
    doubtful = np.int64(0)
    for k in range(n):
        slope0, slope1 = rows[SLOPE0 + k], rows[SLOPE1 + k]
        up = most if slope0 > 0.0 else -most
        ramp = rows[CANDIDATE + k] + up
        wanted = (constant + per_dn * rows[LIGHT1 + k]) * (rows[DRIVEN1 + k] - ramp)
        limited = abs(slope0) > most
        stays = limited & (abs(wanted) >= most) & (wanted * up > 0.0)
        free = (abs(slope0) <= most) & (abs(slope1) <= most)
        rows[FIRST + k] = ramp if stays else rows[FIRST + k]
        rows[SLOPE0 + k] = up if limited else slope0
        rows[SLOPE1 + k] = up if stays else slope1
        doubt = ~(stays | free)
        rows[HIT + k] = 1.0 if doubt else 0.0
        doubtful += np.int64(doubt)
    if doubtful > 0:
        for k in range(n):
            if rows[HIT + k] != 0.0:
                _limit_in_pieces(k, most, constant, per_dn, rows)


@kernel
def _limit_lines(n: int, most: float, rows: Array) -> None:
    for k in range(n):
        rise = rows[SLOPE0 + k]
        rise = rise if rise < most else most
        rise = rise if rise > -most else -most
        rows[FIRST + k] = rows[CANDIDATE + k] + rise
        rows[SLOPE0 + k] = rise
        rows[SLOPE1 + k] = rise


@kernel
def _limit_in_pieces(k: int, most: float, constant: float, per_dn: float, rows: Array) -> None:
    """Step of pixel k of the strip over which the limit sets in or ends."""
    y = rows[CANDIDATE + k]
    i0, im, i1 = rows[LIGHT0 + k], rows[LIGHTM + k], rows[LIGHT1 + k]
    bend, rise = 2.0 * (i0 + i1) - 4.0 * im, 4.0 * im - 3.0 * i0 - i1
    x0, x1 = rows[DRIVEN0 + k], rows[DRIVEN1 + k]
    for j in range(_PIECES):
        s = (j + 0.5) / _PIECES
        rate = constant + per_dn * (i0 + s * (rise + s * bend))
        move = (1.0 - special.exp(-rate / _PIECES)) * (x0 + (x1 - x0) * s - y)
        y += min(max(move, -most / _PIECES), most / _PIECES)
    slope = (constant + per_dn * i1) * (x1 - y)
    rows[FIRST + k] = y
    rows[SLOPE1 + k] = min(max(slope, -most), most)
