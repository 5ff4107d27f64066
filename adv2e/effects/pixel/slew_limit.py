r"""Limited slew rate of the photoreceptor.

.. math:: |\dot y| \le s

y is the output of the first pole (:mod:`adv2e.effects.pixel.low_pass`), s = ``per_s`` what its bias
current can charge the load with.  The pole follows its equation as long as it asks for less;
beyond, its output is a ramp.  Large steps of the light are then late by more the larger they are,
small ones are not.

References
----------
.. [1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
   contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337 (photoreceptor and
   its buffer, both biased by fixed currents).
.. [2] P. R. Gray, P. J. Hurst, S. H. Lewis, R. G. Meyer, "Analysis and Design of Analog Integrated
   Circuits", 5th ed., Wiley 2009, section 9.6 (slew rate: bias current over capacitance).
"""

from __future__ import annotations

from dataclasses import dataclass

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
from adv2e.parameters import Fit, Section, parameter

_PIECES = 16
"""Parts of a step in which the limit sets in or ends."""


@dataclass(frozen=True, kw_only=True)
class SlewLimit(Section):
    """Limited slew rate of the first pole."""

    per_s: float = parameter(
        unit="ln/s",
        meaning="fastest change of the filtered signal",
        above=0,
        fit=Fit(0.5, 1e4, 30.0, log=True),
    )


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
