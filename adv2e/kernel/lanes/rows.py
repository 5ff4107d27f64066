"""Lanes: pixels that are solved side by side, one flat array with a row for each of their numbers.

A lane holds a pixel over an interval, or over a piece of one: its light stays on one branch of the
log map and moves by less than an e-fold.  Most pixels take one piece, from 0 to 1; one that passes
the knee takes one before and one after, and larger steps are cut in more.

Places s are shares of the interval; x, signal and reference are counted from x at its start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import embedded, kernel
from adv2e.kernel.work_queue import STRIP

TOLERANCE = 0.002
"""Largest remainder of the Taylor polynomial that is accepted [us]."""

WIDTH = 16
"""Lanes are computed this many at a time, so that every loop is whole vectors."""

_STRIDE = STRIP + WIDTH + 8  # rows must not share cache sets
(
    # what holds over the whole interval
    X0,  # log intensity at its start
    DX,  # change of log intensity
    FALL,  # fall of the reference over the interval at the present leak speed, constant part
    FALL_DN,  # the same for each DN
    ON,  # thresholds
    OFF,
    REFERENCE,  # at its start, and moved by the events since
    HOLD,  # end of the dead time [us], -1: not in it
    NOISE,  # next noise event [us]
    # what holds over the present piece
    BASE,  # its start, and its end
    END,
    U0,  # lag at its start, and at its end
    U1,
    I0,  # light at its start, and at its end
    I1,
    LOG,  # 1: on the logarithmic branch
    FALLEN_B,  # fall of the reference until its start and end, as if always at that speed
    TAIL,
    # where the lane is, and the next place that is known
    S,
    LAG_S,  # lag, light, fall of the reference and distance of the signal from it
    LIGHT_S,
    FALLEN_S,
    AWAY_S,
    STOP,
    LAG_P,
    LIGHT_P,
    FALLEN_P,
    AWAY_P,
    KNOWN,  # 1: STOP is the turn, or the time of a noise event
    KIND,  # of the noise event at STOP
    # what it looks for
    SEEKS,
    TRIED,  # how often in vain
    MOVES,  # 1: the place is a root, guessed and refined; 0: it is given
    GOAL,  # value to be reached
    # what was found
    PLACE,
    LAG_E,  # lag and light there, integral of the light since the start of the piece
    LIGHT_E,
    SUM_E,
    ERROR,  # what the place may still be off [us]
    EVENT,  # 1: an event ON, -1: OFF, 0: none
    WHEN,  # its time [us]
    # scratch of the quadrature
    A1,
    KAPPA,
    Z,
    UPTO,
    TOTAL,
) = (row * _STRIDE for row in range(46))
SIZE = 46 * _STRIDE

# what a lane is looking for; READY: to be decided; DOUBTFUL: to be decided lane by lane, STUCK:
# because its search failed; HALF: the signal half-way to STOP; OPEN: at the end of its piece
DONE, STUCK, SEEK_ON, SEEK_OFF, TURN, INJECTED, RELEASE, READY, DOUBTFUL, OPEN, HALF = (
    float(code) for code in range(11)
)


def new_rows() -> NDArray[np.float64]:
    """Return the flat array of rows; lanes that fill up a vector must be harmless."""
    rows = np.zeros(SIZE)
    for row in (I0, I1, END, STOP, DX, U0):
        rows[row : row + _STRIDE] = 1.0
    return rows


@embedded
def move(lanes, source, target):
    """Move the state of lane `source` that is kept from round to round to lane `target`."""
    for row in range(X0, PLACE + 1, _STRIDE):
        lanes[row + target] = lanes[row + source]


@kernel
def whole(count):
    """Round a number of lanes up to whole vectors."""
    return (count + WIDTH - 1) // WIDTH * WIDTH
