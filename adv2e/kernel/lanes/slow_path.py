"""What a lane looks for next, decided by itself: turns, noise events, and what leak makes doubtful.

Where a falling signal may be outrun by leak, or a search has failed, the lane looks at the place
half-way to the next known one, and decides up to there; down to `TOLERANCE`, if it must.  From a
place so passed it goes on by twice the step.
"""

from __future__ import annotations

from adv2e.compiled import inlined, kernel
from adv2e.kernel.comparator import (
    SIGNAL_EVENT,
    TIE,
    injected_polarity,
    next_injected,
    use_up,
)
from adv2e.kernel.lanes.apply_events import fire
from adv2e.kernel.lanes.exchange import kind_of_next_noise, next_noise
from adv2e.kernel.lanes.layout import (
    AWAY_P,
    AWAY_S,
    DONE,
    DOUBTFUL,
    DX,
    END,
    F_HI,
    F_LO,
    FALL,
    FALL_DN,
    FALLEN_P,
    FALLEN_S,
    FRESH,
    G_HI,
    G_LO,
    GOAL,
    HALF,
    HOLD,
    I1,
    INJECTED,
    KIND,
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
    OFF,
    ON,
    PLACE,
    REFERENCE,
    RELEASE,
    ROOT,
    SEEK_OFF,
    SEEK_ON,
    SEEKS,
    STOP,
    STUCK,
    TAIL,
    TOLERANCE,
    TRIED,
    TURN,
    U1,
    X0,
    S,
)
from adv2e.kernel.lanes.next_target import sure_of_leak
from adv2e.kernel.lanes.pieces import BEFORE_END, fallen_at_place, set_stop
from adv2e.kernel.workspace import NEVER

_STRAIGHT = 0.9
_HALF_WAY = -1


@kernel
def _seek_given(j, what, place, lanes):
    """Look at a given place next."""
    lanes[SEEKS + j] = what
    lanes[PLACE + j] = place
    lanes[FRESH + j] = 0.0
    lanes[MOVES + j] = 0.0


@kernel
def _seek_root(j, what, length, circuit, lanes):
    """Look for a threshold, or for the turn, between S and STOP next.

    A place at S, and one up to a STOP that is near, is known without a search.
    """
    turn = what == TURN
    level = lanes[ON + j] + TIE if what == SEEK_ON else -lanes[OFF + j] - TIE
    drift = -lanes[DX + j] if turn else 0.0
    root = 0.0 if turn else 1.0
    lanes[SEEKS + j] = what
    lanes[TRIED + j] = 0.0
    lanes[ROOT + j] = root
    lanes[GOAL + j] = 0.0 if turn else lanes[REFERENCE + j] - lanes[X0 + j] + level
    lanes[F_LO + j] = lanes[LAG_S + j] if turn else lanes[AWAY_S + j] - level
    lanes[F_HI + j] = lanes[LAG_P + j] if turn else lanes[AWAY_P + j] - level
    away = lanes[F_LO + j]
    beyond = (what == SEEK_ON and away >= 0.0) or (what == SEEK_OFF and away <= 0.0)
    near = (lanes[STOP + j] - lanes[S + j]) * length <= TOLERANCE
    lanes[FRESH + j] = 0.0 if beyond or near else 1.0
    lanes[MOVES + j] = lanes[FRESH + j]
    lanes[PLACE + j] = lanes[S + j] if beyond else lanes[STOP + j]
    # the slope of the lag is -w u - dx, that of the distance -w u plus the leak
    rate_s = (circuit.dark + circuit.per_dn * lanes[LIGHT_S + j]) * length
    rate_p = (circuit.dark + circuit.per_dn * lanes[LIGHT_P + j]) * length
    leak_s = root * (lanes[FALL + j] + lanes[FALL_DN + j] * lanes[LIGHT_S + j])
    leak_p = root * (lanes[FALL + j] + lanes[FALL_DN + j] * lanes[LIGHT_P + j])
    lanes[G_LO + j] = drift - rate_s * lanes[LAG_S + j] + leak_s
    lanes[G_HI + j] = drift - rate_p * lanes[LAG_P + j] + leak_p


@kernel
def _moves_before_turn(j, length, circuit, lanes):
    """How far the signal moves at most before it turns, signed; see the screen's bound."""
    lag, dx = lanes[LAG_S + j], lanes[DX + j]
    if lanes[LOG + j] < 0.5 or abs(lag) >= _STRAIGHT:
        return -lag
    rate = (circuit.dark + circuit.per_dn * lanes[LIGHT_S + j]) * length
    meet = abs(lag) / (rate * abs(lag) + abs(dx))
    return dx * min(meet, 1.0) - lag


