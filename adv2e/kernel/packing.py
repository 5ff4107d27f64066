"""Packed events into order: parted by time tile by tile, then sorted and unpacked slice by slice.

A packed event is one whole number: time since a base [us], pixel, polarity, from the highest bit
down.  Sorting the numbers sorts the events by (t, y, x); those of one pixel and time are then put
as they happened (:mod:`adv2e.pixel.merge`).
"""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel

PIXEL_BITS = 27
"""Bits of the flat pixel index in a packed event."""

SLICES = 64
"""Equal parts of a call's time, so that events can be sorted in several threads."""

_PIXEL = (1 << PIXEL_BITS) - 1


def pack_limit_us() -> int:
    """Longest time span of packed events [us]."""
    return 1 << (63 - PIXEL_BITS - 1)


@kernel
def _slice_of(key, per_us):
    """Slice of a packed event; never decreases with time."""
    part = int(np.float64(key >> (PIXEL_BITS + 1)) * per_us)
    return part if part < SLICES else SLICES - 1


@kernel
def part_by_time(keys, count, per_us, ends, parted):
    """Part `count` packed events into SLICES slices of 1/per_us us each.

    `parted` receives them slice by slice, ends[s + 1] (SLICES + 1,) where slice s ends.
    """
    for s in range(SLICES + 1):
        ends[s] = 0
    for k in range(count):
        s = _slice_of(keys[k], per_us)
        ends[s + 1] += 1
    for s in range(SLICES):
        ends[s + 1] += ends[s]
    for k in range(count):
        s = _slice_of(keys[k], per_us)
        parted[ends[s]] = keys[k]
        ends[s] += 1
    # each entry now is where its slice ends, that is, one place too early
    for s in range(SLICES, 0, -1):
        ends[s] = ends[s - 1]
    ends[0] = 0


@kernel
def unpack(keys, columns, t0, events):
    """Fill `events` with what the sorted numbers stand for; t0: time of their base [us]."""
    for k in range(keys.shape[0]):
        key = keys[k]
        pixel = np.uint32((key >> 1) & _PIXEL)
        row = np.uint32(pixel // np.uint32(columns))
        event = events[k]
        event["t"] = (key >> (PIXEL_BITS + 1)) + t0
        event["x"] = np.uint32(pixel - np.uint32(row * np.uint32(columns)))
        event["y"] = row
        event["p"] = key & 1
