"""Pieces of an interval over which the light stays on one branch and moves by less than an e-fold.

Above the light that the quadrature is chosen for, they are shorter by as much as the corner is
faster.

The screen knows the signal at the end of an interval that is one piece.  In any other interval the
end of each piece is a target of its lane, before the piece is solved.
"""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel import screen, special
from adv2e.kernel.lanes import rows

BEFORE_END = 1.0 - 2.0**-53
"""The last place before 1."""

_PIECE = 0.95  # longest piece of a step over LARGEST_STEP [ln units]


@kernel
def set_stop(j, place, lag, light, fallen, lanes):
    """Set the next known place, and the signal there."""
    lanes[rows.STOP + j] = place
    lanes[rows.LAG_P + j] = lag
    lanes[rows.LIGHT_P + j] = light
    lanes[rows.FALLEN_P + j] = fallen
    x = lanes[rows.X0 + j] + lanes[rows.DX + j] * place
    lanes[rows.AWAY_P + j] = x + lag + fallen - lanes[rows.REFERENCE + j]


@kernel
def fallen_at_place(j, lanes):
    """Fall of the reference until the place that was evaluated."""
    since = lanes[rows.FALL + j] * (lanes[rows.PLACE + j] - lanes[rows.BASE + j])
    return lanes[rows.FALLEN_B + j] + since + lanes[rows.FALL_DN + j] * lanes[rows.SUM_E + j]


@kernel
def end_of_piece(base, x0, dx, knee, mixed, brightest):
    """End of the piece that begins at `base`: at the knee, after about an e-fold, or at 1.

    brightest: the larger of the light at its start and at 1 [DN].  Also returns whether the piece
    is on the logarithmic branch, as far as the knee decides that.
    """
    at_knee = (knee - x0) / (dx if dx != 0.0 else 1.0)
    at_knee = at_knee if at_knee > 0.0 else 0.0
    ahead = mixed & (at_knee > base) & (at_knee < 1.0)
    end = at_knee if ahead else 1.0
    step = abs(dx)
    longest = _PIECE / (step if step > _PIECE else 1.0)
    end = base + longest if step * (end - base) > screen.LARGEST_STEP else end
    longest = screen.LARGEST_LIGHT / (
        brightest if brightest > screen.LARGEST_LIGHT else screen.LARGEST_LIGHT
    )
    end = base + longest if end - base > longest else end
    return end, x0 + dx * 0.5 * (base + end) >= knee


@kernel
def first_place(j, ta, length, lanes):
    """Return the first target of a lane at the start of its piece, and its place."""
    base, end = lanes[rows.BASE + j], lanes[rows.END + j]
    hold = lanes[rows.HOLD + j]
    held = hold >= 0.0
    release = (hold - ta) / length
    injected = (lanes[rows.NOISE + j] - ta) / length
    seeks = rows.INJECTED if injected < end else rows.READY
    seeks = rows.RELEASE if held else seeks
    seeks = rows.DONE if held & (release >= end) else seeks
    place = release if held else min(injected, end * BEFORE_END)
    return seeks, place if place > base else base


@kernel
def open_piece(j, ta, length, lanes):
    """Begin a piece at whose end the signal was evaluated."""
    lag = lanes[rows.LAG_E + j]
    lag = lag if abs(lag) > screen.AT_REST else 0.0
    fallen = fallen_at_place(j, lanes)
    lanes[rows.U1 + j] = lag
    lanes[rows.I1 + j] = lanes[rows.LIGHT_E + j]
    lanes[rows.TAIL + j] = fallen
    set_stop(j, lanes[rows.END + j], lag, lanes[rows.LIGHT_E + j], fallen, lanes)
    lanes[rows.KNOWN + j] = 0.0
    seeks, place = first_place(j, ta, length, lanes)
    lanes[rows.SEEKS + j] = seeks
    lanes[rows.PLACE + j] = place


@kernel
def next_piece(j, circuit, lanes):
    """Move a lane to the next piece; its target is the end of that piece."""
    base, dx, x0 = lanes[rows.END + j], lanes[rows.DX + j], lanes[rows.X0 + j]
    lag, fallen = lanes[rows.U1 + j], lanes[rows.TAIL + j]
    light = lanes[rows.I1 + j]
    x1 = x0 + dx
    mixed = (x0 < circuit.knee) != (x1 < circuit.knee)
    brightest = max(light, special.exp(x1) if x1 >= circuit.knee else 0.0)
    end, on_log = end_of_piece(base, x0, dx, circuit.knee, mixed, brightest)
    lanes[rows.LOG + j] = 1.0 if on_log or circuit.slope == 0.0 else 0.0
    lanes[rows.BASE + j] = base
    lanes[rows.END + j] = end
    lanes[rows.U0 + j] = lag
    lanes[rows.I0 + j] = light
    lanes[rows.FALLEN_B + j] = fallen
    lanes[rows.S + j] = base
    lanes[rows.LAG_S + j] = lag
    lanes[rows.LIGHT_S + j] = light
    lanes[rows.FALLEN_S + j] = fallen
    lanes[rows.AWAY_S + j] = x0 + dx * base + lag + fallen - lanes[rows.REFERENCE + j]
    lanes[rows.KNOWN + j] = 0.0
    lanes[rows.SEEKS + j] = rows.OPEN
    lanes[rows.PLACE + j] = end
    lanes[rows.MOVES + j] = 0.0