@inlined
def _choose(j, length, circuit, lanes):
    """Tell what comes first between S and STOP: a threshold, TURN, DONE (nothing), or try HALF."""
    on, off = lanes[ON + j] + TIE, lanes[OFF + j] + TIE
    away_s, away_p = lanes[AWAY_S + j], lanes[AWAY_P + j]
    lag_s, lag_p = lanes[LAG_S + j], lanes[LAG_P + j]
    drift = lanes[FALLEN_P + j] - lanes[FALLEN_S + j]
    span = lanes[STOP + j] - lanes[S + j]
    rate_s = (circuit.dark + circuit.per_dn * lanes[LIGHT_S + j]) * length
    rate_p = (circuit.dark + circuit.per_dn * lanes[LIGHT_P + j]) * length
    light = max(lanes[LIGHT_S + j], lanes[LIGHT_P + j])
    leak = 1.01 * (lanes[FALL + j] + lanes[FALL_DN + j] * light)
    dx = lanes[DX + j]
    if away_s >= on or away_s <= -off:  # by rounding
        return SEEK_ON if away_s >= on else SEEK_OFF
    by_end = SEEK_ON if away_p >= on else (SEEK_OFF if away_p <= -off else DONE)
    if span * length <= TOLERANCE:
        return by_end
    if lanes[SEEKS + j] == STUCK:
        return HALF
    if lag_s * lag_p < 0.0:
        reach = away_s + _moves_before_turn(j, length, circuit, lanes)
        if lag_s > 0.0:  # falls, then rises
            return TURN if reach <= -off or away_s + drift >= on else by_end
        # rises, then falls: what holds from the turn on, where u = 0, decides
        sure = drift == 0.0 or sure_of_leak(
            -NEVER, away_p, 0.0, lag_p, span, dx, rate_s, rate_p, leak, on, off
        )
        return by_end if sure and reach + drift < on else TURN
    falls = drift > 0.0 and lag_s + lag_p > 0.0
    if falls and not sure_of_leak(
        away_s, away_p, lag_s, lag_p, span, dx, rate_s, rate_p, leak, on, off
    ):
        return HALF
    return by_end


@inlined
def found_stop(i, j, circuit, state, lanes):
    """Make the place that was looked at, a turn, a half or that of a noise event, the next stop."""
    seeks = lanes[SEEKS + j]
    lanes[KIND + j] = SIGNAL_EVENT
    if seeks == INJECTED:
        lanes[KIND + j] = kind_of_next_noise(i, circuit, state)
    elif seeks == HALF:
        lanes[KIND + j] = _HALF_WAY
    lag = 0.0 if seeks == TURN else lanes[LAG_E + j]
    set_stop(j, lanes[PLACE + j], lag, lanes[LIGHT_E + j], fallen_at_place(j, lanes), lanes)
    lanes[KNOWN + j] = 1.0
    lanes[SEEKS + j] = DOUBTFUL


@inlined
def _find_stop(i, j, ta, length, circuit, state, lanes):
    """Set STOP to the end of the piece; tells whether a noise event comes before it."""
    end = lanes[END + j]
    t_end = ta + end * length
    if lanes[NOISE + j] < t_end:
        now = ta + lanes[S + j] * length
        kind, t = next_injected(i, now, t_end, circuit, state)
        lanes[NOISE + j] = next_noise(i, circuit, state)
        if kind != SIGNAL_EVENT:
            place = min(max((t - ta) / length, lanes[S + j]), end * BEFORE_END)
            _seek_given(j, INJECTED, place, lanes)
            return True
    set_stop(j, end, lanes[U1 + j], lanes[I1 + j], lanes[TAIL + j], lanes)
    return False


@inlined
def _pass_stop(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n):
    """Go to STOP, where nothing was crossed before, and fire what is due there.

    Returns the number of events, and whether there was one.
    """
    lanes[KNOWN + j] = 0.0
    lanes[S + j] = lanes[STOP + j]
    lanes[LAG_S + j] = lanes[LAG_P + j]
    lanes[LIGHT_S + j] = lanes[LIGHT_P + j]
    lanes[FALLEN_S + j] = lanes[FALLEN_P + j]
    lanes[AWAY_S + j] = lanes[AWAY_P + j]
    kind = int(lanes[KIND + j])
    if kind in (SIGNAL_EVENT, _HALF_WAY):
        return n, False
    polarity = injected_polarity(i, kind, lanes[LIGHT_S + j], circuit, state)
    use_up(i, kind, circuit, state)
    lanes[NOISE + j] = next_noise(i, circuit, state)
    if polarity == 0:
        return n, False
    when = ta + lanes[S + j] * length
    n = fire(i, j, when, polarity, t_base, circuit, state, lanes, keys, times, n)
    lanes[REFERENCE + j] += lanes[AWAY_S + j]
    lanes[AWAY_S + j] = 0.0
    return n, True


@inlined
def go_on(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n):
    """Decide what a doubtful lane looks for next.  Returns the number of events."""
    while True:
        if lanes[KNOWN + j] < 0.5 and _find_stop(i, j, ta, length, circuit, state, lanes):
            return n
        what = _choose(j, length, circuit, lanes)
        if what == HALF:
            _seek_given(j, HALF, 0.5 * (lanes[S + j] + lanes[STOP + j]), lanes)
            return n
        if what != DONE:
            _seek_root(j, what, length, circuit, lanes)
            return n
        if lanes[KNOWN + j] < 0.5:
            lanes[SEEKS + j] = DONE
            return n
        lanes[SEEKS + j] = DOUBTFUL
        span = lanes[STOP + j] - lanes[S + j]
        n, fired = _pass_stop(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n)
        if fired and circuit.dead_time > 0.0:
            release = lanes[S + j] + circuit.dead_time / length
            lanes[HOLD + j] = ta + release * length
            _seek_given(j, RELEASE if release < lanes[END + j] else DONE, release, lanes)
            return n
        place = lanes[S + j] + 2.0 * span
        until = min(lanes[END + j], (lanes[NOISE + j] - ta) / length)
        if lanes[KIND + j] == _HALF_WAY and span * length > TOLERANCE and place < until:
            _seek_given(j, HALF, place, lanes)
            return n
