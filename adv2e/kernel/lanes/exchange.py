"""Pixels into lanes and out of them."""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel import special
from adv2e.kernel.comparator import HOT, SHOT
from adv2e.kernel.lanes.layout import (
    A1,
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
    KAPPA,
    KNOWN,
    LAG_P,
    LAG_S,
    LIGHT_P,
    LIGHT_S,
    LOG,
    MOVES,
    NOISE,
    OFF,
    ON,
    OPEN,
    PLACE,
    REFERENCE,
    SEEKS,
    STOP,
    TAIL,
    U0,
    U1,
    X0,
    S,
    move,
    whole,
)
from adv2e.kernel.lanes.pieces import end_of_piece, first_place
from adv2e.kernel.screen import (
    AWAY_1,
    DUE,
    LAG_0,
    LAG_1,
    LARGEST_LIGHT,
    LARGEST_STEP,
    LIGHT_0,
    LIGHT_1,
    MARGIN,
    NEVER,
)
from adv2e.kernel.screen import OFF as SCREEN_OFF
from adv2e.kernel.screen import ON as SCREEN_ON
from adv2e.kernel.workspace import (
    S_HOLD,
    S_HOT_TIME,
    S_LEAK_FACTOR,
    S_OFF,
    S_ON,
    S_REFERENCE,
    S_SHOT_TIME,
)

_LEAVING, _STAYING = A1, KAPPA  # rows that hold nothing between two searches
EARLY = 1.0 - 1e-6  # single precision must not make a due time late
_NO_TIME = 1e300


@kernel
def log_of(light, circuit):
    """Log intensity of light [DN] as loaded."""
    safe = light if light > 1e-30 else 1e-30
    x = special.log(safe)
    if circuit.slope > 0.0:
        x = x if light >= circuit.slope * circuit.knee else light / circuit.slope
    return x


@kernel
def next_noise(i, circuit, state):
    """When the next noise event of pixel i may come [us]."""
    due = _NO_TIME
    if circuit.shot_rate > 0.0:
        due = min(due, state[S_SHOT_TIME, i])
    if circuit.hot_rate > 0.0:
        due = min(due, state[S_HOT_TIME, i])
    return due


@kernel
def kind_of_next_noise(i, circuit, state):
    """Tell whether the next noise event of pixel i is SHOT or HOT."""
    shot = state[S_SHOT_TIME, i] if circuit.shot_rate > 0.0 else _NO_TIME
    hot = state[S_HOT_TIME, i] if circuit.hot_rate > 0.0 else _NO_TIME
    return HOT if hot < shot else SHOT


@kernel
def watch(k, i, x1, start, circuit, state, rows):
    """Rows of the screen for pixel k of a strip, i of the state: distance, thresholds, due time."""
    rows[AWAY_1 + k] = x1 - state[S_REFERENCE, i]
    hold = state[S_HOLD, i]
    if hold >= 0.0:
        rows[SCREEN_ON + k] = NEVER
        rows[SCREEN_OFF + k] = NEVER
        rows[DUE + k] = (hold - start) * EARLY
    else:
        rows[SCREEN_ON + k] = state[S_ON, i] - MARGIN
        rows[SCREEN_OFF + k] = state[S_OFF, i] - MARGIN
        rows[DUE + k] = min(next_noise(i, circuit, state) - start, NEVER) * EARLY


@kernel
def _gather(lo, m, circuit, state, rows, falls, pixels, lanes):
    """Fill the lanes with what screen and state know of their pixels."""
    for j in range(m):
        k = pixels[j]
        lanes[U0 + j] = rows[LAG_0 + k]
        lanes[U1 + j] = rows[LAG_1 + k]
        lanes[I0 + j] = rows[LIGHT_0 + k]
        lanes[I1 + j] = rows[LIGHT_1 + k]
        lanes[TAIL + j] = falls[k]
        lanes[ON + j] = state[S_ON, lo + k]
        lanes[OFF + j] = state[S_OFF, lo + k]
        lanes[REFERENCE + j] = state[S_REFERENCE, lo + k]
        lanes[HOLD + j] = state[S_HOLD, lo + k]
    if circuit.shot_rate > 0.0 or circuit.hot_rate > 0.0:
        for j in range(m):
            lanes[NOISE + j] = next_noise(lo + pixels[j], circuit, state)
    else:
        for j in range(m):
            lanes[NOISE + j] = _NO_TIME


@kernel
def held_first(m, rows, pixels):
    """Put pixels in dead time before the others; returns their number."""
    held = 0
    for j in range(m):
        k = pixels[j]
        if rows[SCREEN_ON + k] >= NEVER:
            pixels[j] = pixels[held]
            pixels[held] = k
            held += 1
    return held


