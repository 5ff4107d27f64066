"""Events as one train a pixel: sorted by pixel, then time, in a single integer.

``key = pixel * stride + (t - start)`` with a stride beyond the span: events of one pixel are
neighbours, and their keys differ by their time difference [us].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, pixels_of

Keys = NDArray[np.int64]


def stride_of(*streams: Events, reach: int = 0) -> tuple[int, int]:
    """Return start [us] and stride that keep pixels apart by more than `reach` [us]."""
    filled = [events["t"] for events in streams if len(events)]
    if not filled:
        return 0, reach + 1
    start = min(int(t.min()) for t in filled)
    stop = max(int(t.max()) for t in filled)
    return start, stop - start + reach + 1


def keys(events: Events, width: int, start: int, stride: int) -> Keys:
    """Return the key of each event, in the order of `events`."""
    pixel = pixels_of(events, width)
    if len(pixel) and (int(pixel.max()) + 1) * stride > np.iinfo(np.int64).max:
        raise DataError(
            f"events {stride / 1e6:,.6g} s apart, of pixels up to {int(pixel.max()):,}, are too far"
            " from each other to be compared: is a time wrong ('adv2e info' tells gaps)?"
        )
    key: Keys = pixel * stride + (events["t"] - start)
    return key
