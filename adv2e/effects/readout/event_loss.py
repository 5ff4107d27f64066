"""Event loss: events that the readout drops at random.

Each event is lost with the probability given by fraction, whatever happens to the others.  This is
the simplest model of full buffers between sensor and computer.  The n-th event of a pixel has a
draw of its own.

References
----------
[1] G. Gallego et al., "Event-based Vision: A Survey", IEEE TPAMI 44(1), 2022, arXiv:1904.08405
    (bandwidth of the readout).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adv2e.effects.hooks import Hooks, View
from adv2e.events import Events, pixels_of
from adv2e.kernel import rng
from adv2e.parameters import Fit, Section, parameter

LABELS = {"event_loss": "lost events"}
SEPARATED_BY = {
    "event_loss": "motion of a small and of a large part of the picture: a share that is lost"
    " everywhere does not depend on the rate"
}


@dataclass(frozen=True, kw_only=True)
class EventLoss(Section):
    """Events lost at random."""

    fraction: float = parameter(
        unit="-",
        meaning="probability with which an event is lost",
        at_least=0,
        at_most=1,
        fit=Fit(1e-3, 0.95, 0.2, starts=(0.05, 0.2, 0.45)),
    )


class EventLossHooks(Hooks):
    """Drops events."""

    stage = "readout"
    Parameters = EventLoss

    def begin(self, view: View) -> None:
        super().begin(view)
        self._numbers = np.zeros(view.rows * view.columns, np.int64)

    def events_now(self, events: Events) -> Events:
        pixels = pixels_of(events, self.view.columns)
        drawn = rng.next_uniforms(self.view.seed, rng.LOSS, pixels, self._numbers)
        kept: Events = events[drawn >= self.parameters.fraction]
        return kept
