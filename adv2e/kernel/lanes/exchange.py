"""Pixels into lanes and out of them."""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen, special
from adv2e.kernel.lanes import rows
from adv2e.kernel.lanes.roots import end_of_piece, first_place
from adv2e.kernel.lanes.rows import move, whole
from adv2e.kernel.leak import leak_over
from adv2e.kernel.noise import next_noise

_LEAVING, _STAYING = rows.A1, rows.KAPPA  # rows that hold nothing between two searches
EARLY = 1.0 - 1e-6  # single precision must not make a due time late


@kernel
def log_of(light, circuit):
    """Log intensity of light [DN] as loaded."""
    safe = light if light > 1e-30 else 1e-30
    x = special.log(safe)
    if circuit.slope > 0.0:
        x = x if light >= circuit.slope * circuit.knee else light / circuit.slope
    return x


@kernel
def watch(k, i, x1, start, circuit, state, strip):
    """Rows of the screen for pixel k of a strip, i of the state: distance, thresholds, due time."""
    strip[screen.AWAY_1 + k] = x1 - state[per_pixel.REFERENCE, i]
    hold = state[per_pixel.HOLD, i]
    if hold >= 0.0:
        strip[screen.ON + k] = screen.NEVER
        strip[screen.OFF + k] = screen.NEVER
        strip[screen.DUE + k] = (hold - start) * EARLY
    else:
        strip[screen.ON + k] = state[per_pixel.ON, i] - screen.MARGIN
        strip[screen.OFF + k] = state[per_pixel.OFF, i] - screen.MARGIN
        due = next_noise(i, circuit, state)[1]
        strip[screen.DUE + k] = min(due - start, screen.NEVER) * EARLY


@kernel
def _gather(lo, m, circuit, state, memory):
    """Fill the lanes with what screen and state know of their pixels."""
    strip, falls, pixels, lanes = memory.rows, memory.falls, memory.pixels, memory.lanes
    for j in range(m):
        k = pixels[j]
        lanes[rows.U0 + j] = strip[screen.LAG_0 + k]
        lanes[rows.U1 + j] = strip[screen.LAG_1 + k]
        lanes[rows.I0 + j] = strip[screen.LIGHT_0 + k]
        lanes[rows.I1 + j] = strip[screen.LIGHT_1 + k]
        lanes[rows.TAIL + j] = falls[k]
        lanes[rows.ON + j] = state[per_pixel.ON, lo + k]
        lanes[rows.OFF + j] = state[per_pixel.OFF, lo + k]
        lanes[rows.REFERENCE + j] = state[per_pixel.REFERENCE, lo + k]
        lanes[rows.HOLD + j] = state[per_pixel.HOLD, lo + k]
        lanes[rows.NOISE + j] = next_noise(lo + k, circuit, state)[1]


@kernel
def held_first(m, strip, pixels):
    """Put pixels in dead time before the others; returns their number."""
    held = 0
    for j in range(m):
        k = pixels[j]
        if strip[screen.ON + k] >= screen.NEVER:
            pixels[j] = pixels[held]
            pixels[held] = k
            held += 1
    return held


@kernel
def load(lo, m, interval, circuit, state, memory):
    """Put the m flagged pixels in lanes, at the start of their interval."""
    _gather(lo, m, circuit, state, memory)
    pixels, lanes = memory.pixels, memory.lanes
    knee = circuit.knee
    knee_dn = circuit.slope * knee
    leak, photo_leak = leak_over(interval.length, circuit)
    for j in range(whole(m)):
        i0, i1 = lanes[rows.I0 + j], lanes[rows.I1 + j]
        u0, u1 = lanes[rows.U0 + j], lanes[rows.U1 + j]
        x0 = log_of(i0, circuit)
        x1 = log_of(i1, circuit)
        dx = x1 - x0
        mixed = (i0 < knee_dn) != (i1 < knee_dn)
        bright = i1 > screen.LARGEST_LIGHT
        in_pieces = mixed | (abs(dx) > screen.LARGEST_STEP) | bright
        brightest = max(i0, i1) if in_pieces else 0.0
        end, on_log = end_of_piece(0.0, x0, dx, knee, mixed, brightest)
        on_log = on_log if mixed else min(i0, i1) >= knee_dn
        lanes[rows.X0 + j] = x0
        lanes[rows.DX + j] = dx
        lanes[rows.LOG + j] = 1.0 if on_log else 0.0
        lanes[rows.BASE + j] = 0.0
        lanes[rows.END + j] = end
        lanes[rows.FALLEN_B + j] = 0.0
        lanes[rows.FALL + j] = lanes[rows.ON + j] * leak
        lanes[rows.FALL_DN + j] = lanes[rows.ON + j] * photo_leak
        lanes[rows.S + j] = 0.0
        lanes[rows.LAG_S + j] = u0
        lanes[rows.LIGHT_S + j] = i0
        lanes[rows.FALLEN_S + j] = 0.0
        lanes[rows.AWAY_S + j] = x0 + u0 - lanes[rows.REFERENCE + j]
        lanes[rows.STOP + j] = 1.0
        lanes[rows.KNOWN + j] = 0.0
        lanes[rows.LAG_P + j] = u1
        lanes[rows.LIGHT_P + j] = i1
        lanes[rows.FALLEN_P + j] = lanes[rows.TAIL + j]
        lanes[rows.AWAY_P + j] = x0 + dx + u1 + lanes[rows.TAIL + j] - lanes[rows.REFERENCE + j]
        seeks, place = first_place(j, interval, lanes)
        seeks = rows.OPEN if in_pieces else seeks
        place = end if in_pieces else place
        lanes[rows.SEEKS + j] = seeks
        lanes[rows.PLACE + j] = place
        lanes[rows.TRIED + j] = 0.0
        lanes[rows.MOVES + j] = 0.0
    if circuit.leak_jitter > 0.0:
        for j in range(m):
            factor = state[per_pixel.LEAK_FACTOR, lo + pixels[j]]
            lanes[rows.FALL + j] *= factor
            lanes[rows.FALL_DN + j] *= factor


@kernel
def _finish(j, lo, start, state, memory):
    """Write back the state of a lane at the end of its interval."""
    strip, lanes, k = memory.rows, memory.lanes, memory.pixels[j]
    reference = lanes[rows.REFERENCE + j] - lanes[rows.TAIL + j]
    hold = lanes[rows.HOLD + j]
    state[per_pixel.REFERENCE, lo + k] = reference
    state[per_pixel.HOLD, lo + k] = hold
    strip[screen.AWAY_1 + k] = lanes[rows.X0 + j] + lanes[rows.DX + j] - reference
    # the screen does not know it where there are pieces
    strip[screen.LAG_1 + k] = lanes[rows.U1 + j]
    held = hold >= 0.0
    strip[screen.ON + k] = screen.NEVER if held else lanes[rows.ON + j] - screen.MARGIN
    strip[screen.OFF + k] = screen.NEVER if held else lanes[rows.OFF + j] - screen.MARGIN
    due = hold if held else lanes[rows.NOISE + j]
    strip[screen.DUE + k] = min(due - start, screen.NEVER) * EARLY


@kernel
def sort_out(lo, m, start, state, memory):
    """Take out the lanes that are done; returns how many stay."""
    pixels, lanes = memory.pixels, memory.lanes
    leaving, staying = 0, 0
    for j in range(m):
        if lanes[rows.SEEKS + j] == rows.DONE:
            _finish(j, lo, start, state, memory)
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
