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
        self.held: Events | None = None

    def add(self, events: Events, end_us: int) -> Iterator[Events]:
        """Yield the events whose order is final once `events` are in.

        Parameters
        ----------
        events : (n,) array
            Sorted; none before the `end_us` of the last call.
        end_us : int
            No event before this time will come any more [us].
        """
        if self.held is None:
            self.held = events[:0]
        if self.held.size:
            split = count_before(events, int(self.held["t"].max()) + 1)
            border = sort_events(np.concatenate([self.held, events[:split]]))
            keep = count_before(border, end_us)
            self.held = border[keep:]
            if keep:
                yield border[:keep]
            events = events[split:]
        keep = count_before(events, end_us)
        if keep < events.size:
            self.held = np.concatenate([self.held, events[keep:]])
        if keep:
            yield events[:keep]

    def known(self, events: Events, end_us: int) -> Events:
        """Return the events of :meth:`add` in one array."""
        found = list(self.add(events, end_us))
        return found[0] if len(found) == 1 else np.concatenate([events[:0], *found])

    def rest(self) -> Events:
        rest = empty_events() if self.held is None else self.held
        self.held = rest[:0]
        return rest
