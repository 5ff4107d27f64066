"""Pixels at rest: constant light, no lag left, so that only leak and noise events move anything.

The distance of the signal from the falling reference is a straight line: no place has to be
searched for.
"""

from __future__ import annotations

import numpy as np

from adv2e.jit import allocating_kernel
from adv2e.kernel import screen
from adv2e.kernel.comparator import (
    SIGNAL_EVENT,
    emit,
    injected_polarity,
    next_injected,
    use_up,
)
from adv2e.kernel.exchange import log_of, next_noise, watch
from adv2e.kernel.polynomial import TIE
from adv2e.kernel.tile import with_room
from adv2e.kernel.workspace import S_HOLD, S_OFF, S_ON, S_REFERENCE


@allocating_kernel
def solve_at_rest(
    k, i, start, ta, length, t_base, circuit, state, rows, falls, keys, times, n
):  # fmt: skip
    """Events of one pixel, number k of its strip and i of all, over an interval at rest.

    Leaves the pixel's rows of the screen as they are at the end of the interval.
    """
    light = np.float64(rows[screen.LIGHT_1 + k])
    x, fall = log_of(light, circuit), falls[k]
    on, off = state[S_ON, i] + TIE, state[S_OFF, i] + TIE
    reference = state[S_REFERENCE, i]
    noise = next_noise(i, circuit, state)
    s = 0.0
    while True:
        hold = state[S_HOLD, i]
        if hold >= 0.0:
            s = max(s, (hold - ta) / length)
            if s >= 1.0:
                break
            reference = x + fall * s
            state[S_HOLD, i] = -1.0
        kind, t_end, s_end = SIGNAL_EVENT, ta + length, 1.0
        if noise < ta + length:
            kind, t_end = next_injected(i, ta + s * length, ta + length, circuit, state)
            noise = next_noise(i, circuit, state)
            if kind != SIGNAL_EVENT:
                s_end = max(s, (t_end - ta) / length)
        away = x - reference
        polarity, level = 0, 0.0
        if away + fall * s_end >= on:
            polarity, level = 1, state[S_ON, i]
            s = max(s, min(s_end, (on - away) / fall if fall > 0.0 else 0.0))
        elif away + fall * s <= -off:
            polarity, level = -1, -state[S_OFF, i]
        elif kind == SIGNAL_EVENT:
            break
        else:
            s = s_end
            polarity = injected_polarity(i, kind, light, circuit, state)
            use_up(i, kind, circuit, state)
            noise = next_noise(i, circuit, state)
            if polarity == 0:
                continue
            level = away + fall * s
        when = ta + s * length
        keys, times = with_room(keys, times, n, n + 1)
        n = emit(keys, times, n, when, t_base, i, 1 if polarity > 0 else 0)
        if circuit.dead_time > 0.0:
            state[S_HOLD, i] = when + circuit.dead_time
        else:
            reference += level
    state[S_REFERENCE, i] = reference - fall
    rows[screen.LAG_1 + k] = 0.0
    watch(k, i, x, start, circuit, state, rows)
    return n, keys, times
