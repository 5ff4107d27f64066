"""Double reads: events that the readout hands on twice.

An ON event is read a second time with the probability given by on, an OFF event with that given
by off; the two readings are 0 or 1 us apart, either as often.  With polarity: same, both are as
the event is.  With polarity: on, one of both is ON, the first or the second as often; the other is
as the event is.  Both have the cause of the event.  The n-th event of a pixel has a draw of its
own.

That a pixel fires twice within a microsecond is nothing that its circuit can do.  Files have it:
8 % of the events of a DVS128, nearly all OFF twice; 3 % of those of an ATIS; .13 % of N-MNIST,
another ATIS, where one of both is always ON.

References
----------
[1] G. Orchard et al., "Converting Static Image Datasets to Spiking Neuromorphic Datasets Using
    Saccades", Frontiers in Neuroscience 9, 2015, doi:10.3389/fnins.2015.00437 (N-MNIST).
[2] "14% of events in GEN1 .dat files are duplicates", an ATIS once more,
    https://github.com/prophesee-ai/prophesee-automotive-dataset-toolbox/issues/44.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adv2e.effects.hooks import Hooks, View
from adv2e.effects.reorder_buffer import InOrder
from adv2e.events import Events, pixels_of, sort_events
from adv2e.kernel import rng
from adv2e.parameters import Fit, Section, parameter

LABELS = {"double_read": "events that are read twice"}
SEPARATED_BY = {"double_read": "none needed: events of one pixel have one time stamp"}


@dataclass(frozen=True, kw_only=True)
class DoubleRead(Section):
    """Events read twice."""

    on: float = parameter(
        unit="-",
        meaning="probability that an ON event is read twice",
        at_least=0,
        at_most=1,
        fit=Fit(0.0, 0.5, 0.01),
    )
    off: float = parameter(
        unit="-",
        meaning="probability that an OFF event is read twice",
        at_least=0,
        at_most=1,
        fit=Fit(0.0, 0.5, 0.01),
    )
    polarity: str = parameter(
        "same",
        unit="-",
        meaning="same: both readings are as the event is; on: one of both is ON",
        choices=("same", "on"),
    )


class DoubleReadHooks(Hooks):
    """Adds the second readings."""

    stage = "readout"
    Parameters = DoubleRead

    def begin(self, view: View) -> None:
        super().begin(view)
        self._numbers = np.zeros(view.rows * view.columns, np.int64)
        self._order = InOrder()

    def events_now(self, events: Events) -> Events:
        if not events.size:
            return events
        pixels = pixels_of(events, self.view.columns)
        drawn = rng.next_uniforms(self.view.seed, rng.DOUBLE_READ, pixels, self._numbers)
        share = np.where(events["p"] > 0, self.parameters.on, self.parameters.off)
        twice = drawn < share
        # what is drawn below the share is as even as what is drawn at all
        quarter = np.floor(4.0 * drawn[twice] / share[twice]).astype(np.int64)
        both, second = events.copy(), events[twice]
        second["t"] += quarter % 2
        if self.parameters.polarity == "on":
            is_first = quarter >= 2
            second["p"] = np.where(is_first, second["p"], 1)
            both["p"][np.flatnonzero(twice)[is_first]] = 1
        last = int(events["t"][-1])
        return self._order.known(sort_events(np.concatenate([both, second])), last)

    def events_left(self) -> Events:
        """Return the events of the last microsecond, which waited for second readings."""
        return self._order.rest()
