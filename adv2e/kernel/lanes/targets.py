"""Targets of lanes: what follows from one that was found, and the choice of the next."""

from __future__ import annotations

from adv2e.compiled import inlined, kernel
from adv2e.kernel import per_pixel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.comparator import TIE, cause_by_leak, fire, note_reset
from adv2e.kernel.lanes import rows
from adv2e.kernel.lanes.roots import BEFORE_END, evaluate_release, fallen_at_place, set_stop
from adv2e.kernel.noise import NONE, next_noise, noise_within, take_noise

# ---- Apply a crossing: emit the event, reset the reference, end refractory periods.


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


# ---- Next crossing of all lanes together, without branches.
#
# Between two known places the signal is monotone, or it has its extremum where it cannot cross. So
# the distance at both places tells whether a threshold is crossed, and that it is crossed once.
# Extrema, noise events and crossings that leak may cause are left to what follows.


# ---- Next target of one lane (scalar): extremum, noise event, or a crossing that leak may cause.
#
# Where leak may be faster than a falling signal, or a search has failed, the lane evaluates the
# signal half-way to the next known place, and decides up to there; by halves down to `TOLERANCE`,
# if it must.  From a place so passed it goes on by twice the step.


_STRAIGHT = 0.9
_HALF_WAY = -1


@kernel
def _seek_given(j, what, place, lanes):
    """Set the next target of lane j to a given place."""
    lanes[rows.SEEKS + j] = what
    lanes[rows.PLACE + j] = place
    lanes[rows.MOVES + j] = 0.0


@kernel
def _seek_root(j, what, length, lanes):
    """Set the next target of lane j to a crossing, or to the extremum, between S and STOP.

    A place at S, and one up to a STOP that is near, is known without a search.
    """
    away, on, off = lanes[rows.AWAY_S + j], lanes[rows.ON + j] + TIE, lanes[rows.OFF + j] + TIE
    beyond = (what == rows.SEEK_ON and away >= on) or (what == rows.SEEK_OFF and away <= -off)
    near = (lanes[rows.STOP + j] - lanes[rows.S + j]) * length <= rows.TOLERANCE
    _seek_given(j, what, lanes[rows.S + j] if beyond else lanes[rows.STOP + j], lanes)
    lanes[rows.MOVES + j] = 0.0 if beyond or near else 1.0


@kernel
def _moves_before_turn(j, length, circuit, lanes):
    """Largest change of the signal before its extremum, signed; see the screen's bound."""
    lag, dx = lanes[rows.LAG_S + j], lanes[rows.DX + j]
    if lanes[rows.LOG + j] < 0.5 or abs(lag) >= _STRAIGHT:
        return -lag
    rate = (circuit.dark + circuit.per_dn * lanes[rows.LIGHT_S + j]) * length
    meet = abs(lag) / (rate * abs(lag) + abs(dx))
    return dx * min(meet, 1.0) - lag


@inlined
def _choose(j, length, circuit, lanes):
    """Return the first target between S and STOP: a threshold, TURN, DONE (none), or HALF."""
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
            -per_pixel.NEVER, away_p, 0.0, lag_p, span, dx, rate_s, rate_p, leak, on, off
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
    """Make the place that was evaluated (extremum, half-way or noise event) the next STOP."""
    seeks = lanes[rows.SEEKS + j]
    lanes[rows.KIND + j] = NONE
    if seeks == rows.INJECTED:
        lanes[rows.KIND + j] = next_noise(i, circuit, state)[0]
    elif seeks == rows.HALF:
        lanes[rows.KIND + j] = _HALF_WAY
    lag = 0.0 if seeks == rows.TURN else lanes[rows.LAG_E + j]
    set_stop(
        j, lanes[rows.PLACE + j], lag, lanes[rows.LIGHT_E + j], fallen_at_place(j, lanes), lanes
    )
    lanes[rows.KNOWN + j] = 1.0
    lanes[rows.SEEKS + j] = rows.DOUBTFUL


@inlined
def _find_stop(i, j, interval, circuit, state, lanes):
    """Set STOP to the end of the piece; returns whether a noise event comes before it."""
    ta, length = interval.start, interval.length
    end = lanes[rows.END + j]
    t_end = ta + end * length
    if lanes[rows.NOISE + j] < t_end:
        now = ta + lanes[rows.S + j] * length
        kind, t = noise_within(i, now, t_end, circuit, state)
        lanes[rows.NOISE + j] = next_noise(i, circuit, state)[1]
        if kind != NONE:
            place = min(max((t - ta) / length, lanes[rows.S + j]), end * BEFORE_END)
            _seek_given(j, rows.INJECTED, place, lanes)
            return True
    set_stop(j, end, lanes[rows.U1 + j], lanes[rows.I1 + j], lanes[rows.TAIL + j], lanes)
    return False


