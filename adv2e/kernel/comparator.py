"""Comparator of a pixel: tolerance of a crossing, writing of an event, and memory for events."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSE_BITS
from adv2e.compiled import kernel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.leak import begin_leak_cycle
from adv2e.kernel.packing import PIXEL_BITS


class EventBuffer(NamedTuple):
    """Memory for events, which grows while compiled code fills it."""

    keys: NDArray[np.int64]  # (n,): packed events
    times: NDArray[np.float64]  # (n,): their unrounded times [us]; (0,) where they are not kept
    t_base: int  # from which packed times count [us]


@kernel
def with_room(buffer, used, needed):
    """Return the buffer, longer where it cannot hold `needed` events; `used` of it are filled."""
    keys, times = buffer.keys, buffer.times
    if needed > keys.shape[0]:
        entries = 2 * keys.shape[0] + needed
        if times.shape[0] > 0:
            times = _grown(times, used, entries)
        keys = _grown(keys, used, entries)
    return EventBuffer(keys, times, buffer.t_base)


@kernel
def _grown(array, used, entries):
    new = np.empty(entries, array.dtype)
    for entry in range(used):  # a slice would compile the text of an error of shapes, 6 s long
        new[entry] = array[entry]
    return new


TIE = 1e-9
"""A level counts as reached when it is passed by this much [ln units].

A pixel that returns to an earlier brightness approaches levels a whole number of thresholds away
without ever arriving; rounding alone would decide whether it fires.
"""


@kernel
def fire(i, t, polarity, cause, circuit, state, buffer, n):
    """Write an event of pixel i at t us, with which a leak cycle begins; returns their number.

    Past the end of the buffer it is only counted.
    """
    state, buffer = borrowed(state, buffer)
    keys, times = buffer.keys, buffer.times
    if circuit.leak_jitter > 0.0:
        begin_leak_cycle(i, circuit, state)
    if n < keys.shape[0]:
        stamp = math.floor(t + 0.5) - buffer.t_base
        key = (stamp << (PIXEL_BITS + 1)) | (i << 1) | (1 if polarity > 0 else 0)
        keys[n] = (key << CAUSE_BITS) | cause if circuit.causes else key
        if n < times.shape[0]:
            times[n] = t
    return n + 1
