"""The pixels of a strip that may fire, one a lane, from event to event through one interval.

A lane goes from place to place: the next threshold, the turn of the signal where it may cross a
threshold before turning, the end of a dead time, the next noise event, and at last the end of the
interval.  In each round all lanes look for one place each (:mod:`adv2e.kernel.lanes`) and then
decide what comes next.  Between two places the signal is monotone, or it turns where it cannot
cross, so the distance at both tells whether a threshold is crossed, and that it is crossed once.

The usual decisions are taken for all lanes together, without branches (`_plan`, `_land`); turns,
noise events and whatever leak makes doubtful are decided lane by lane (`_go_on`).  What does not
fit at all is left to :mod:`adv2e.kernel.solve` from where the lane is: the knee of the log map
within the interval, steps above an e-fold, a falling signal that leak may outrun, and the rare
place that does not come out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.jit import inlined, kernel
from adv2e.kernel import lanes as places
from adv2e.kernel import special
from adv2e.kernel.comparator import (
    HOT,
    SHOT,
    SIGNAL_EVENT,
    emit,
    injected_polarity,
    next_injected,
    use_up,
)
from adv2e.kernel.lanes import (
    AWAY_P,
    AWAY_S,
    DX,
    ERROR,
    EVENT,
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
    HOLD,
    I0,
    I1,
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
    ROOT,
    SEEKS,
    STOP,
    SUM_E,
    TAIL,
    TOLERANCE,
    TRIED,
    U0,
    U1,
    WHEN,
    WIDTH,
    X0,
    S,
)
from adv2e.kernel.polynomial import TIE
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
    S_LAG,
    S_OFF,
    S_ON,
    S_REFERENCE,
    S_SHOT_TIME,
    STRIP,
)

_TRIES = 4
_STRAIGHT = 0.9
_BEFORE_END = 1.0 - 2.0**-53
_EARLY = 1.0 - 1e-6  # single precision must not make a due time late
_NO_TIME = 1e300

# what a lane is looking for; ready: to be decided; doubtful: to be decided lane by lane
_DONE, _ALONE, _ON, _OFF, _TURN, _INJECTED, _RELEASE, _READY, _DOUBTFUL = (
    float(code) for code in range(9)
)


def pixel_numbers() -> NDArray[np.int64]:
    """Return room for the numbers, within the strip, of the lanes' pixels."""
    return np.zeros(STRIP + WIDTH, np.int64)


@kernel
def log_of(light, circuit):
    """Log intensity of light [DN] as loaded."""
    safe = light if light > 1e-30 else 1e-30
    x = special.log(safe)
    if circuit.slope > 0.0:
        x = x if light >= circuit.slope * circuit.knee else light / circuit.slope
    return x


@kernel
def _next_noise(i, circuit, state):
    """When the next noise event of pixel i may come [us]."""
    due = _NO_TIME
    if circuit.shot_rate > 0.0:
        due = min(due, state[S_SHOT_TIME, i])
    if circuit.hot_rate > 0.0:
        due = min(due, state[S_HOT_TIME, i])
    return due


@kernel
def watch(k, i, x1, start, circuit, state, rows):
    """Rows of the screen for pixel k of a strip, i of the state: distance, thresholds, due time."""
    rows[AWAY_1 + k] = x1 - state[S_REFERENCE, i]
    hold = state[S_HOLD, i]
    if hold >= 0.0:
        rows[SCREEN_ON + k] = NEVER
        rows[SCREEN_OFF + k] = NEVER
        rows[DUE + k] = (hold - start) * _EARLY
    else:
        rows[SCREEN_ON + k] = state[S_ON, i] - MARGIN
        rows[SCREEN_OFF + k] = state[S_OFF, i] - MARGIN
        rows[DUE + k] = min(_next_noise(i, circuit, state) - start, NEVER) * _EARLY


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
            i = lo + pixels[j]
            shot = state[S_SHOT_TIME, i] if circuit.shot_rate > 0.0 else _NO_TIME
            hot = state[S_HOT_TIME, i] if circuit.hot_rate > 0.0 else _NO_TIME
            lanes[NOISE + j] = min(shot, hot)
            lanes[KIND + j] = HOT if hot < shot else SHOT
    else:
        for j in range(m):
            lanes[NOISE + j] = _NO_TIME


