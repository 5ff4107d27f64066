"""The pixels of a strip that may fire, one a lane, from event to event through one interval.

A lane goes from place to place: the next crossing, the extremum of the signal where it may cross a
threshold before that, the end of a dead time, the next noise event, and at last the end of its
piece of the interval.  In each round all lanes search for one place each
(:mod:`adv2e.kernel.lanes.roots`), apply it, and then choose the next target
(:mod:`adv2e.kernel.lanes.targets`): most of them together, the others one by one.
"""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.lanes import rows
from adv2e.kernel.lanes.roots import (
    end_of_piece,
    evaluate,
    first_place,
    guess,
    next_piece,
    open_piece,
    refine,
)
from adv2e.kernel.lanes.rows import move, whole
from adv2e.kernel.lanes.targets import (
    choose,
    cross,
    fire_found,
    found_stop,
    go_on,
    note_releases,
    release,
)
from adv2e.kernel.leak import leak_over
from adv2e.kernel.noise import next_noise

# ---- Pixels into lanes and out of them.


_LEAVING, _STAYING = rows.A1, rows.KAPPA  # rows that hold nothing between two searches


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
        x0 = screen.log_of(i0, circuit)
        x1 = screen.log_of(i1, circuit)
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
    strip[screen.DUE + k] = min(due - start, screen.NEVER) * screen.EARLY


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


@kernel
def _waiting(m, lanes):
    """Return the number of lanes to search for ends of dead times: m, or 0 if none waits."""
    waiting = 0
    for j in range(m):
        waiting += lanes[rows.SEEKS + j] == rows.RELEASE
    return m if waiting > 0 else 0


@kernel
def decide(lo, m, waiting, interval, circuit, rule, state, memory, buffer, n):
    """Choose the next target of each of m lanes; none of them then waits for a dead time to end.

    All lanes that wait now are among the first `waiting` ones.

    Returns (lanes with a target, events so far); at most one event a lane is written.
    """
    (buffer,) = borrowed(buffer)
    pixels, lanes, length = memory.pixels, memory.lanes, interval.length
    while True:
        if waiting > 0:
            release(whole(waiting), length, circuit, rule, lanes)
            if circuit.causes:
                note_releases(lo, waiting, pixels, state, lanes)
        choose(whole(m), interval, circuit, lanes)
        for j in range(m):
            seeks = lanes[rows.SEEKS + j]
            if seeks in (rows.DOUBTFUL, rows.STUCK):
                n = go_on(lo + pixels[j], j, interval, circuit, state, lanes, buffer, n)
                seeks = lanes[rows.SEEKS + j]
            if seeks == rows.DONE and lanes[rows.END + j] < 1.0:
                next_piece(j, circuit, lanes)
        m = sort_out(lo, m, interval.origin, state, memory)
        waiting = _waiting(m, lanes)
        if waiting == 0:
            return m, n


@kernel
def search(lo, m, interval, circuit, rule, state, memory, buffer, n):
    """Find the target of every lane; returns the number of events, and `waiting` for `decide`.

    At most one event a lane is written.
    """
    pixels, lanes, length = memory.pixels, memory.lanes, interval.length
    count = whole(m)
    guess(lanes, count, length, circuit)
    evaluate(lanes, count, length, circuit, rule)
    refine(lanes, count, length, circuit)
    cross(count, interval, circuit, lanes)
    n = fire_found(lo, m, circuit, state, pixels, lanes, buffer, n)
    for j in range(m):
        seeks = lanes[rows.SEEKS + j]
        if seeks in (rows.INJECTED, rows.HALF) or (
            seeks == rows.TURN and lanes[rows.ERROR + j] <= rows.TOLERANCE
        ):
            found_stop(lo + pixels[j], j, circuit, state, lanes)
        elif seeks == rows.OPEN:
            open_piece(j, interval, lanes)
    return n, _waiting(m, lanes)
