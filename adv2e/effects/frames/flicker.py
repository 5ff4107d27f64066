"""Flicker: light of lamps on the mains, of which the frames know nothing.

    DN' = DN (1 + m sin(2 pi f t + phi))

t           time on the camera's clock [s]
f           frequency_hz, that of the light: twice the mains for a lamp without rectifier
m           depth
phi         phase_rad

The light swings many times from frame to frame, so the swing is put on the light between the
frames.  Logarithm, corner of the low-pass, leak and shot noise all see it.  Light that other
effects add (dark current) swings with it.

References
----------
[1] Z. Wang, D. Yuan, Y. Ng, R. Mahony, "A Linear Comb Filter for Event Flicker Removal", ICRA 2022,
    arXiv:2205.08090 (100 or 120 Hz).
[2] IEEE Std 1789-2015, doi:10.1109/IEEESTD.2015.7118618 (depth: 1 to 40 per cent).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, Times
from adv2e.parameters import Fit, Section, parameter

LABELS = {"flicker": "flicker of lamps"}
SEPARATED_BY = {
    "flicker": "the same scene by daylight or direct current: the line in the rate disappears"
}

_STEPS_PER_PERIOD = 100
"""A straight line over a step is then off by less than 0.0005 m, some us of event time."""


@dataclass(frozen=True, kw_only=True)
class Flicker(Section):
    """Light that swings."""

    frequency_hz: float = parameter(
        unit="Hz",
        meaning="frequency of the light: 100 or 120 for lamps on the mains",
        above=0,
        at_most=1e5,
        fit=Fit(20.0, 1000.0, 100.0, log=True),
    )
    depth: float = parameter(
        unit="-",
        meaning="amplitude of the swing, relative to the mean light",
        at_least=0,
        at_most=0.99,
        fit=Fit(0.005, 0.99, 0.15, log=True),
    )
    phase_rad: float = parameter(
        0.0,
        unit="rad",
        meaning="phase of the sine at time zero of the camera's clock",
        fit=Fit(-math.pi, math.pi, 0.0),
    )


class FlickerHooks(Hooks):
    """Puts the swing on the light."""

    stage = "frames"
    Parameters = Flicker

    def __init__(self, parameters: Flicker) -> None:
        super().__init__(parameters)
        self.step_us = 1e6 / (_STEPS_PER_PERIOD * parameters.frequency_hz)

    def gain(self, times_s: Times) -> NDArray[np.float64]:
        p = self.parameters
        # whole turns taken off first: an epoch time would lose the phase in rounding
        turns = np.remainder(times_s * p.frequency_hz, 1.0)
        return np.asarray(1.0 + p.depth * np.sin(2.0 * np.pi * turns + p.phase_rad))
