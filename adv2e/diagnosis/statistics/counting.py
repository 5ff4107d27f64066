"""Sums over the events of a stream, compiled: they run beside simulations without the lock.

Arguments in common: time [us], pixel, polarity and part of each event; `times`, (frames,) [us];
`lags`, (lags,) [us]; `slope`, (pixels, frames - 1), all of a pixel side by side, as the lags of an
event lie close to one another; `at`, (lags,) zeros, room for where in `times` each lag is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from adv2e.compiled import kernel


@kernel
def _interval(t: int, lag: float, times: Any, k: int) -> int:
    """Return the frame interval that lies `lag` before a time [us], the k-th or a later one."""
    while k < times.shape[0] - 2 and t >= times[k + 1] + lag:
        k += 1
    return k


@kernel
def sum_slopes(
    t: Any, pixel: Any, on: Any, cell: Any, times: Any, lags: Any, slope: Any, at: Any, sums: Any
) -> None:
    """Add up the change of light some time before each event, in the event's direction.

    `cell`: (events,) column of `sums`, (lags, cells), that the event counts for.
    """
    for i in range(t.shape[0]):
        n, c = pixel[i], cell[i]
        sign = 1.0 if on[i] else -1.0
        for j in range(lags.shape[0]):
            k = _interval(t[i], lags[j], times, at[j])
            at[j] = k
            sums[j, c] += sign * slope[n, k]


@kernel
def sum_slopes_beside(
    t: Any,
    pixel: Any,
    on: Any,
    part: Any,
    width: int,
    height: int,
    times: Any,
    lags: Any,
    slope: Any,
    at: Any,
    sums: Any,
) -> None:
    """Add up the change of light right of each event less that left of it, and below less above.

    `sums`: (2 lags, parts), right and below in turn.  Events of the border do not count.
    """
    for i in range(t.shape[0]):
        n = pixel[i]
        x, y = n % width, n // width
        inside = x > 0 and y > 0 and x < width - 1 and y < height - 1
        sign = 1.0 if on[i] else -1.0
        for j in range(lags.shape[0]):
            k = _interval(t[i], lags[j], times, at[j])
            at[j] = k
            if inside:
                sums[2 * j, part[i]] += sign * (slope[n + 1, k] - slope[n - 1, k])
                sums[2 * j + 1, part[i]] += sign * (slope[n + width, k] - slope[n - width, k])


@kernel
def count_gaps(
    t: Any, pixel: Any, part: Any, width: int, borders: Any, near: Any, gaps: Any, rows: Any
) -> None:
    """Count the times between neighbouring events of the stream.

    `borders` of the `gaps` counted, (parts, gaps), and the largest gap that is `near`, (kinds,)
    [us]; `rows`, (parts, kinds, 2): how many are close, and how many of those share a row.
    """
    for i in range(1, t.shape[0]):
        gap = t[i] - t[i - 1]
        k = np.int64(0)
        while k < borders.shape[0] and gap >= borders[k]:
            k += 1
        gaps[part[i], k] += 1.0
        if gap < near[near.shape[0] - 1]:
            same = pixel[i] // width == pixel[i - 1] // width
            for m in range(near.shape[0]):
                if gap < near[m]:
                    rows[part[i], m, 0] += 1.0
                    if same:
                        rows[part[i], m, 1] += 1.0


@kernel
def since_neighbours(t: Any, pixel: Any, on: Any, width: int, last: Any, since: Any) -> None:
    """Compute the time since the latest event of the four neighbouring pixels, into `since`.

    `last`, (pixels, 2): time of the latest event of each pixel and polarity [us], long ago at
    first; `since`, (events, 2): time since an event of the other, and of the same, polarity [us].
    """
    pixels = last.shape[0]
    for k in range(t.shape[0]):
        i = pixel[k]
        column = i % width
        for same in range(2):
            p = on[k] if same else 1 - on[k]
            latest = np.int64(-(1 << 60))
            if column > 0:
                latest = max(latest, last[i - 1, p])
            if column < width - 1:
                latest = max(latest, last[i + 1, p])
            if i >= width:
                latest = max(latest, last[i - width, p])
            if i + width < pixels:
                latest = max(latest, last[i + width, p])
            since[k, same] = t[k] - latest
        last[i, on[k]] = t[k]
