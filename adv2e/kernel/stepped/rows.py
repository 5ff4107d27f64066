"""Rows of the stepped solver: one flat float64 array, a strip of pixels in each row.

Names that end in 0 and 1 are values at the start and at the end of a step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WIDTH = 512
"""Pixels of a strip; the rows of a step lie in the second level of cache."""

_PADDED = WIDTH + 24  # rows must not share cache sets

(
    XA,  # log intensity at the start and at the end of an interval
    XB,
    AHEAD,  # at the end of the next one, for the printed last interval
    BASE,  # continuity samples of the interval, see driver._take_samples
    STEP,
    PIECE,  # x at the start of a straight piece, and how far it goes
    MOVE,
    UNTIL,  # x at its end
    GROWN,  # e^x at the start of the step
    RATIO,  # by which that grows in half a step
    LIGHT0,  # light [DN] at the start, in the middle and at the end of the step
    LIGHTM,
    LIGHT1,
    X1,
    DRIVEN0,  # x with what is added to it
    DRIVEN1,
    FIRST,  # behind the first pole
    CANDIDATE,  # the same if the slew limit played no part
    DECAY,  # of the first pole over the step
    NOISE,
    INPUT0,  # of the second pole
    INPUT1,
    SLOPE0,  # of the signal at both ends [ln units a step]
    SLOPE1,
    SECOND,  # behind the second pole
    BEHIND,  # before the high-pass, at the end of the step
    SLOW,  # what that subtracts
    ADDED,  # to the signal
    SIGNAL0,
    SIGNAL1,
    REFERENCE,
    LEAK_ON,  # ON threshold times the leak's speed
    ON,  # thresholds, per_pixel.NEVER in the dead time
    OFF,
    ON_STEP,  # the same with factors of each pixel, the lesser of both ends of the step
    OFF_STEP,
    DUE,  # when something happens whatever the signal does [us]
    FROM,  # part of the step that is over
    HIT,
    # for the causes of events alone
    NOISE0,  # photoreceptor noise at the start of the step
    SEEN0,  # the same as the comparator sees it, at the start and at the end
    SEEN,
    ADDED0,  # what is added to the signal, at the start
) = range(0, 43 * _PADDED, _PADDED)


def new_rows() -> NDArray[np.float64]:
    """Return the rows of a strip."""
    size, line = 43 * _PADDED, 8
    memory = np.zeros(size + line)
    # from the start of a cache line on: where vectors cross lines, steps take an eighth longer
    first = -(memory.ctypes.data // memory.itemsize) % line
    return memory[first : first + size]


def normals() -> NDArray[np.float64]:
    """Return the rows of normal numbers of four steps."""
    return np.zeros((4, _PADDED))
