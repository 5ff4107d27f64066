"""Arbiter: events wait for their row to be read out.

One channel serves the rows one after another.  When it is free it takes the row that has waited
longest.  It needs row_ns to select the row, latches all requests that the row then has, and sends
them out from left to right, one each event_ns.  Events are stamped as they leave.

A pixel whose event still waits cannot ask again: its further events are lost.  So the readout
saturates, at columns / (row_ns + columns event_ns) events a nanosecond and below.  The pixel does
not know that it waits: its dead time runs from the event.

Events come in whole microseconds, services do not.  When within its own microsecond an event asks
is drawn, for the n-th event of a pixel.  If all asked on the microsecond, all would be rounded
alike as they leave (with 4.5 us in all, to even numbers), and of those that ask together the
uppermost row would always be first.

References
----------
[1] K. A. Boahen, "Point-to-point connectivity between neuromorphic chips using address events",
    IEEE TCAS II 47(5), 2000, doi:10.1109/82.842110.
[2] C. Brandli, R. Berner, M. Yang, S.-C. Liu, T. Delbruck, "A 240 x 180 130 dB 3 us Latency Global
    Shutter Spatiotemporal Vision Sensor", IEEE JSSC 49(10), 2014, doi:10.1109/JSSC.2014.2342715 (12
    million events a second).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adv2e.causes import has_causes, with_cause
from adv2e.effects.hooks import Hooks, View
from adv2e.effects.reorder_buffer import InOrder
from adv2e.events import Events, make_events, pixels_of, sort_events
from adv2e.kernel import rng
from adv2e.kernel.effect_loops import EVENTS, NOBODY, Channel, Requests, serve
from adv2e.parameters import Fit, Section, parameter

LABELS = {"readout": "time that the readout takes"}
SEPARATED_BY = {
    "readout": "strong motion of the whole picture: delays grow with the rate of all pixels, and"
    " events come row by row"
}


@dataclass(frozen=True, kw_only=True)
class Arbiter(Section):
    """One channel for the events of all rows."""

    event_ns: float = parameter(
        unit="ns",
        meaning="time that an event takes",
        at_least=0,
        source="Brandli et al.: 83 ns (12 million events a second)",
        fit=Fit(1.0, 1e6, 300.0, log=True),
        label="an event",
    )
    row_ns: float = parameter(
        unit="ns",
        meaning="time that the selection of a row takes",
        at_least=0,
        fit=Fit(1.0, 1e7, 3000.0, log=True),
        label="a row",
    )


class ArbiterHooks(Hooks):
    """Sends the events through one channel."""

    stage = "readout"
    Parameters = Arbiter

    def begin(self, view: View) -> None:
        super().begin(view)
        pixels = view.rows * view.columns
        self._channel = Channel(
            record=np.array([-np.inf, 0.0, 0.0, 0.0]),
            queue=np.empty(view.rows, np.int64),
            asked=np.full(view.rows, -np.inf),
            waiting=np.full(pixels, NOBODY, np.int8),
            left=np.full(pixels, -np.inf),
        )
        self._numbers = np.zeros(pixels, np.int64)
        # counted from the first frame: an epoch time would lose nanoseconds in rounding
        self._origin_us = round(view.start_s * 1e6)
        self._asking, self._order = InOrder(), InOrder()

    def events_now(self, events: Events) -> Events:
        """Return the events that have left the channel."""
        if not events.size:
            return events
        # those of the last microsecond wait for others of it, which may ask before them
        whole = self._asking.known(events, int(events["t"][-1]))
        if not whole.size:
            return whole
        served = self._served(whole, float(whole["t"][-1] - self._origin_us) + 0.5)
        if not served.size:
            return served
        return self._order.known(sort_events(served), int(served["t"][-1]))

    def events_left(self) -> Events:
        """Return the events that still waited."""
        served = self._served(self._asking.rest(), np.inf)
        return self._order.known(sort_events(served), _FAR_US)

    def _served(self, events: Events, known_us: float) -> Events:
        """Return the events that leave the channel before `known_us`, in that order."""
        most = events.size + int(self._channel.record[EVENTS])
        served = Requests(np.empty(most), np.empty(most, np.int64), np.empty(most, np.int8))
        row_us, event_us = self.parameters.row_ns * 1e-3, self.parameters.event_ns * 1e-3
        count = serve(
            self._requests(events), known_us, row_us, event_us, self.view.columns, self._channel,
            served,
        )  # fmt: skip
        stamps = np.rint(served.time[:count]).astype(np.int64) + self._origin_us
        y, x = np.divmod(served.pixel[:count], self.view.columns)
        sent = make_events(stamps, x, y, served.polarity[:count] & 1)
        return with_cause(sent, served.polarity[:count] >> 1) if has_causes(events) else sent

    def _requests(self, events: Events) -> Requests:
        """Return the events in the order of their requests; above the polarity is the cause."""
        pixels = pixels_of(events, self.view.columns)
        drawn = rng.next_uniforms(self.view.seed, rng.REQUEST, pixels, self._numbers)
        asking_us = (events["t"] - self._origin_us) + (drawn - 0.5)
        order = np.argsort(asking_us, kind="stable")
        what = events["p"].astype(np.int8)
        if has_causes(events):
            what |= events["cause"].astype(np.int8) << 1
        return Requests(asking_us[order], pixels[order], what[order])


_FAR_US = np.iinfo(np.int64).max
"""Later than any event."""
