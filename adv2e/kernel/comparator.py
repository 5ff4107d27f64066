"""Comparator of a pixel: tolerance of a crossing, writing of an event, its cause, and memory."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSE_BITS, LEAK, PHOTORECEPTOR_NOISE, SIGNAL
from adv2e.compiled import kernel
from adv2e.kernel import per_pixel
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
    if circuit.leak_jitter > 0.0:
        begin_leak_cycle(i, circuit, state)
    if n < buffer.keys.shape[0]:
        stamp = math.floor(t + 0.5) - buffer.t_base
        key = (stamp << (PIXEL_BITS + 1)) | (i << 1) | (1 if polarity > 0 else 0)
        buffer.keys[n] = (key << CAUSE_BITS) | cause if circuit.causes else key
        if n < buffer.times.shape[0]:
            buffer.times[n] = t
    return n + 1


# ---- Cause of an event: the part that moved signal or reference most since the last reset.
#
# At a reset the reference becomes the signal, which is the sum of three parts: light,
# photoreceptor noise, and additions by effects. From there on each part moves by itself, and leak
# lowers the reference. ``docs/own_effects.md`` has the rule in full.


@kernel
def cause_by_leak(i, polarity, reference, circuit, state):
    """Return SIGNAL or LEAK for a crossing of pixel i where there is no other cause.

    reference : before the event
    """
    if not circuit.causes or polarity < 0.0:
        return SIGNAL
    leak = state[per_pixel.RESET, i] - reference
    return LEAK if leak > state[per_pixel.ON, i] - leak else SIGNAL


@kernel
def note_reset(i, reference, circuit, state):
    """Keep the reference that pixel i has after an event; in the dead time there is none."""
    if circuit.causes:
        state[per_pixel.RESET, i] = reference if circuit.dead_time == 0.0 else per_pixel.NEVER


@kernel
def cause_by_most(i, polarity, reference, light, noise, added, circuit, state):
    """Return the cause of a crossing of pixel i: the part that moved most in its direction.

    reference : before the event
    light, noise, added : the parts of the signal there
    """
    cause, most = SIGNAL, polarity * (light - state[per_pixel.RESET_LIGHT, i])
    leak = polarity * (state[per_pixel.RESET, i] - reference)
    if leak > most:
        cause, most = LEAK, leak
    by_noise = polarity * (noise - state[per_pixel.RESET_NOISE, i])
    if by_noise > most:
        cause, most = PHOTORECEPTOR_NOISE, by_noise
    by_added = polarity * (added - state[per_pixel.RESET_ADDED, i])
    if by_added > most:
        cause = circuit.added
    return cause


@kernel
def note_parts(i, reference, light, noise, added, state):
    """Keep the reference that pixel i takes, and the parts of the signal there."""
    state[per_pixel.RESET, i] = reference
    state[per_pixel.RESET_LIGHT, i] = light
    state[per_pixel.RESET_NOISE, i] = noise
    state[per_pixel.RESET_ADDED, i] = added
