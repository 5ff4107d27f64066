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
from adv2e.kernel.lanes import rows
from adv2e.kernel.lanes.apply_events import fire
from adv2e.kernel.lanes.exchange import kind_of_next_noise, next_noise
from adv2e.kernel.lanes.next_target import sure_of_leak
from adv2e.kernel.lanes.pieces import BEFORE_END, fallen_at_place, set_stop
from adv2e.kernel.workspace import NEVER

_STRAIGHT = 0.9
_HALF_WAY = -1


@kernel
def _seek_given(j, what, place, lanes):
    """Look at a given place next."""
    lanes[rows.SEEKS + j] = what
    lanes[rows.PLACE + j] = place
    lanes[rows.FRESH + j] = 0.0
    lanes[rows.MOVES + j] = 0.0


@kernel
def _seek_root(j, what, length, circuit, lanes):
    """Look for a threshold, or for the turn, between S and STOP next.

    A place at S, and one up to a STOP that is near, is known without a search.
    """
    turn = what == rows.TURN
    level = lanes[rows.ON + j] + TIE if what == rows.SEEK_ON else -lanes[rows.OFF + j] - TIE
    drift = -lanes[rows.DX + j] if turn else 0.0
    root = 0.0 if turn else 1.0
    lanes[rows.SEEKS + j] = what
    lanes[rows.TRIED + j] = 0.0
    lanes[rows.ROOT + j] = root
    lanes[rows.GOAL + j] = 0.0 if turn else lanes[rows.REFERENCE + j] - lanes[rows.X0 + j] + level
    lanes[rows.F_LO + j] = lanes[rows.LAG_S + j] if turn else lanes[rows.AWAY_S + j] - level
    lanes[rows.F_HI + j] = lanes[rows.LAG_P + j] if turn else lanes[rows.AWAY_P + j] - level
    away = lanes[rows.F_LO + j]
    beyond = (what == rows.SEEK_ON and away >= 0.0) or (what == rows.SEEK_OFF and away <= 0.0)
    near = (lanes[rows.STOP + j] - lanes[rows.S + j]) * length <= rows.TOLERANCE
    lanes[rows.FRESH + j] = 0.0 if beyond or near else 1.0
    lanes[rows.MOVES + j] = lanes[rows.FRESH + j]
    lanes[rows.PLACE + j] = lanes[rows.S + j] if beyond else lanes[rows.STOP + j]
    # the slope of the lag is -w u - dx, that of the distance -w u plus the leak
    rate_s = (circuit.dark + circuit.per_dn * lanes[rows.LIGHT_S + j]) * length
    rate_p = (circuit.dark + circuit.per_dn * lanes[rows.LIGHT_P + j]) * length
    leak_s = root * (lanes[rows.FALL + j] + lanes[rows.FALL_DN + j] * lanes[rows.LIGHT_S + j])
    leak_p = root * (lanes[rows.FALL + j] + lanes[rows.FALL_DN + j] * lanes[rows.LIGHT_P + j])
    lanes[rows.G_LO + j] = drift - rate_s * lanes[rows.LAG_S + j] + leak_s
    lanes[rows.G_HI + j] = drift - rate_p * lanes[rows.LAG_P + j] + leak_p


@kernel
def _moves_before_turn(j, length, circuit, lanes):
    """How far the signal moves at most before it turns, signed; see the screen's bound."""
    lag, dx = lanes[rows.LAG_S + j], lanes[rows.DX + j]
    if lanes[rows.LOG + j] < 0.5 or abs(lag) >= _STRAIGHT:
        return -lag
    rate = (circuit.dark + circuit.per_dn * lanes[rows.LIGHT_S + j]) * length
    meet = abs(lag) / (rate * abs(lag) + abs(dx))
    return dx * min(meet, 1.0) - lag


@inlined
def _choose(j, length, circuit, lanes):
    """Tell what comes first between S and STOP: a threshold, TURN, DONE (nothing), or try HALF."""
    on, off = lanes[rows.ON + j] + TIE, lanes[rows.OFF + j] + TIE
    away_s, away_p = lanes[rows.AWAY_S + j], lanes[rows.AWAY_P + j]
    lag_s, lag_p = lanes[rows.LAG_S + j], lanes[rows.LAG_P + j]
    drift = lanes[rows.FALLEN_P + j] - lanes[rows.FALLEN_S + j]
    span = lanes[rows.STOP + j] - lanes[rows.S + j]
    rate_s = (circuit.dark + circuit.per_dn * lanes[rows.LIGHT_S + j]) * length
    rate_p = (circuit.dark + circuit.per_dn * lanes[rows.LIGHT_P + j]) * length
    light = max(lanes[rows.LIGHT_S + j], lanes[rows.LIGHT_P + j])
    leak = 1.01 * (lanes[rows.FALL + j] + lanes[rows.FALL_DN + j] * light)
    dx = lanes[rows.DX + j]
    if away_s >= on or away_s <= -off:  # by rounding
        return rows.SEEK_ON if away_s >= on else rows.SEEK_OFF
    by_end = rows.SEEK_ON if away_p >= on else (rows.SEEK_OFF if away_p <= -off else rows.DONE)
    if span * length <= rows.TOLERANCE:
        return by_end
    if lanes[rows.SEEKS + j] == rows.STUCK:
        return rows.HALF
    if lag_s * lag_p < 0.0:
        reach = away_s + _moves_before_turn(j, length, circuit, lanes)
        if lag_s > 0.0:  # falls, then rises
            return rows.TURN if reach <= -off or away_s + drift >= on else by_end
        # rises, then falls: what holds from the turn on, where u = 0, decides
        sure = drift == 0.0 or sure_of_leak(
            -NEVER, away_p, 0.0, lag_p, span, dx, rate_s, rate_p, leak, on, off
        )
        return by_end if sure and reach + drift < on else rows.TURN
    falls = drift > 0.0 and lag_s + lag_p > 0.0
    if falls and not sure_of_leak(
        away_s, away_p, lag_s, lag_p, span, dx, rate_s, rate_p, leak, on, off
    ):
        return rows.HALF
    return by_end


