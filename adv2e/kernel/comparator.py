"""Comparator of a pixel, for both solvers: tolerance of a crossing, and writing of an event."""

from __future__ import annotations

import math

from adv2e.causes import CAUSE_BITS
from adv2e.compiled import kernel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.leak import begin_leak_cycle
from adv2e.kernel.packing import PIXEL_BITS

TIE = 1e-9
"""A level counts as reached when it is passed by this much [ln units].

A pixel that returns to an earlier brightness approaches levels a whole number of thresholds away
without ever arriving; rounding alone would decide whether it fires.
"""


@kernel
def fire(i, t, polarity, cause, t_base, circuit, state, keys, times, n):
    """Write an event of pixel i at t us, with which a leak cycle begins; returns their number.

    Past the end of the buffer it is only counted.
    """
    state, keys, times = borrowed(state, keys, times)
    if circuit.leak_jitter > 0.0:
        begin_leak_cycle(i, circuit, state)
    if n < keys.shape[0]:
        stamp = math.floor(t + 0.5) - t_base
        key = (stamp << (PIXEL_BITS + 1)) | (i << 1) | (1 if polarity > 0 else 0)
        keys[n] = (key << CAUSE_BITS) | cause if circuit.causes else key
        if n < times.shape[0]:
            times[n] = t
    return n + 1