@inlined
def _pass_stop(i, j, interval, circuit, state, lanes, buffer, n):
    """Move to STOP, before which there is no crossing, and fire a noise event that is due there.

    Returns the number of events, and whether there was one.
    """
    lanes[rows.KNOWN + j] = 0.0
    lanes[rows.S + j] = lanes[rows.STOP + j]
    lanes[rows.LAG_S + j] = lanes[rows.LAG_P + j]
    lanes[rows.LIGHT_S + j] = lanes[rows.LIGHT_P + j]
    lanes[rows.FALLEN_S + j] = lanes[rows.FALLEN_P + j]
    lanes[rows.AWAY_S + j] = lanes[rows.AWAY_P + j]
    kind = int(lanes[rows.KIND + j])
    if kind in (NONE, _HALF_WAY):
        return n, False
    polarity = take_noise(i, kind, lanes[rows.LIGHT_S + j], circuit, state)
    lanes[rows.NOISE + j] = next_noise(i, circuit, state)[1]
    if polarity == 0:
        return n, False
    when = interval.start + lanes[rows.S + j] * interval.length
    n = fire_lane(i, j, when, polarity, kind, circuit, state, lanes, buffer, n)
    lanes[rows.REFERENCE + j] += lanes[rows.AWAY_S + j]
    lanes[rows.AWAY_S + j] = 0.0
    note_reset(i, lanes[rows.REFERENCE + j] - lanes[rows.FALLEN_S + j], circuit, state)
    return n, True


@inlined
def go_on(i, j, interval, circuit, state, lanes, buffer, n):
    """Choose the next target of a DOUBTFUL lane.  Returns the number of events."""
    ta, length = interval.start, interval.length
    while True:
        if lanes[rows.KNOWN + j] < 0.5 and _find_stop(i, j, interval, circuit, state, lanes):
            return n
        what = _choose(j, length, circuit, lanes)
        if what == rows.HALF:
            _seek_given(j, rows.HALF, 0.5 * (lanes[rows.S + j] + lanes[rows.STOP + j]), lanes)
            return n
        if what != rows.DONE:
            _seek_root(j, what, length, lanes)
            return n
        if lanes[rows.KNOWN + j] < 0.5:
            lanes[rows.SEEKS + j] = rows.DONE
            return n
        lanes[rows.SEEKS + j] = rows.DOUBTFUL
        span = lanes[rows.STOP + j] - lanes[rows.S + j]
        n, fired = _pass_stop(i, j, interval, circuit, state, lanes, buffer, n)
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


@kernel
def sure_of_leak(away_s, away_p, lag_s, lag_p, span, dx, rate_s, rate_p, leak, on, off):
    """Tell whether the distances at S and STOP show all crossings of a falling signal.

    Its distance from the falling reference moves by leak - z, z = w u being the fall of the signal.

    * Where z stays above the leak, the distance is monotone.  While u keeps its sign, it gets
      no smaller than at the ends or, where x runs away from y, than |dx/ds| / w.  What the leak
      exceeds that least z by, times the span, is the most that the distance can rise.
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
    rise = span * (leak - slowest * min(least, follows))
    driven = (dx < 0.0) & (-dx > leak * (1.0 - dx / (slowest + 1e-300)))
    settling = (dx >= 0.0) & (slowest > dx)
    may_rise = away_s + rise >= on
    may_dip = away_p - rise <= -off
    dips = may_dip & (away_p > -off)
    return (
        (rise < 0.0)
        | (driven & (not may_rise))
        | (settling & (not dips))
        | ((not may_rise) & (not may_dip))
    )


@kernel
def choose(count, interval, circuit, lanes):
    """Choose the first threshold crossing of lanes that are READY, or mark them DOUBTFUL."""
    ta, length = interval.start, interval.length
    dark, per_dn = circuit.dark * length, circuit.per_dn * length
    for j in range(count):
        seeks = lanes[rows.SEEKS + j]
        ready = seeks == rows.READY
        on, off = lanes[rows.ON + j] + TIE, lanes[rows.OFF + j] + TIE
        away_s, away_p = lanes[rows.AWAY_S + j], lanes[rows.AWAY_P + j]
        lag_s, lag_p = lanes[rows.LAG_S + j], lanes[rows.LAG_P + j]
        span = lanes[rows.STOP + j] - lanes[rows.S + j]
        light_s, light_p = lanes[rows.LIGHT_S + j], lanes[rows.LIGHT_P + j]
        rate_s, rate_p = dark + per_dn * light_s, dark + per_dn * light_p
        dx = lanes[rows.DX + j]
        leak = 1.01 * (lanes[rows.FALL + j] + lanes[rows.FALL_DN + j] * max(light_s, light_p))
        sure = sure_of_leak(away_s, away_p, lag_s, lag_p, span, dx, rate_s, rate_p, leak, on, off)
        doubtful = (
            (lag_s * lag_p < 0.0)
            | (lanes[rows.NOISE + j] < ta + lanes[rows.END + j] * length)
            | (lanes[rows.KNOWN + j] > 0.5)
            | (away_s >= on)
            | (away_s <= -off)
            | ((leak > 0.0) & (lag_s + lag_p > 0.0) & (not sure))
        )
        what = rows.SEEK_ON if away_p >= on else (rows.SEEK_OFF if away_p <= -off else rows.DONE)
        what = rows.DOUBTFUL if doubtful else what
        what = what if ready else seeks
        lanes[rows.SEEKS + j] = what
        crosses = ready & ((what == rows.SEEK_ON) | (what == rows.SEEK_OFF))
        lanes[rows.MOVES + j] = 1.0 if crosses else lanes[rows.MOVES + j]
