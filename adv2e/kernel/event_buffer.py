"""Arrays of events that grow while compiled code fills them."""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel


@kernel
def with_room(keys, times, used, needed):
    """Return the two arrays of events, longer where they cannot hold `needed`.

    Parameters
    ----------
    keys : (n,) int64
        Packed events.
    times : (n,) float64
        Their unrounded times [us]; (0,) where they are not kept.
    used, needed : int
        Entries that are filled, and that there must be.
    """
    if needed > keys.shape[0]:
        entries = 2 * keys.shape[0] + needed
        if times.shape[0] > 0:
            times = _grown(times, used, entries)
        keys = _grown(keys, used, entries)
    return keys, times


@kernel
def _grown(array, used, entries):
    new = np.empty(entries, array.dtype)
    for entry in range(used):  # a slice would compile the text of an error of shapes, 6 s long
        new[entry] = array[entry]
    return new
