"""Times between neighbouring events of one pixel, and runs of one polarity."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import STILL, Placed
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.statistics.base import POLARITIES, Entry, Numbers, Raw, counts

BORDERS_MS = (
    *(0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0),
    *(48.0, 64.0, 96.0, 128.0, 192.0, 256.0),
)
_REST_MS = (1.0, 4.0, 16.0, 64.0, 256.0)
_PAIRS = ("OFF-OFF", "ON-OFF", "OFF-ON", "ON-ON")


def _bins_text(borders: Sequence[float]) -> list[str]:
    low = [0.0, *borders]
    return [f"{a:g}-{b:g} ms" for a, b in zip(low, borders, strict=False)] + [
        f"> {borders[-1]:g} ms"
    ]


class Intervals(Numbers):
    """Histogram of the time since the pixel's event before, by the pair of polarities."""

    title = "time between events of a pixel"
    least = 0.6

    def __init__(self, *, at_rest: bool = False) -> None:
        self._at_rest = at_rest
        borders = _REST_MS if at_rest else BORDERS_MS
        borders_us = np.round(np.array(borders) * 1e3).astype(np.int64)
        self._longest_us = borders_us[-1]
        self._bin_of = np.searchsorted(borders_us, np.arange(self._longest_us + 1), "right")
        self._texts = _bins_text(borders)

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        where = " at rest" if self._at_rest else ""
        return [
            Entry(
                f"{pair} after {text}{where}",
                f"number of events{where} that follow the one before in their pixel after {text},"
                f" {pair.replace('-', ' then ')}",
                is_number=True,
            )
            for text in self._texts
            for pair in _PAIRS
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream = placed.stream
        used = stream.since >= 0
        if self._at_rest:
            used &= placed.speed == STILL
        gap = self._bin_of[np.minimum(stream.since[used], self._longest_us)]
        cell = gap * 4 + stream.on[used] * 2 + stream.on_before[used]
        return counts(placed.part[used], cell, len(self._texts) * 4)


class Runs(Numbers):
    """How far into a run of one polarity events are: what a reset changes from event to event."""

    title = "runs of one polarity"
    least = 0.6

    _LONGEST_GAP_US = 50_000
    _PLACES = ("1st", "2nd", "3rd", "4th", "5th-6th", "7th-9th", "10th or later")
    _PLACE_OF = np.array([0, 1, 2, 3, 4, 4, 5, 5, 5, 6])

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"{place} {p} event of a run",
                f"number of {p} events that are the {place} of a run without the other polarity"
                " and without a gap of 50 ms",
                is_number=True,
            )
            for place in self._PLACES
            for p in POLARITIES
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream = placed.stream
        place = self._PLACE_OF[np.minimum(_place_in_run(stream, self._LONGEST_GAP_US), 9)]
        return counts(placed.part, place * 2 + stream.on, len(self._PLACES) * 2)


def _place_in_run(stream: Stream, longest_gap_us: int) -> NDArray[np.int64]:
    order = stream.by_pixel
    gap, on, before = stream.since[order], stream.on[order], stream.on_before[order]
    begins = (gap < 0) | (gap > longest_gap_us) | (on != before)
    index = np.arange(len(order))
    start = np.maximum.accumulate(np.where(begins, index, 0))
    place = np.empty_like(index)
    place[order] = index - start
    return place
