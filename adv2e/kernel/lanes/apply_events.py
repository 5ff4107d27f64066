"""Apply a crossing: emit the event, reset the reference, end refractory periods."""

from __future__ import annotations

from adv2e.compiled import inlined, kernel
from adv2e.kernel import per_pixel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.causes import cause_by_leak, note_reset
from adv2e.kernel.comparator import TIE, fire
from adv2e.kernel.lanes import rows
from adv2e.kernel.lanes.roots import evaluate_release, fallen_at_place

_TRIES = 3


@kernel
def cross(count, interval, circuit, lanes):
    """Reset the reference, or begin the refractory period, of lanes that found their crossing.

    Lanes with other targets are left as they are.
    """
    ta, length = interval.start, interval.length
    dead = circuit.dead_time / length
    has_dead_time = circuit.dead_time > 0.0
    for j in range(count):
        seeks = lanes[rows.SEEKS + j]
        found = (lanes[rows.MOVES + j] < 0.5) | (lanes[rows.ERROR + j] <= rows.TOLERANCE)
        tried = lanes[rows.TRIED + j] + 1.0
        lanes[rows.TRIED + j] = 0.0 if found else tried
        failed = rows.STUCK if tried >= _TRIES else seeks
        crossed = found & ((seeks == rows.SEEK_ON) | (seeks == rows.SEEK_OFF))
        place = lanes[rows.PLACE + j]
        fallen = fallen_at_place(j, lanes)
        sign = 1.0 if seeks == rows.SEEK_ON else -1.0
        lanes[rows.EVENT + j] = sign if crossed else 0.0
        lanes[rows.WHEN + j] = ta + place * length
        # a crossing without dead time goes on from there, with the reference moved by the threshold
        goes_on = crossed & (not has_dead_time)
        waits = crossed & has_dead_time
        level = lanes[rows.ON + j] if seeks == rows.SEEK_ON else -lanes[rows.OFF + j]
        moved = level if goes_on else 0.0
        lag = lanes[rows.GOAL + j] - lanes[rows.DX + j] * place - fallen
        lanes[rows.REFERENCE + j] += moved
        lanes[rows.S + j] = place if crossed else lanes[rows.S + j]
        lanes[rows.LAG_S + j] = lag if crossed else lanes[rows.LAG_S + j]
        lanes[rows.LIGHT_S + j] = lanes[rows.LIGHT_E + j] if crossed else lanes[rows.LIGHT_S + j]
        lanes[rows.FALLEN_S + j] = fallen if crossed else lanes[rows.FALLEN_S + j]
        lanes[rows.AWAY_S + j] = sign * TIE if goes_on else lanes[rows.AWAY_S + j]
        lanes[rows.AWAY_P + j] -= moved
        release = place + dead
        lanes[rows.HOLD + j] = ta + release * length if waits else lanes[rows.HOLD + j]
        lanes[rows.PLACE + j] = release if waits else place
        lanes[rows.MOVES + j] = 0.0 if waits else lanes[rows.MOVES + j]
        after = rows.DONE if release >= lanes[rows.END + j] else rows.RELEASE
        after = after if waits else (rows.READY if goes_on else seeks)
        lanes[rows.SEEKS + j] = after if found else failed