@kernel
def load(lo, m, ta, length, circuit, state, rows, falls, pixels, lanes):
    """Put the m flagged pixels in lanes, at the start of their interval."""
    _gather(lo, m, circuit, state, rows, falls, pixels, lanes)
    knee_dn = circuit.slope * circuit.knee
    leak, photo_leak = length * circuit.leak, length * circuit.photo_leak
    for j in range(places.whole(m)):
        i0, i1 = lanes[I0 + j], lanes[I1 + j]
        u0, u1 = lanes[U0 + j], lanes[U1 + j]
        x0 = log_of(i0, circuit)
        x1 = log_of(i1, circuit)
        dx = x1 - x0
        lanes[X0 + j] = x0
        lanes[DX + j] = dx
        lanes[LOG + j] = 1.0 if min(i0, i1) >= knee_dn else 0.0
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
        hold = lanes[HOLD + j]
        held = hold >= 0.0
        release = (hold - ta) / length
        injected = (lanes[NOISE + j] - ta) / length
        seeks = _INJECTED if injected < 1.0 else _READY
        seeks = _RELEASE if held else seeks
        seeks = _DONE if held & (release >= 1.0) else seeks
        mixed = (i0 < knee_dn) != (i1 < knee_dn)
        far = (abs(dx) > LARGEST_STEP) | (i1 > LARGEST_LIGHT)
        seeks = _ALONE if mixed | far | (circuit.leak_jitter > 0.0) else seeks
        lanes[SEEKS + j] = seeks
        place = release if held else min(injected, _BEFORE_END)
        lanes[PLACE + j] = place if place > 0.0 else 0.0
        lanes[FRESH + j] = 0.0
        lanes[MOVES + j] = 0.0


@kernel
def _plan(count, t_end, length, circuit, lanes):
    """Choose the threshold that comes first for the lanes that are ready, or tell the doubtful."""
    dark, per_dn = circuit.dark * length, circuit.per_dn * length
    for j in range(count):
        seeks = lanes[SEEKS + j]
        ready = seeks == _READY
        on, off = lanes[ON + j] + TIE, lanes[OFF + j] + TIE
        away_s, away_p = lanes[AWAY_S + j], lanes[AWAY_P + j]
        lag_s, lag_p = lanes[LAG_S + j], lanes[LAG_P + j]
        drift = lanes[FALLEN_P + j] - lanes[FALLEN_S + j]
        light_s, light_p = lanes[LIGHT_S + j], lanes[LIGHT_P + j]
        fall, fall_dn = lanes[FALL + j], lanes[FALL_DN + j]
        rate_s, rate_p = dark + per_dn * light_s, dark + per_dn * light_p
        dx = lanes[DX + j]
        leak = 1.01 * (fall + fall_dn * max(light_s, light_p))
        sure = _sure_of_leak(away_s, away_p, lag_s, lag_p, drift, dx, rate_s, rate_p, leak, on, off)
        doubtful = (
            (lag_s * lag_p < 0.0)
            | (lanes[NOISE + j] < t_end)
            | (lanes[KNOWN + j] > 0.5)
            | (away_s >= on)
            | (away_s <= -off)
            | ((drift > 0.0) & (lag_s + lag_p > 0.0) & (not sure))
        )
        what = _ON if away_p >= on else (_OFF if away_p <= -off else _DONE)
        what = _DOUBTFUL if doubtful else what
        what = what if ready else seeks
        lanes[SEEKS + j] = what
        crosses = ready & ((what == _ON) | (what == _OFF))
        level = on if away_p >= on else -off
        goal = lanes[REFERENCE + j] - lanes[X0 + j] + level
        lanes[GOAL + j] = goal if crosses else lanes[GOAL + j]
        lanes[F_LO + j] = away_s - level
        lanes[F_HI + j] = away_p - level
        lanes[G_LO + j] = fall + fall_dn * light_s - rate_s * lag_s
        lanes[G_HI + j] = fall + fall_dn * light_p - rate_p * lag_p
        lanes[ROOT + j] = 1.0 if crosses else lanes[ROOT + j]
        lanes[FRESH + j] = 1.0 if crosses else lanes[FRESH + j]
        lanes[MOVES + j] = 1.0 if crosses else lanes[MOVES + j]
        lanes[TRIED + j] = 0.0 if crosses else lanes[TRIED + j]


