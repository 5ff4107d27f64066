"""Timestamp tick: the clock that stamps the events is coarser than a microsecond.

    t' = q ceil(t/q)

q           readout.tick_us

An event gets the next tick, never an earlier one.  With q = 0 the microseconds stay as they are.
Ticks are multiples of q since time zero of the camera's clock, rounded to microseconds.

References
----------
[1] E. Mueggler, H. Rebecq, G. Gallego, T. Delbruck, D. Scaramuzza, "The Event-Camera Dataset and
    Simulator", IJRR 36(2), 2017, doi:10.1177/0278364917691115 (stamps as drivers and messages give
    them).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, View
from adv2e.effects.reorder_buffer import InOrder
from adv2e.events import Events, sort_events

LABELS = {"timestamp_tick": "tick of the time stamps"}
SEPARATED_BY = {"timestamp_tick": "none needed: all times are multiples of the tick"}


def ticked(times_us: NDArray[np.int64], tick_us: float) -> NDArray[np.int64]:
    if float(tick_us).is_integer():
        tick = int(tick_us)
        return -(-times_us // tick) * tick
    ticks = np.ceil(times_us / tick_us - 1e-9)
    return np.rint(ticks * tick_us).astype(np.int64)


class TimestampTickHooks(Hooks):
    """Stamps events with ticks of `tick_us`."""

    stage = "readout"

    def __init__(self, tick_us: float) -> None:
        super().__init__()
        self._tick_us = tick_us

    def begin(self, view: View) -> None:
        super().begin(view)
        self._order = InOrder()

    def events_now(self, events: Events) -> Events:
        """Return the events at their ticks; those of the last tick wait for others of it."""
        if not events.size:
            return events
        stamped = events.copy()
        stamped["t"] = ticked(events["t"], self._tick_us)
        return self._order.known(sort_events(stamped), int(stamped["t"][-1]))

    def events_left(self) -> Events:
        """Return the events of the last tick."""
        return self._order.rest()