@kernel
def release(count, length, circuit, rule, lanes):
    """End the refractory periods of lanes that wait: the reference becomes the signal there."""
    evaluate_release(lanes, count, length, circuit, rule)
    for j in range(count):
        seeks = lanes[rows.SEEKS + j]
        waits = seeks == rows.RELEASE
        place = lanes[rows.PLACE + j]
        s = lanes[rows.S + j]
        lag = lanes[rows.LAG_E + j]
        since = lanes[rows.FALL + j] * (place - s) + lanes[rows.FALL_DN + j] * lanes[rows.SUM_E + j]
        fallen = lanes[rows.FALLEN_S + j] + since
        # counted from x at the start of the interval, as the reference is
        x = lanes[rows.X0 + j] + lanes[rows.DX + j] * place
        reference = x + lag + fallen if waits else lanes[rows.REFERENCE + j]
        end = lanes[rows.END + j]
        away_p = (
            lanes[rows.X0 + j]
            + lanes[rows.DX + j] * end
            + lanes[rows.U1 + j]
            + lanes[rows.TAIL + j]
            - reference
        )
        lanes[rows.REFERENCE + j] = reference
        lanes[rows.S + j] = place if waits else s
        lanes[rows.LAG_S + j] = lag if waits else lanes[rows.LAG_S + j]
        lanes[rows.LIGHT_S + j] = lanes[rows.LIGHT_E + j] if waits else lanes[rows.LIGHT_S + j]
        lanes[rows.FALLEN_S + j] = fallen if waits else lanes[rows.FALLEN_S + j]
        lanes[rows.AWAY_S + j] = 0.0 if waits else lanes[rows.AWAY_S + j]
        # the next known place is the end of the piece again
        lanes[rows.STOP + j] = end if waits else lanes[rows.STOP + j]
        lanes[rows.KNOWN + j] = 0.0 if waits else lanes[rows.KNOWN + j]
        lanes[rows.LAG_P + j] = lanes[rows.U1 + j] if waits else lanes[rows.LAG_P + j]
        lanes[rows.LIGHT_P + j] = lanes[rows.I1 + j] if waits else lanes[rows.LIGHT_P + j]
        lanes[rows.FALLEN_P + j] = lanes[rows.TAIL + j] if waits else lanes[rows.FALLEN_P + j]
        lanes[rows.AWAY_P + j] = away_p if waits else lanes[rows.AWAY_P + j]
        lanes[rows.HOLD + j] = -1.0 if waits else lanes[rows.HOLD + j]
        lanes[rows.SEEKS + j] = rows.READY if waits else seeks


@kernel
def note_releases(lo, count, pixels, state, lanes):
    """Store the references that lanes took at the end of their refractory periods."""
    for j in range(count):
        i = lo + pixels[j]
        if state[per_pixel.RESET, i] == per_pixel.NEVER and lanes[rows.HOLD + j] < 0.0:
            state[per_pixel.RESET, i] = lanes[rows.REFERENCE + j] - lanes[rows.FALLEN_S + j]


@inlined
def fire_lane(i, j, when, polarity, cause, circuit, state, lanes, buffer, n):
    """Write an event of pixel i at the place of its lane j; returns the number of events."""
    before = state[per_pixel.LEAK_FACTOR, i]
    n = fire(i, when, polarity, cause, circuit, state, buffer, n)
    if circuit.leak_jitter > 0.0:
        _change_leak(j, 1.0 / before * state[per_pixel.LEAK_FACTOR, i], lanes)
    return n


@inlined
def _change_leak(j, share, lanes):
    """Change the leak speed to `share` of the one before; the fall until place S stays."""
    lanes[rows.FALL + j] *= share
    lanes[rows.FALL_DN + j] *= share
    fallen = lanes[rows.FALLEN_S + j]
    # as if the speed had been the new one from the start of the piece
    lanes[rows.FALLEN_B + j] = fallen + share * (lanes[rows.FALLEN_B + j] - fallen)
    lanes[rows.TAIL + j] = fallen + share * (lanes[rows.TAIL + j] - fallen)
    until_stop = fallen + share * (lanes[rows.FALLEN_P + j] - fallen)
    lanes[rows.AWAY_P + j] += until_stop - lanes[rows.FALLEN_P + j]
    lanes[rows.FALLEN_P + j] = until_stop


@kernel
def fire_found(lo, m, circuit, state, pixels, lanes, buffer, n):
    """Write the events of the crossings that were found; returns the number of events."""
    (buffer,) = borrowed(buffer)
    for j in range(m):
        event = lanes[rows.EVENT + j]
        if event != 0.0:
            i, when = lo + pixels[j], lanes[rows.WHEN + j]
            after = lanes[rows.REFERENCE + j] - lanes[rows.FALLEN_S + j]
            level = lanes[rows.ON + j] if event > 0.0 else -lanes[rows.OFF + j]
            before = after if circuit.dead_time > 0.0 else after - level
            cause = cause_by_leak(i, event, before, circuit, state)
            note_reset(i, after, circuit, state)
            n = fire_lane(i, j, when, event, cause, circuit, state, lanes, buffer, n)
    return n
