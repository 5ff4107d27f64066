"""Inter-event times: from an event to the next of the same pixel, whatever its polarity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.trains import keys, stride_of
from adv2e.events import Events

QUANTILES = (1, 5, 25, 50, 75, 95, 99)
"""Quantiles in use [%]."""
SHORT_US = 1000
"""What counts as a short inter-event time [us]."""


def inter_event_times(events: Events, width: int) -> NDArray[np.int64]:
    """Return the inter-event times of all pixels [us], in no useful order.

    Parameters
    ----------
    events : Events
        Sorted or not.
    width : int
        Columns of the sensor.
    """
    start, stride = stride_of(events)
    ordered = np.sort(keys(events, width, start, stride))
    same_pixel = ordered[1:] // stride == ordered[:-1] // stride
    times: NDArray[np.int64] = np.diff(ordered)[same_pixel]
    return times


def interval_statistics(events: Events, width: int) -> dict[str, float | None]:
    """Return quantiles [us] and the share below 1 ms; None where no pixel fired twice."""
    times = inter_event_times(events, width)
    names = [f"inter_event_us_{q:02d}" for q in QUANTILES]
    if not len(times):
        return dict.fromkeys([*names, "inter_event_share_under_1ms"], None)
    values = dict(zip(names, map(float, np.percentile(times, QUANTILES)), strict=True))
    return {**values, "inter_event_share_under_1ms": float(np.mean(times < SHORT_US))}
