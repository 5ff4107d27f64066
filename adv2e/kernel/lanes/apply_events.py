"""What becomes of lanes whose place was found: events, and the ends of dead times."""

from __future__ import annotations

from adv2e.compiled import inlined, kernel
from adv2e.effects.pixel.leak import next_leak_factor
from adv2e.kernel.comparator import TIE, emit
from adv2e.kernel.lanes.layout import (
    AWAY_P,
    AWAY_S,
    DONE,
    DX,
    END,
    ERROR,
    EVENT,
    FALL,
    FALL_DN,
    FALLEN_B,
    FALLEN_P,
    FALLEN_S,
    FRESH,
    GOAL,
    HOLD,
    I1,
    KNOWN,
    LAG_E,
    LAG_P,
    LAG_S,
    LIGHT_E,
    LIGHT_P,
    LIGHT_S,
    MOVES,
    OFF,
    ON,
    PLACE,
    READY,
    REFERENCE,
    RELEASE,
    SEEK_OFF,
    SEEK_ON,
    SEEKS,
    STOP,
    STUCK,
    SUM_E,
    TAIL,
    TOLERANCE,
    TRIED,
    U1,
    WHEN,
    X0,
    S,
)
from adv2e.kernel.lanes.pieces import fallen_at_place
from adv2e.kernel.lanes.roots import evaluate_release
from adv2e.kernel.workspace import S_LEAK_FACTOR

_TRIES = 3


@kernel
def land(count, ta, length, circuit, lanes):
    """Take the thresholds that were found; other places are left as they are."""
    dead = circuit.dead_time / length
    has_dead_time = circuit.dead_time > 0.0
    for j in range(count):
        seeks = lanes[SEEKS + j]
        found = (lanes[MOVES + j] < 0.5) | (lanes[ERROR + j] <= TOLERANCE)
        tried = lanes[TRIED + j] + 1.0
        lanes[TRIED + j] = tried
        failed = STUCK if tried >= _TRIES else seeks
        crossed = found & ((seeks == SEEK_ON) | (seeks == SEEK_OFF))
        place = lanes[PLACE + j]
        fallen = fallen_at_place(j, lanes)
        sign = 1.0 if seeks == SEEK_ON else -1.0
        lanes[EVENT + j] = sign if crossed else 0.0
        lanes[WHEN + j] = ta + place * length
        # a crossing without dead time goes on from there, with the reference moved by the threshold
        goes_on = crossed & (not has_dead_time)
        waits = crossed & has_dead_time
        level = lanes[ON + j] if seeks == SEEK_ON else -lanes[OFF + j]
        moved = level if goes_on else 0.0
        lag = lanes[GOAL + j] - lanes[DX + j] * place - fallen
        lanes[REFERENCE + j] += moved
        lanes[S + j] = place if crossed else lanes[S + j]
        lanes[LAG_S + j] = lag if crossed else lanes[LAG_S + j]
        lanes[LIGHT_S + j] = lanes[LIGHT_E + j] if crossed else lanes[LIGHT_S + j]
        lanes[FALLEN_S + j] = fallen if crossed else lanes[FALLEN_S + j]
        lanes[AWAY_S + j] = sign * TIE if goes_on else lanes[AWAY_S + j]
        lanes[AWAY_P + j] -= moved
        release = place + dead
        lanes[HOLD + j] = ta + release * length if waits else lanes[HOLD + j]
        lanes[PLACE + j] = release if waits else place
        lanes[FRESH + j] = 0.0
        lanes[MOVES + j] = 0.0 if waits else lanes[MOVES + j]
        after = DONE if release >= lanes[END + j] else RELEASE
        after = after if waits else (READY if goes_on else seeks)
        lanes[SEEKS + j] = after if found else failed


@kernel
def release(count, length, circuit, rule, lanes):
    """See lanes that wait through their dead time: the reference at its end is the signal."""
    evaluate_release(lanes, count, length, circuit, rule)
    for j in range(count):
        seeks = lanes[SEEKS + j]
        waits = seeks == RELEASE
        place = lanes[PLACE + j]
        s = lanes[S + j]
        lag = lanes[LAG_E + j]
        since = lanes[FALL + j] * (place - s) + lanes[FALL_DN + j] * lanes[SUM_E + j]
        fallen = lanes[FALLEN_S + j] + since
        # counted from x at the start of the interval, as the reference is
        x = lanes[X0 + j] + lanes[DX + j] * place
        reference = x + lag + fallen if waits else lanes[REFERENCE + j]
        end = lanes[END + j]
        away_p = lanes[X0 + j] + lanes[DX + j] * end + lanes[U1 + j] + lanes[TAIL + j] - reference
        lanes[REFERENCE + j] = reference
        lanes[S + j] = place if waits else s
        lanes[LAG_S + j] = lag if waits else lanes[LAG_S + j]
        lanes[LIGHT_S + j] = lanes[LIGHT_E + j] if waits else lanes[LIGHT_S + j]
        lanes[FALLEN_S + j] = fallen if waits else lanes[FALLEN_S + j]
        lanes[AWAY_S + j] = 0.0 if waits else lanes[AWAY_S + j]
        # the next known place is the end of the piece again
        lanes[STOP + j] = end if waits else lanes[STOP + j]
        lanes[KNOWN + j] = 0.0 if waits else lanes[KNOWN + j]
        lanes[LAG_P + j] = lanes[U1 + j] if waits else lanes[LAG_P + j]
        lanes[LIGHT_P + j] = lanes[I1 + j] if waits else lanes[LIGHT_P + j]
        lanes[FALLEN_P + j] = lanes[TAIL + j] if waits else lanes[FALLEN_P + j]
        lanes[AWAY_P + j] = away_p if waits else lanes[AWAY_P + j]
        lanes[HOLD + j] = -1.0 if waits else lanes[HOLD + j]
        lanes[SEEKS + j] = READY if waits else seeks


@inlined
def _begin_leak_cycle(i, j, circuit, state, lanes):
    """Draw the leak speed of the cycle that begins at S; what has fallen until there stays."""
    share = 1.0 / state[S_LEAK_FACTOR, i]
    share *= next_leak_factor(i, circuit, state)
    lanes[FALL + j] *= share
    lanes[FALL_DN + j] *= share
    fallen = lanes[FALLEN_S + j]
    # as if the speed had been the new one from the start of the piece
    lanes[FALLEN_B + j] = fallen + share * (lanes[FALLEN_B + j] - fallen)
    lanes[TAIL + j] = fallen + share * (lanes[TAIL + j] - fallen)
    until_stop = fallen + share * (lanes[FALLEN_P + j] - fallen)
    lanes[AWAY_P + j] += until_stop - lanes[FALLEN_P + j]
    lanes[FALLEN_P + j] = until_stop


@inlined
def fire(i, j, when, polarity, t_base, circuit, state, lanes, keys, times, n):
    """Write an event of pixel i, in lane j, where the lane is; returns the number of events."""
    if circuit.leak_jitter > 0.0:
        _begin_leak_cycle(i, j, circuit, state, lanes)
    return emit(keys, times, n, when, t_base, i, 1 if polarity > 0 else 0)


@kernel
def fire_found(lo, m, t_base, circuit, state, pixels, lanes, keys, times, n):
    """Write the events of the thresholds that were found."""
    for j in range(m):
        event = lanes[EVENT + j]
        if event != 0.0:
            i, when = lo + pixels[j], lanes[WHEN + j]
            n = fire(i, j, when, event, t_base, circuit, state, lanes, keys, times, n)
    return n
