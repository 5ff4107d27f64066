"""Stamps of neighbouring events in the stream: what a readout does to them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis import parts
from adv2e.diagnosis.markers.base import Entry, Raw, counts, share, stabilised
from adv2e.diagnosis.markers.counting import count_gaps
from adv2e.diagnosis.scene import Placed

TICKS_US = (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)
_ON_TICK = np.array([[t % tick == 0 for tick in TICKS_US] for t in range(TICKS_US[-1])], float)
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
        # all ticks divide the largest one
        rest = placed.stream.t % TICKS_US[-1]
        number = counts(placed.part, rest, TICKS_US[-1])
        return np.concatenate([number.sum(axis=1)[:, None], number @ _ON_TICK], axis=1)

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
                Entry(
                    f"next after {gap}", f"number of events {gap} after any other", is_number=True
                )
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
        stream = placed.stream
        gaps = np.zeros((parts.COUNT, len(_GAPS_US) + 1))
        rows = np.zeros((parts.COUNT, len(_NEAR_US), 2))
        count_gaps(
            stream.t, stream.pixel, placed.part, stream.width,
            np.array(_GAPS_US), np.array(_NEAR_US), gaps, rows,
        )  # fmt: skip
        return np.concatenate([gaps, rows.reshape(parts.COUNT, -1)], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        gaps, near = raw[: len(_GAPS_US) + 1], raw[len(_GAPS_US) + 1 :]
        return np.concatenate([stabilised(gaps), (near[1::2] + 0.5) / (near[::2] + 1.0)])