@kernel
def _land(count, ta, length, circuit, lanes, only_released):
    """Take thresholds and ends of dead times that were found; other places are left as they are."""
    dead = circuit.dead_time / length
    has_dead_time = circuit.dead_time > 0.0
    for j in range(count):
        seeks = lanes[SEEKS + j]
        found = (lanes[MOVES + j] < 0.5) | (lanes[ERROR + j] <= TOLERANCE)
        tried = lanes[TRIED + j] + (0.0 if only_released else 1.0)
        lanes[TRIED + j] = tried
        failed = _ALONE if tried >= _TRIES else seeks
        crossed = found & ((seeks == _ON) | (seeks == _OFF)) & (not only_released)
        released = seeks == _RELEASE
        place = lanes[PLACE + j]
        fallen = lanes[FALL + j] * place + lanes[FALL_DN + j] * lanes[SUM_E + j]
        x = lanes[X0 + j] + lanes[DX + j] * place
        sign = 1.0 if seeks == _ON else -1.0
        lanes[EVENT + j] = sign if crossed else 0.0
        lanes[WHEN + j] = ta + place * length
        # a crossing without dead time goes on from there, with the reference moved by the threshold
        goes_on = crossed & (not has_dead_time)
        waits = crossed & has_dead_time
        level = lanes[ON + j] if seeks == _ON else -lanes[OFF + j]
        arrives = goes_on | released
        lag_e = lanes[LAG_E + j]
        lag = lanes[GOAL + j] - lanes[DX + j] * place - fallen if crossed else lag_e
        away = x + lag_e + fallen - lanes[REFERENCE + j]
        reference = lanes[REFERENCE + j] + (level if goes_on else (away if released else 0.0))
        lanes[REFERENCE + j] = reference
        lanes[S + j] = place if arrives else lanes[S + j]
        lanes[LAG_S + j] = lag if arrives else lanes[LAG_S + j]
        lanes[LIGHT_S + j] = lanes[LIGHT_E + j] if arrives else lanes[LIGHT_S + j]
        lanes[FALLEN_S + j] = fallen if arrives else lanes[FALLEN_S + j]
        away_s = sign * TIE if goes_on else 0.0
        lanes[AWAY_S + j] = away_s if arrives else lanes[AWAY_S + j]
        # after a dead time the next known place is the end of the interval again
        lanes[STOP + j] = 1.0 if released else lanes[STOP + j]
        lanes[KNOWN + j] = 0.0 if released else lanes[KNOWN + j]
        lanes[LAG_P + j] = lanes[U1 + j] if released else lanes[LAG_P + j]
        lanes[LIGHT_P + j] = lanes[I1 + j] if released else lanes[LIGHT_P + j]
        lanes[FALLEN_P + j] = lanes[TAIL + j] if released else lanes[FALLEN_P + j]
        end = lanes[X0 + j] + lanes[DX + j] + lanes[U1 + j] + lanes[TAIL + j] - reference
        away_p = lanes[AWAY_P + j] - (level if goes_on else 0.0)
        lanes[AWAY_P + j] = end if released else away_p
        release = place + dead
        beyond = waits & (release >= 1.0)
        hold = ta + release * length if waits else lanes[HOLD + j]
        lanes[HOLD + j] = -1.0 if released else hold
        lanes[PLACE + j] = release if waits else place
        lanes[FRESH + j] = 0.0
        lanes[MOVES + j] = 0.0 if waits else lanes[MOVES + j]
        after = _READY if arrives else (_RELEASE if waits else seeks)
        after = _DONE if beyond else after
        lanes[SEEKS + j] = after if found | only_released else failed


@kernel
def _emit_found(lo, m, t_base, pixels, lanes, keys, times, n):
    """Write the events of the thresholds that were found."""
    for j in range(m):
        event = lanes[EVENT + j]
        if event != 0.0:
            on = 1 if event > 0.0 else 0
            n = emit(keys, times, n, lanes[WHEN + j], t_base, lo + pixels[j], on)
    return n


@kernel
def _seek_given(j, what, place, lanes):
    """Look at a given place next."""
    lanes[SEEKS + j] = what
    lanes[PLACE + j] = place
    lanes[FRESH + j] = 0.0
    lanes[MOVES + j] = 0.0


