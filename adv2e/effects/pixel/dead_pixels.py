"""Dead pixels: a few pixels never fire.

Each pixel is dead with the probability given by fraction, drawn once from seed and pixel.  Nothing
comes from it, whatever its light.  Events of a dead pixel do not reach the readout.

References
----------
[1] EMVA Standard 1288, release 4.0, 2021, https://www.emva.org/standards-technology/emva-1288
    (defect pixels).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adv2e.effects.hooks import Hooks, View
from adv2e.events import Events
from adv2e.kernel import rng
from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {"dead_pixels": "a texture moved across the whole sensor: some pixels stay silent"}


@dataclass(frozen=True, kw_only=True)
class DeadPixels(Section):
    """Pixels that never fire."""

    fraction: float = parameter(
        unit="-",
        meaning="share of the pixels that is dead",
        at_least=0,
        at_most=1,
        fit=Fit(2e-4, 0.9, 0.03, log=True, starts=(0.005, 0.03)),
    )


class DeadPixelsHooks(Hooks):
    """Drops the events of dead pixels."""

    Parameters = DeadPixels

    def begin(self, view: View) -> None:
        super().begin(view)
        pixels = np.arange(view.rows * view.columns)
        drawn = rng.uniform_array(view.seed, rng.DEAD_CHOICE, pixels, 0)
        self._alive = (drawn >= self.parameters.fraction).reshape(view.rows, view.columns)

    def events_now(self, events: Events) -> Events:
        seen: Events = events[self._alive[events["y"], events["x"]]]
        return seen
