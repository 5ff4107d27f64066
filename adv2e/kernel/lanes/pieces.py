"""Pieces of an interval over which the light stays on one branch and moves by less than an e-fold.

Above the light that the quadrature is chosen for, they are shorter by as much as the corner is
faster.

The screen knows the signal at the end of an interval that is one piece.  For any other, the end of
each piece is a place like those that lanes look for, before the piece is gone through.
"""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel import special
from adv2e.kernel.lanes.layout import (
    AWAY_P,
    AWAY_S,
    BASE,
    DONE,
    DX,
    END,
    FALL,
    FALL_DN,
    FALLEN_B,
    FALLEN_P,
    FALLEN_S,
    FRESH,
    HOLD,
    I0,
    I1,
    INJECTED,
    KNOWN,
    LAG_E,
    LAG_P,
    LAG_S,
    LIGHT_E,
    LIGHT_P,
    LIGHT_S,
    LOG,
    MOVES,
    NOISE,
    OPEN,
    PLACE,
    READY,
    REFERENCE,
    RELEASE,
    SEEKS,
    STOP,
    SUM_E,
    TAIL,
    U0,
    U1,
    X0,
    S,
)
from adv2e.kernel.screen import AT_REST, LARGEST_LIGHT, LARGEST_STEP

BEFORE_END = 1.0 - 2.0**-53
"""The last place before 1."""

_PIECE = 0.95  # longest piece of a step over LARGEST_STEP [ln units]


@kernel
def set_stop(j, place, lag, light, fallen, lanes):
    """Set the next known place, and the signal there."""
    lanes[STOP + j] = place
    lanes[LAG_P + j] = lag
    lanes[LIGHT_P + j] = light
    lanes[FALLEN_P + j] = fallen
    x = lanes[X0 + j] + lanes[DX + j] * place
    lanes[AWAY_P + j] = x + lag + fallen - lanes[REFERENCE + j]


@kernel
def fallen_at_place(j, lanes):
    """Fall of the reference until the place that was looked at."""
    since = lanes[FALL + j] * (lanes[PLACE + j] - lanes[BASE + j])
    return lanes[FALLEN_B + j] + since + lanes[FALL_DN + j] * lanes[SUM_E + j]


@kernel
def end_of_piece(base, x0, dx, knee, mixed, brightest):
    """Where the piece that begins at `base` ends: at the knee, after about an e-fold, or at 1.

    brightest: light at its start or at 1 [DN], whichever is more.  Also tells whether the piece is
    on the logarithmic branch, as far as the knee decides that.
    """
    at_knee = (knee - x0) / (dx if dx != 0.0 else 1.0)
    at_knee = at_knee if at_knee > 0.0 else 0.0
    ahead = mixed & (at_knee > base) & (at_knee < 1.0)
    end = at_knee if ahead else 1.0
    step = abs(dx)
    longest = _PIECE / (step if step > _PIECE else 1.0)
    end = base + longest if step * (end - base) > LARGEST_STEP else end
    longest = LARGEST_LIGHT / (brightest if brightest > LARGEST_LIGHT else LARGEST_LIGHT)
    end = base + longest if end - base > longest else end
    return end, x0 + dx * 0.5 * (base + end) >= knee


@kernel
def first_place(j, ta, length, lanes):
    """Return what a lane at the start of its piece looks for first, and where."""
    base, end = lanes[BASE + j], lanes[END + j]
    hold = lanes[HOLD + j]
    held = hold >= 0.0
    release = (hold - ta) / length
    injected = (lanes[NOISE + j] - ta) / length
    seeks = INJECTED if injected < end else READY
    seeks = RELEASE if held else seeks
    seeks = DONE if held & (release >= end) else seeks
    place = release if held else min(injected, end * BEFORE_END)
    return seeks, place if place > base else base


@kernel
def open_piece(j, ta, length, lanes):
    """Begin a piece, the signal at whose end was looked at."""
    lag = lanes[LAG_E + j]
    lag = lag if abs(lag) > AT_REST else 0.0
    fallen = fallen_at_place(j, lanes)
    lanes[U1 + j] = lag
    lanes[I1 + j] = lanes[LIGHT_E + j]
    lanes[TAIL + j] = fallen
    set_stop(j, lanes[END + j], lag, lanes[LIGHT_E + j], fallen, lanes)
    lanes[KNOWN + j] = 0.0
    seeks, place = first_place(j, ta, length, lanes)
    lanes[SEEKS + j] = seeks
    lanes[PLACE + j] = place


@kernel
def next_piece(j, circuit, lanes):
    """Move a lane that is done with a piece on to the next one, to look at its end."""
    base, dx, x0 = lanes[END + j], lanes[DX + j], lanes[X0 + j]
    lag, fallen = lanes[U1 + j], lanes[TAIL + j]
    light = lanes[I1 + j]
    x1 = x0 + dx
    mixed = (x0 < circuit.knee) != (x1 < circuit.knee)
    brightest = max(light, special.exp(x1) if x1 >= circuit.knee else 0.0)
    end, on_log = end_of_piece(base, x0, dx, circuit.knee, mixed, brightest)
    lanes[LOG + j] = 1.0 if on_log or circuit.slope == 0.0 else 0.0
    lanes[BASE + j] = base
    lanes[END + j] = end
    lanes[U0 + j] = lag
    lanes[I0 + j] = light
    lanes[FALLEN_B + j] = fallen
    lanes[S + j] = base
    lanes[LAG_S + j] = lag
    lanes[LIGHT_S + j] = light
    lanes[FALLEN_S + j] = fallen
    lanes[AWAY_S + j] = x0 + dx * base + lag + fallen - lanes[REFERENCE + j]
    lanes[KNOWN + j] = 0.0
    lanes[SEEKS + j] = OPEN
    lanes[PLACE + j] = end
    lanes[FRESH + j] = 0.0
    lanes[MOVES + j] = 0.0