@kernel
def load(lo, m, ta, length, circuit, state, rows, falls, pixels, lanes):
    """Put the m flagged pixels in lanes, at the start of their interval."""
    _gather(lo, m, circuit, state, rows, falls, pixels, lanes)
    knee = circuit.knee
    knee_dn = circuit.slope * knee
    leak, photo_leak = length * circuit.leak, length * circuit.photo_leak
    for j in range(whole(m)):
        i0, i1 = lanes[I0 + j], lanes[I1 + j]
        u0, u1 = lanes[U0 + j], lanes[U1 + j]
        x0 = log_of(i0, circuit)
        x1 = log_of(i1, circuit)
        dx = x1 - x0
        mixed = (i0 < knee_dn) != (i1 < knee_dn)
        bright = i1 > LARGEST_LIGHT
        in_pieces = mixed | (abs(dx) > LARGEST_STEP) | bright
        brightest = max(i0, i1) if in_pieces else 0.0
        end, on_log = end_of_piece(0.0, x0, dx, knee, mixed, brightest)
        on_log = on_log if mixed else min(i0, i1) >= knee_dn
        lanes[X0 + j] = x0
        lanes[DX + j] = dx
        lanes[LOG + j] = 1.0 if on_log else 0.0
        lanes[BASE + j] = 0.0
        lanes[END + j] = end
        lanes[FALLEN_B + j] = 0.0
        lanes[FALL + j] = lanes[ON + j] * leak
        lanes[FALL_DN + j] = lanes[ON + j] * photo_leak
        lanes[S + j] = 0.0
        lanes[LAG_S + j] = u0
        lanes[LIGHT_S + j] = i0
        lanes[FALLEN_S + j] = 0.0
        lanes[AWAY_S + j] = x0 + u0 - lanes[REFERENCE + j]
        lanes[STOP + j] = 1.0
        lanes[KNOWN + j] = 0.0
        lanes[LAG_P + j] = u1
        lanes[LIGHT_P + j] = i1
        lanes[FALLEN_P + j] = lanes[TAIL + j]
        lanes[AWAY_P + j] = x0 + dx + u1 + lanes[TAIL + j] - lanes[REFERENCE + j]
        seeks, place = first_place(j, ta, length, lanes)
        seeks = OPEN if in_pieces else seeks
        place = end if in_pieces else place
        lanes[SEEKS + j] = seeks
        lanes[PLACE + j] = place
        lanes[FRESH + j] = 0.0
        lanes[MOVES + j] = 0.0
    if circuit.leak_jitter > 0.0:
        for j in range(m):
            factor = state[S_LEAK_FACTOR, lo + pixels[j]]
            lanes[FALL + j] *= factor
            lanes[FALL_DN + j] *= factor


@kernel
def _finish(j, lo, start, state, rows, pixels, lanes):
    """Write back the state of a lane at the end of its interval."""
    k = pixels[j]
    reference = lanes[REFERENCE + j] - lanes[TAIL + j]
    hold = lanes[HOLD + j]
    state[S_REFERENCE, lo + k] = reference
    state[S_HOLD, lo + k] = hold
    rows[AWAY_1 + k] = lanes[X0 + j] + lanes[DX + j] - reference
    rows[LAG_1 + k] = lanes[U1 + j]  # the screen does not know it where there are pieces
    held = hold >= 0.0
    rows[SCREEN_ON + k] = NEVER if held else lanes[ON + j] - MARGIN
    rows[SCREEN_OFF + k] = NEVER if held else lanes[OFF + j] - MARGIN
    due = hold if held else lanes[NOISE + j]
    rows[DUE + k] = min(due - start, NEVER) * EARLY


@kernel
def sort_out(lo, m, start, state, rows, pixels, lanes):
    """Take out the lanes that are done; returns how many stay."""
    leaving, staying = 0, 0
    for j in range(m):
        if lanes[SEEKS + j] == DONE:
            _finish(j, lo, start, state, rows, pixels, lanes)
            lanes[_LEAVING + leaving] = j
            leaving += 1
        else:
            lanes[_STAYING + staying] = j
            staying += 1
    # the last lanes that stay fill the gaps among the first ones, so that few have to move
    gaps = 0
    while gaps < leaving and lanes[_LEAVING + gaps] < staying:
        gaps += 1
    for c in range(gaps):
        gap, last = int(lanes[_LEAVING + c]), int(lanes[_STAYING + staying - gaps + c])
        move(lanes, last, gap)
        pixels[gap] = pixels[last]
    return staying
