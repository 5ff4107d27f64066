"""Stamps of neighbouring events in the stream: what a readout does to them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.markers.base import Entry, Raw, counts, share, stabilised
from adv2e.diagnosis.scene import Placed

TICKS_US = (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)
_GAPS_US = (1, 2, 3, 5, 8, 12, 20, 40, 80, 160)
_NEAR_US = (3, 12, 40, 160)


class Ticks:
    """Shares of stamps that are whole multiples of a time."""

    title = "ticks of the stamps"
    least = 0.001

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(f"stamps on {tick} us", f"share of stamps that are multiples of {tick} us")
            for tick in TICKS_US
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        t = placed.stream.t
        zero = np.zeros(len(t), np.int64)
        columns = [counts(placed.part, zero, 1)]
        columns += [counts(placed.part, zero, 1, (t % tick == 0)) for tick in TICKS_US]
        return np.concatenate(columns, axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        return share(raw[1:], raw[0])


class Gaps:
    """Times between neighbouring events of the whole stream, and how often they share a row."""

    title = "neighbours in the stream"
    least = 0.002

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        gaps = [f"{a}-{b} us" for a, b in zip((0, *_GAPS_US), _GAPS_US, strict=False)]
        gaps.append(f">= {_GAPS_US[-1]} us")
        return [
            *(
                Entry(f"next after {gap}", f"number of events {gap} after any other")
                for gap in gaps
            ),
            *(
                Entry(
                    f"same row within {n} us",
                    f"share of events that are less than {n} us after one of their own row, of"
                    " those so soon after any",
                )
                for n in _NEAR_US
            ),
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream, part = placed.stream, placed.part[1:]
        gap = np.diff(stream.t)
        row = stream.pixel // stream.width
        same = row[1:] == row[:-1]
        columns = [counts(part, np.searchsorted(_GAPS_US, gap, "right"), len(_GAPS_US) + 1)]
        for n in _NEAR_US:
            near = gap < n
            zero = np.zeros(int(near.sum()), np.int64)
            columns.append(counts(part[near], zero, 1))
            columns.append(counts(part[near], zero, 1, same[near]))
        return np.concatenate(columns, axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        gaps, near = raw[: len(_GAPS_US) + 1], raw[len(_GAPS_US) + 1 :]
        return np.concatenate([stabilised(gaps), (near[1::2] + 0.5) / (near[::2] + 1.0)])
