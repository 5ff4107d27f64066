"""Times between events of one pixel and of its neighbours, and runs of one polarity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adv2e.diagnosis.data.scene import STILL, Placed
from adv2e.diagnosis.statistics.counting import since_neighbours
from adv2e.diagnosis.statistics.groups import POLARITIES, Array, Group, counts, numbers

BORDERS_MS = (
    *(0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0),
    *(48.0, 64.0, 96.0, 128.0, 192.0, 256.0),
)
_REST_MS = (1.0, 4.0, 16.0, 64.0, 256.0)
_NEIGHBOURS_MS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
_PAIRS = ("OFF-OFF", "ON-OFF", "OFF-ON", "ON-ON")

_LONGEST_GAP_US = 50_000
_PLACES = ("1st", "2nd", "3rd", "4th", "5th-6th", "7th-9th", "10th or later")
_PLACE_OF = np.array([0, 1, 2, 3, 4, 4, 5, 5, 5, 6])


def _bins_text(borders_ms: Sequence[float]) -> list[str]:
    low = [0.0, *borders_ms]
    bins = [f"{a:g}-{b:g} ms" for a, b in zip(low, borders_ms, strict=False)]
    return [*bins, f"> {borders_ms[-1]:g} ms"]


def intervals(*, at_rest: bool = False) -> Group:
    """Return the histogram of the time since the pixel's event before, by both polarities."""
    borders_ms, where = (_REST_MS, " at rest") if at_rest else (BORDERS_MS, "")
    borders_us = np.round(np.array(borders_ms) * 1e3).astype(np.int64)
    longest_us = borders_us[-1]
    bin_of = np.searchsorted(borders_us, np.arange(longest_us + 1), "right")
    entries = numbers(
        (
            (
                f"{pair} after {text}{where}",
                f"pairs of events of a pixel{where}, {text} apart, {pair.replace('-', ' then ')}",
            )
            for text in _bins_text(borders_ms)
            for pair in _PAIRS
        ),
        "pairs",
    )

    def count(placed: Placed) -> Array:
        stream = placed.stream
        used = stream.since >= 0
        if at_rest:
            used &= placed.speed == STILL
        gap = bin_of[np.minimum(stream.since[used], longest_us)]
        cell = gap * 4 + stream.on[used] * 2 + stream.on_before[used]
        return counts(placed.part[used], cell, len(entries))

    return Group("time between events of a pixel", 0.6, entries, count, kind="time")


def runs() -> Group:
    """Return numbers of events by their place in a run of one polarity, which resets change."""
    entries = numbers(
        (
            f"{place} {p} event of a run",
            f"{p} events that are the {place} of their polarity in a row, without a gap of 50 ms",
        )
        for place in _PLACES
        for p in POLARITIES
    )

    def count(placed: Placed) -> Array:
        stream = placed.stream
        gap, on = stream.since, stream.on
        begins = (gap < 0) | (gap > _LONGEST_GAP_US) | (on != stream.on_before)
        order, index = stream.by_pixel, np.arange(len(stream))
        start = np.maximum.accumulate(np.where(begins[order], index, 0))
        place = _PLACE_OF[np.minimum(index - start, 9)]
        return counts(placed.part[order], place * 2 + on[order], len(entries))

    return Group("runs of one polarity", 0.6, entries, count, kind="time")


def neighbours() -> Group:
    """Return the histogram of the time since an event of a neighbouring pixel."""
    entries = numbers(
        (
            f"{text} after a neighbour's {kind}",
            f"events {text} after the last event of the {kind} polarity in the four pixels beside",
        )
        for kind in ("other", "same")
        for text in _bins_text(_NEIGHBOURS_MS)
    )
    borders_us = np.round(np.array(_NEIGHBOURS_MS) * 1e3).astype(np.int64)
    bins = len(borders_us) + 1

    def count(placed: Placed) -> Array:
        stream = placed.stream
        since = np.empty((len(stream), 2), np.int64)
        last = np.full((stream.width * stream.height, 2), -(1 << 60), np.int64)
        since_neighbours(stream.t, stream.pixel, stream.on, stream.width, last, since)
        cell = np.searchsorted(borders_us, since, "right")
        return np.concatenate([counts(placed.part, one, bins) for one in cell.T], axis=1)

    return Group("neighbouring pixels", 0.6, entries, count, kind="time")