@kernel
def _seek_root(j, what, length, circuit, lanes):
    """Look for a threshold, or for the turn, between S and STOP next."""
    turn = what == _TURN
    level = lanes[ON + j] + TIE if what == _ON else -lanes[OFF + j] - TIE
    drift = -lanes[DX + j] if turn else 0.0
    root = 0.0 if turn else 1.0
    lanes[SEEKS + j] = what
    lanes[TRIED + j] = 0.0
    lanes[FRESH + j] = 1.0
    lanes[MOVES + j] = 1.0
    lanes[ROOT + j] = root
    lanes[GOAL + j] = 0.0 if turn else lanes[REFERENCE + j] - lanes[X0 + j] + level
    lanes[F_LO + j] = lanes[LAG_S + j] if turn else lanes[AWAY_S + j] - level
    lanes[F_HI + j] = lanes[LAG_P + j] if turn else lanes[AWAY_P + j] - level
    # the slope of the lag is -w u - dx, that of the distance -w u plus the leak
    rate_s = (circuit.dark + circuit.per_dn * lanes[LIGHT_S + j]) * length
    rate_p = (circuit.dark + circuit.per_dn * lanes[LIGHT_P + j]) * length
    leak_s = root * (lanes[FALL + j] + lanes[FALL_DN + j] * lanes[LIGHT_S + j])
    leak_p = root * (lanes[FALL + j] + lanes[FALL_DN + j] * lanes[LIGHT_P + j])
    lanes[G_LO + j] = drift - rate_s * lanes[LAG_S + j] + leak_s
    lanes[G_HI + j] = drift - rate_p * lanes[LAG_P + j] + leak_p


@kernel
def _sure_of_leak(away_s, away_p, lag_s, lag_p, drift, dx, rate_s, rate_p, leak, on, off):
    """Tell whether a falling signal crosses just what the distances at S and STOP say.

    Its distance from the falling reference moves by leak - z, z = w u being the fall of the signal.

    * Where z stays above the leak, the distance is monotone.  While u keeps its sign, it gets
      no smaller than at the ends or, where x runs away from y, than |dx/ds| / w.
    * dz/ds = w (p - z (1 + q)) with p = -dx/ds and q = |dw/ds| / w^2, which is at most p / w where
      x falls.  So where p exceeds the leak by the share q, z passes the leak only upwards: the
      distance rises at first, if at all.
    * Where x rises or rests, dz/ds <= z (dx/ds - w) - w dx/ds: with w > dx/ds, z only falls, and
      the distance rises at last, if at all.  Then it may only dip below the lower level and return.

    The first and the last two lines hold for all three: far from both levels nothing is crossed.
    """
    slowest = min(rate_s, rate_p)
    least = min(abs(lag_s), abs(lag_p))
    follows = -dx / (max(rate_s, rate_p) + 1e-300) if dx < 0.0 else least
    outruns = slowest * min(least, follows) > leak
    driven = -dx > leak * (1.0 - dx / (slowest + 1e-300))
    settling = (dx >= 0.0) & (slowest > dx)
    may_rise = away_s + drift >= on
    may_dip = away_p - drift <= -off
    dips = may_dip & (away_p > -off)
    return (
        outruns
        | (driven & (not may_rise))
        | (settling & (not dips))
        | ((not may_rise) & (not may_dip))
    )


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
    """Tell what comes first between S and STOP: _ON, _OFF, _TURN, _DONE (nothing) or _ALONE."""
    on, off = lanes[ON + j] + TIE, lanes[OFF + j] + TIE
    away_s, away_p = lanes[AWAY_S + j], lanes[AWAY_P + j]
    lag_s, lag_p = lanes[LAG_S + j], lanes[LAG_P + j]
    drift = lanes[FALLEN_P + j] - lanes[FALLEN_S + j]
    rate_s = (circuit.dark + circuit.per_dn * lanes[LIGHT_S + j]) * length
    rate_p = (circuit.dark + circuit.per_dn * lanes[LIGHT_P + j]) * length
    light = max(lanes[LIGHT_S + j], lanes[LIGHT_P + j])
    leak = 1.01 * (lanes[FALL + j] + lanes[FALL_DN + j] * light)
    dx = lanes[DX + j]
    if away_s >= on or away_s <= -off:
        return _ALONE
    if lag_s * lag_p < 0.0:
        reach = away_s + _moves_before_turn(j, length, circuit, lanes)
        if lag_s > 0.0:  # falls, then rises
            if reach <= -off:
                return _TURN
            if away_s + drift >= on:
                return _ALONE
            return _ON if away_p >= on else _DONE
        if reach + drift >= on:
            return _TURN
        # rises, then falls: what holds from the turn on, where u = 0, decides
        sure = drift == 0.0 or _sure_of_leak(
            on - 2.0 * drift, away_p, 0.0, lag_p, drift, dx, rate_s, rate_p, leak, on, off
        )
        if not sure:
            return _ALONE
        return _OFF if away_p <= -off else _DONE
    falls = drift > 0.0 and lag_s + lag_p > 0.0
    if falls and not _sure_of_leak(
        away_s, away_p, lag_s, lag_p, drift, dx, rate_s, rate_p, leak, on, off
    ):
        return _ALONE
    if away_p >= on:
        return _ON
    return _OFF if away_p <= -off else _DONE


