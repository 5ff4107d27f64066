"""Statistics of one stream by itself: counts, rates, ON share, inter-event times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.trains import keys, stride_of
from adv2e.events import Events

QUANTILES = (1, 5, 25, 50, 75, 95, 99)
"""Quantiles in use [%]."""
SHORT_US = 1000
"""Limit below which an inter-event time counts as short [us]."""

STATISTICS = {
    "events": "events in the time compared",
    "on_events": "ON events",
    "off_events": "OFF events",
    "rate": "events a pixel a second",
    "on_rate": "ON events a pixel a second",
    "off_rate": "OFF events a pixel a second",
    "on_share": "ON events over all events",
    **{
        f"inter_event_us_{q:02d}": f"{q} % quantile of the time to the next event of the same"
        " pixel, of either polarity [us]"
        for q in QUANTILES
    },
    "inter_event_share_under_1ms": "share of those times below 1 ms",
}
"""Name and definition of each."""


def stream_statistics(
    events: Events, duration_s: float, width: int, height: int
) -> dict[str, float | None]:
    """Return the :data:`STATISTICS` of the events of a time [s], None where there is nothing."""
    count, on = len(events), int(np.count_nonzero(events["p"]))
    exposure = duration_s * width * height
    values: list[float | None] = [
        count,
        on,
        count - on,
        *(n / exposure for n in (count, on, count - on)),
    ]
    values.append(on / count if count else None)
    times = inter_event_times(events, width)
    if len(times):
        values += map(float, np.percentile(times, QUANTILES))
        values.append(float(np.mean(times < SHORT_US)))
    else:  # no pixel fired twice
        values += [None] * (len(QUANTILES) + 1)
    return dict(zip(STATISTICS, values, strict=True))


def inter_event_times(events: Events, width: int) -> NDArray[np.int64]:
    """Return the inter-event times of all pixels [us], in no useful order."""
    start, stride = stride_of(events)
    ordered = np.sort(keys(events, width, start, stride))
    same_pixel = ordered[1:] // stride == ordered[:-1] // stride
    times: NDArray[np.int64] = np.diff(ordered)[same_pixel]
    return times
