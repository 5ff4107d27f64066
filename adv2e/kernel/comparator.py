"""Events of one pixel on one power series: thresholds, dead time, leak, injected noise.

Row SIGNAL holds the filtered log intensity on s = 0..1, LEAK the fall of the reference since s = 0
at the nominal leak rate, LIGHT the unfiltered light.
"""

from __future__ import annotations

import math

from adv2e.compiled import inlined, kernel
from adv2e.effects.pixel.hot_pixels import next_hot_time
from adv2e.effects.pixel.leak import next_leak_factor
from adv2e.effects.pixel.shot_noise import candidate_polarity, next_candidate_time
from adv2e.kernel.polynomial import at_end, first_crossing, value
from adv2e.kernel.workspace import (
    DISTANCE,
    LEAK,
    LIGHT,
    PIXEL_BITS,
    S_HOLD,
    S_HOT_TIME,
    S_LEAK_FACTOR,
    S_OFF,
    S_ON,
    S_REFERENCE,
    S_SHOT_TIME,
    SIGNAL,
)

SIGNAL_EVENT, SHOT, HOT = 0, 1, 2


@kernel
def emit(keys, times, n, t, t_base, pixel, on):
    """Pack one event; past the end of the buffer it is only counted."""
    if n < keys.shape[0]:
        stamp = math.floor(t + 0.5) - t_base
        keys[n] = (stamp << (PIXEL_BITS + 1)) | (pixel << 1) | on
        if n < times.shape[0]:
            times[n] = t
    return n + 1


@inlined
def next_injected(i, now, t_end, circuit, state):
    """Kind and time of the next noise event of pixel i in [now, t_end); those before are lost."""
    kind, t = SIGNAL_EVENT, t_end
    if circuit.shot_rate > 0.0:
        while state[S_SHOT_TIME, i] < now:
            next_candidate_time(i, circuit, state)
        if state[S_SHOT_TIME, i] < t:
            kind, t = SHOT, state[S_SHOT_TIME, i]
    if circuit.hot_rate > 0.0:
        while state[S_HOT_TIME, i] < now:
            next_hot_time(i, circuit, state)
        if state[S_HOT_TIME, i] < t:
            kind, t = HOT, state[S_HOT_TIME, i]
    return kind, t


@inlined
def injected_polarity(i, kind, light, circuit, state):
    """Return what the noise event of pixel i is: 1, -1, or 0 where the light [DN] thins it out."""
    return 1 if kind == HOT else candidate_polarity(i, light, circuit, state)


@inlined
def use_up(i, kind, circuit, state):
    """Move pixel i on to the noise event after the present one of this kind."""
    if kind == HOT:
        next_hot_time(i, circuit, state)
    else:
        next_candidate_time(i, circuit, state)


@inlined
def events_of_series(
    i, ta, h, order, low, high, monotone, t_base, circuit, state, ws, keys, times, n
):  # fmt: skip
    """Fire the events of pixel i on the series that spans [ta, ta + h] us.

    The signal is known to stay between `low` and `high`, and perhaps to be monotone.  Returns the
    number of events so far.
    The reference kept in the state is the one at ta + h.
    """
    tb = ta + h
    if state[S_HOLD, i] >= tb:
        return n
    jitter = circuit.leak_jitter > 0.0
    leaks = circuit.leak > 0.0 or circuit.photo_leak > 0.0
    injected = circuit.shot_rate > 0.0 or circuit.hot_rate > 0.0
    factor = state[S_LEAK_FACTOR, i] if jitter else 1.0
    reference = state[S_REFERENCE, i]
    fall = 0.0
    if leaks:
        fall = factor * at_end(ws, LEAK, order)
    if (
        not injected
        and state[S_HOLD, i] < 0.0
        and high + fall - reference < state[S_ON, i]
        and reference - low < state[S_OFF, i]
    ):
        state[S_REFERENCE, i] = reference - fall
        return n
    s = 0.0
    if state[S_HOLD, i] >= 0.0:
        s = max(0.0, (state[S_HOLD, i] - ta) / h)
        reference = value(ws, SIGNAL, order, s)
        if leaks:
            reference += factor * value(ws, LEAK, order, s)
        state[S_HOLD, i] = -1.0
    while True:
        kind, t_end, s_end = SIGNAL_EVENT, tb, 1.0
        if injected:
            kind, t_end = next_injected(i, ta + s * h, tb, circuit, state)
            if kind != SIGNAL_EVENT:
                s_end = max(s, (t_end - ta) / h)
        for k in range(order + 1):
            ws[DISTANCE, k] = ws[SIGNAL, k]
        if leaks:
            for k in range(order + 1):
                ws[DISTANCE, k] += factor * ws[LEAK, k]
        ws[DISTANCE, 0] -= reference
        polarity, s_event = first_crossing(
            ws, order, s, s_end, state[S_ON, i], state[S_OFF, i], monotone
        )
        signal_event = polarity != 0
        if not signal_event:
            if kind == SIGNAL_EVENT:
                break
            s_event = s_end
            light = value(ws, LIGHT, order, s_end)
            polarity = injected_polarity(i, kind, light, circuit, state)
            use_up(i, kind, circuit, state)
            if polarity == 0:
                s = s_end
                continue
        t = ta + s_event * h
        n = emit(keys, times, n, t, t_base, i, 1 if polarity > 0 else 0)
        fallen = value(ws, LEAK, order, s_event) if leaks else 0.0
        before = factor
        if jitter:
            factor = next_leak_factor(i, circuit, state)
        s = s_event
        if circuit.dead_time > 0.0:
            hold = t + circuit.dead_time
            if hold >= tb:
                state[S_HOLD, i] = hold
                break
            s = (hold - ta) / h
            reference = value(ws, SIGNAL, order, s)
            if leaks:
                reference += factor * value(ws, LEAK, order, s)
        elif signal_event:
            level = state[S_ON, i] if polarity > 0 else -state[S_OFF, i]
            reference += level + (factor - before) * fallen
        else:
            reference = value(ws, SIGNAL, order, s) + factor * fallen
    if leaks:
        reference -= factor * at_end(ws, LEAK, order)
    state[S_REFERENCE, i] = reference
    return n