@kernel
def _set_stop(j, place, lag, light, fallen, lanes):
    """Set the next known place, and the signal there."""
    lanes[STOP + j] = place
    lanes[LAG_P + j] = lag
    lanes[LIGHT_P + j] = light
    lanes[FALLEN_P + j] = fallen
    x = lanes[X0 + j] + lanes[DX + j] * place
    lanes[AWAY_P + j] = x + lag + fallen - lanes[REFERENCE + j]


@inlined
def _found_stop(j, lanes):
    """Make the turn, or the time of a noise event, that was looked at the next known place."""
    seeks = lanes[SEEKS + j]
    place = lanes[PLACE + j]
    fallen = lanes[FALL + j] * place + lanes[FALL_DN + j] * lanes[SUM_E + j]
    lag = lanes[LAG_E + j]
    if seeks == _TURN:
        lag = 0.0
        lanes[KIND + j] = SIGNAL_EVENT
    _set_stop(j, place, lag, lanes[LIGHT_E + j], fallen, lanes)
    lanes[KNOWN + j] = 1.0
    lanes[SEEKS + j] = _DOUBTFUL


@inlined
def _find_stop(i, j, ta, length, circuit, state, lanes):
    """Set STOP to the end of the interval; tells whether a noise event comes before it."""
    if lanes[NOISE + j] < ta + length:
        now = ta + lanes[S + j] * length
        kind, t = next_injected(i, now, ta + length, circuit, state)
        lanes[NOISE + j] = _next_noise(i, circuit, state)
        if kind != SIGNAL_EVENT:
            lanes[KIND + j] = kind
            place = min(max((t - ta) / length, lanes[S + j]), _BEFORE_END)
            _seek_given(j, _INJECTED, place, lanes)
            return True
    _set_stop(j, 1.0, lanes[U1 + j], lanes[I1 + j], lanes[TAIL + j], lanes)
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
    if kind == SIGNAL_EVENT:  # a turn
        return n, False
    polarity = injected_polarity(i, kind, lanes[LIGHT_S + j], circuit, state)
    use_up(i, kind, circuit, state)
    lanes[NOISE + j] = _next_noise(i, circuit, state)
    if polarity == 0:
        return n, False
    when = ta + lanes[S + j] * length
    n = emit(keys, times, n, when, t_base, i, 1 if polarity > 0 else 0)
    lanes[REFERENCE + j] += lanes[AWAY_S + j]
    lanes[AWAY_S + j] = 0.0
    return n, True


@inlined
def _go_on(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n):
    """Decide what a doubtful lane looks for next.  Returns the number of events."""
    while True:
        if lanes[KNOWN + j] < 0.5 and _find_stop(i, j, ta, length, circuit, state, lanes):
            return n
        what = _choose(j, length, circuit, lanes)
        if what == _ALONE:
            lanes[SEEKS + j] = _ALONE
            return n
        if what != _DONE:
            _seek_root(j, what, length, circuit, lanes)
            return n
        if lanes[KNOWN + j] < 0.5:
            lanes[SEEKS + j] = _DONE
            return n
        n, fired = _pass_stop(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n)
        if fired and circuit.dead_time > 0.0:
            release = lanes[S + j] + circuit.dead_time / length
            lanes[HOLD + j] = ta + release * length
            _seek_given(j, _RELEASE if release < 1.0 else _DONE, release, lanes)
            return n


