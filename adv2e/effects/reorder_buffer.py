"""Reorder buffer: sorts events that come nearly in the order of time."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator

import numpy as np

from adv2e.events import Events, empty_events, sort_events


def count_before(events: Events, t_us: int) -> int:
    # NumPy's search would copy the column
    return bisect_left(range(events.size), t_us, key=lambda k: int(events["t"][k]))


class InOrder:
    """Hands events on in order; events at and after the time up to which all are known wait."""

    def __init__(self) -> None:
        self._held: Events | None = None

    def add(self, events: Events, end_us: int) -> Iterator[Events]:
        """Yield the events whose order is final once `events` are in.

        Parameters
        ----------
        events : (n,) array
            Sorted; none before the `end_us` of the last call.
        end_us : int
            No event before this time will come any more [us].
        """
        if self._held is None:
            self._held = events[:0]
        if self._held.size:
            split = count_before(events, int(self._held["t"].max()) + 1)
            border = sort_events(np.concatenate([self._held, events[:split]]))
            keep = count_before(border, end_us)
            self._held = border[keep:]
            if keep:
                yield border[:keep]
            events = events[split:]
        keep = count_before(events, end_us)
        if keep < events.size:
            self._held = np.concatenate([self._held, events[keep:]])
        if keep:
            yield events[:keep]

    def rest(self) -> Events:
        rest = empty_events() if self._held is None else self._held
        self._held = rest[:0]
        return rest
