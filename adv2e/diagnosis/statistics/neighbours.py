"""How soon after an event of a neighbouring pixel events come."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from adv2e.diagnosis.data.scene import Placed
from adv2e.diagnosis.statistics.base import Entry, Numbers, Raw, counts
from adv2e.diagnosis.statistics.counting import since_neighbours

_BORDERS_US = (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)


class Neighbours(Numbers):
    """Histogram of the time since an event of a neighbouring pixel."""

    title = "neighbouring pixels"
    least = 0.6

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        low = (0, *_BORDERS_US)
        texts = [f"{a / 1e3:g}-{b / 1e3:g} ms" for a, b in zip(low, _BORDERS_US, strict=False)]
        texts.append(f"> {_BORDERS_US[-1] / 1e3:g} ms")
        return [
            Entry(
                f"{text} after a neighbour's {kind}",
                f"number of events {text} after the latest event of {kind} polarity in the four"
                " neighbouring pixels",
                is_number=True,
            )
            for kind in ("other", "same")
            for text in texts
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream = placed.stream
        since = np.empty((len(stream), 2), np.int64)
        last = np.full((stream.width * stream.height, 2), -(1 << 60), np.int64)
        since_neighbours(stream.t, stream.pixel, stream.on, stream.width, last, since)
        cells = len(_BORDERS_US) + 1
        return np.concatenate(
            [
                counts(placed.part, np.searchsorted(_BORDERS_US, since[:, same], "right"), cells)
                for same in range(2)
            ],
            axis=1,
        )