@inlined
def found_stop(i, j, circuit, state, lanes):
    """Make the place that was looked at, a turn, a half or that of a noise event, the next stop."""
    seeks = lanes[rows.SEEKS + j]
    lanes[rows.KIND + j] = SIGNAL_EVENT
    if seeks == rows.INJECTED:
        lanes[rows.KIND + j] = kind_of_next_noise(i, circuit, state)
    elif seeks == rows.HALF:
        lanes[rows.KIND + j] = _HALF_WAY
    lag = 0.0 if seeks == rows.TURN else lanes[rows.LAG_E + j]
    set_stop(
        j, lanes[rows.PLACE + j], lag, lanes[rows.LIGHT_E + j], fallen_at_place(j, lanes), lanes
    )
    lanes[rows.KNOWN + j] = 1.0
    lanes[rows.SEEKS + j] = rows.DOUBTFUL


@inlined
def _find_stop(i, j, ta, length, circuit, state, lanes):
    """Set STOP to the end of the piece; tells whether a noise event comes before it."""
    end = lanes[rows.END + j]
    t_end = ta + end * length
    if lanes[rows.NOISE + j] < t_end:
        now = ta + lanes[rows.S + j] * length
        kind, t = next_injected(i, now, t_end, circuit, state)
        lanes[rows.NOISE + j] = next_noise(i, circuit, state)
        if kind != SIGNAL_EVENT:
            place = min(max((t - ta) / length, lanes[rows.S + j]), end * BEFORE_END)
            _seek_given(j, rows.INJECTED, place, lanes)
            return True
    set_stop(j, end, lanes[rows.U1 + j], lanes[rows.I1 + j], lanes[rows.TAIL + j], lanes)
    return False


@inlined
def _pass_stop(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n):
    """Go to STOP, where nothing was crossed before, and fire what is due there.

    Returns the number of events, and whether there was one.
    """
    lanes[rows.KNOWN + j] = 0.0
    lanes[rows.S + j] = lanes[rows.STOP + j]
    lanes[rows.LAG_S + j] = lanes[rows.LAG_P + j]
    lanes[rows.LIGHT_S + j] = lanes[rows.LIGHT_P + j]
    lanes[rows.FALLEN_S + j] = lanes[rows.FALLEN_P + j]
    lanes[rows.AWAY_S + j] = lanes[rows.AWAY_P + j]
    kind = int(lanes[rows.KIND + j])
    if kind in (SIGNAL_EVENT, _HALF_WAY):
        return n, False
    polarity = injected_polarity(i, kind, lanes[rows.LIGHT_S + j], circuit, state)
    use_up(i, kind, circuit, state)
    lanes[rows.NOISE + j] = next_noise(i, circuit, state)
    if polarity == 0:
        return n, False
    when = ta + lanes[rows.S + j] * length
    n = fire(i, j, when, polarity, t_base, circuit, state, lanes, keys, times, n)
    lanes[rows.REFERENCE + j] += lanes[rows.AWAY_S + j]
    lanes[rows.AWAY_S + j] = 0.0
    return n, True


@inlined
def go_on(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n):
    """Decide what a doubtful lane looks for next.  Returns the number of events."""
    while True:
        if lanes[rows.KNOWN + j] < 0.5 and _find_stop(i, j, ta, length, circuit, state, lanes):
            return n
        what = _choose(j, length, circuit, lanes)
        if what == rows.HALF:
            _seek_given(j, rows.HALF, 0.5 * (lanes[rows.S + j] + lanes[rows.STOP + j]), lanes)
            return n
        if what != rows.DONE:
            _seek_root(j, what, length, circuit, lanes)
            return n
        if lanes[rows.KNOWN + j] < 0.5:
            lanes[rows.SEEKS + j] = rows.DONE
            return n
        lanes[rows.SEEKS + j] = rows.DOUBTFUL
        span = lanes[rows.STOP + j] - lanes[rows.S + j]
        n, fired = _pass_stop(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n)
        if fired and circuit.dead_time > 0.0:
            release = lanes[rows.S + j] + circuit.dead_time / length
            lanes[rows.HOLD + j] = ta + release * length
            _seek_given(
                j, rows.RELEASE if release < lanes[rows.END + j] else rows.DONE, release, lanes
            )
            return n
        place = lanes[rows.S + j] + 2.0 * span
        until = min(lanes[rows.END + j], (lanes[rows.NOISE + j] - ta) / length)
        if lanes[rows.KIND + j] == _HALF_WAY and span * length > rows.TOLERANCE and place < until:
            _seek_given(j, rows.HALF, place, lanes)
            return n
