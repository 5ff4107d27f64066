"""The limit on the slew rate, put on a step that the first pole has made without it.

The equations are those of :mod:`adv2e.effects.pixel.slew_limit`.
"""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import special
from adv2e.kernel.circuit import EXACT
from adv2e.kernel.stepped import rows

_PIECES = 16
"""Parts of a step in which the limit sets in or ends."""


@kernel
def keep_first(n, strip):
    """Row CANDIDATE: the first pole before the step."""
    for k in range(n):
        strip[rows.CANDIDATE + k] = strip[rows.FIRST + k]


@kernel
def limit_slew(n, h, circuit, strip):
    """Put the limit on a step of h us that the first pole has made without it."""
    most = circuit.slew * h
    if circuit.update != EXACT:
        _limit_lines(n, most, strip)
        return
    constant, per_dn = circuit.dark * h, circuit.per_dn * h
    doubtful = np.int64(0)
    for k in range(n):
        slope0, slope1 = strip[rows.SLOPE0 + k], strip[rows.SLOPE1 + k]
        up = most if slope0 > 0.0 else -most
        ramp = strip[rows.CANDIDATE + k] + up
        wanted = (constant + per_dn * strip[rows.LIGHT1 + k]) * (strip[rows.DRIVEN1 + k] - ramp)
        limited = abs(slope0) > most
        stays = limited & (abs(wanted) >= most) & (wanted * up > 0.0)
        free = (abs(slope0) <= most) & (abs(slope1) <= most)
        strip[rows.FIRST + k] = ramp if stays else strip[rows.FIRST + k]
        strip[rows.SLOPE0 + k] = up if limited else slope0
        strip[rows.SLOPE1 + k] = up if stays else slope1
        doubt = ~(stays | free)
        strip[rows.HIT + k] = 1.0 if doubt else 0.0
        doubtful += np.int64(doubt)
    if doubtful > 0:
        for k in range(n):
            if strip[rows.HIT + k] != 0.0:
                _limit_in_pieces(k, most, constant, per_dn, strip)


@kernel
def _limit_lines(n, most, strip):
    for k in range(n):
        rise = strip[rows.SLOPE0 + k]
        rise = rise if rise < most else most
        rise = rise if rise > -most else -most
        strip[rows.FIRST + k] = strip[rows.CANDIDATE + k] + rise
        strip[rows.SLOPE0 + k] = rise
        strip[rows.SLOPE1 + k] = rise


@kernel
def _limit_in_pieces(k, most, constant, per_dn, strip):
    """Step of pixel k of the strip over which the limit sets in or ends."""
    y = strip[rows.CANDIDATE + k]
    i0, im, i1 = strip[rows.LIGHT0 + k], strip[rows.LIGHTM + k], strip[rows.LIGHT1 + k]
    bend, rise = 2.0 * (i0 + i1) - 4.0 * im, 4.0 * im - 3.0 * i0 - i1
    x0, x1 = strip[rows.DRIVEN0 + k], strip[rows.DRIVEN1 + k]
    for j in range(_PIECES):
        s = (j + 0.5) / _PIECES
        rate = constant + per_dn * (i0 + s * (rise + s * bend))
        move = (1.0 - special.exp(-rate / _PIECES)) * (x0 + (x1 - x0) * s - y)
        y += min(max(move, -most / _PIECES), most / _PIECES)
    slope = (constant + per_dn * i1) * (x1 - y)
    strip[rows.FIRST + k] = y
    strip[rows.SLOPE1 + k] = min(max(slope, -most), most)