@kernel
def _finish(j, lo, start, state, rows, pixels, lanes):
    """Write back the state of a lane at the end of its interval."""
    k = pixels[j]
    reference = lanes[REFERENCE + j] - lanes[TAIL + j]
    hold = lanes[HOLD + j]
    state[S_REFERENCE, lo + k] = reference
    state[S_HOLD, lo + k] = hold
    rows[AWAY_1 + k] = lanes[X0 + j] + lanes[DX + j] - reference
    held = hold >= 0.0
    rows[SCREEN_ON + k] = NEVER if held else lanes[ON + j] - MARGIN
    rows[SCREEN_OFF + k] = NEVER if held else lanes[OFF + j] - MARGIN
    due = hold if held else lanes[NOISE + j]
    rows[DUE + k] = min(due - start, NEVER) * _EARLY


@kernel
def _leave(j, lo, state, pixels, lanes, alone, count):
    """Hand a lane on to be solved by itself: its pixel, where it is, and x there."""
    k = pixels[j]
    i = lo + k
    state[S_LAG, i] = lanes[LAG_S + j]
    state[S_REFERENCE, i] = lanes[REFERENCE + j] - lanes[FALLEN_S + j]
    state[S_HOLD, i] = lanes[HOLD + j]
    alone[0, count] = k
    alone[1, count] = lanes[S + j]
    alone[2, count] = lanes[X0 + j] + lanes[DX + j] * lanes[S + j]
    return count + 1


@kernel
def _stays(j, give_up, lanes):
    """Tell whether a lane looks for something."""
    seeks = lanes[SEEKS + j]
    return seeks != _DONE and seeks != _ALONE and not give_up


@kernel
def _take_out(j, lo, start, state, rows, pixels, lanes, alone, left_alone):
    """Write back a lane that is done, or hand it on; returns how many are alone."""
    if lanes[SEEKS + j] == _DONE:
        _finish(j, lo, start, state, rows, pixels, lanes)
        return left_alone
    return _leave(j, lo, state, pixels, lanes, alone, left_alone)


@kernel
def _sort_out(lo, m, give_up, start, state, rows, pixels, lanes, alone, left_alone):
    """Take out the lanes that are done or left alone; returns how many stay, how many are alone."""
    j = 0
    while j < m:
        if _stays(j, give_up, lanes):
            j += 1
            continue
        left_alone = _take_out(j, lo, start, state, rows, pixels, lanes, alone, left_alone)
        # lanes that stay fill the gaps from behind, so that few have to move
        m -= 1
        while m > j and not _stays(m, give_up, lanes):
            left_alone = _take_out(m, lo, start, state, rows, pixels, lanes, alone, left_alone)
            m -= 1
        if m > j:
            places.move(lanes, m, j)
            pixels[j] = pixels[m]
            j += 1
    return m, left_alone


@kernel
def decide(
    lo, m, give_up, start, ta, length, t_base, circuit, state, rows, pixels, lanes, alone,
    left_alone, keys, times, n,
):  # fmt: skip
    """Decide what each of m lanes looks for next.

    Returns (lanes that look for something, pixels left alone so far, events so far); at most one
    event a lane is written.  With `give_up`, no lane goes on.
    """
    _plan(places.whole(m), ta + length, length, circuit, lanes)
    for j in range(m):
        if lanes[SEEKS + j] == _DOUBTFUL:
            i = lo + pixels[j]
            n = _go_on(i, j, ta, length, t_base, circuit, state, lanes, keys, times, n)
    m, left_alone = _sort_out(lo, m, give_up, start, state, rows, pixels, lanes, alone, left_alone)
    return m, left_alone, n


@kernel
def search(lo, m, ta, length, t_base, circuit, nodes, weights, pixels, lanes, keys, times, n):
    """Every lane finds one place.  Returns the number of events; at most one a lane is written."""
    count = places.whole(m)
    places.guess(lanes, count)
    places.evaluate(lanes, count, length, circuit, nodes, weights)
    places.refine(lanes, count, length, circuit)
    _land(count, ta, length, circuit, lanes, False)
    n = _emit_found(lo, m, t_base, pixels, lanes, keys, times, n)
    waiting = 0
    for j in range(m):
        seeks = lanes[SEEKS + j]
        if seeks == _INJECTED or (seeks == _TURN and lanes[ERROR + j] <= TOLERANCE):
            _found_stop(j, lanes)
        waiting += seeks == _RELEASE
    if 2 * waiting > m:
        # most have just fired: see them through their dead time at once
        places.evaluate(lanes, count, length, circuit, nodes, weights)
        _land(count, ta, length, circuit, lanes, True)
    return n
