"""What both solvers share of a pixel's comparator: ties, noise events, packed events."""

from __future__ import annotations

import math

from adv2e.compiled import inlined, kernel
from adv2e.kernel.noise import candidate_polarity, next_candidate_time, next_hot_time
from adv2e.kernel.workspace import PIXEL_BITS, S_HOT_TIME, S_SHOT_TIME

SIGNAL_EVENT, SHOT, HOT = 0, 1, 2

TIE = 1e-9
"""A level counts as reached when it is passed by this much [ln units].

A pixel that returns to an earlier brightness approaches levels a whole number of thresholds away
without ever arriving; rounding alone would decide whether it fires.
"""


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
