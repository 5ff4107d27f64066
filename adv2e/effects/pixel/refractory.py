"""Refractory period: after each event the pixel is dead for a while, then takes its reference anew.

In the dead time nothing fires and noise draws are lost.  At its end the reference is the signal of
that moment, as the reset switch of the real pixel opens then.  With refractory: null there is no
dead time: the reference moves by the threshold at a signal event and to the signal at a noise
event.

Compiled in adv2e/kernel/lanes/targets.py, adv2e/kernel/cascade/substep.py and
adv2e/kernel/stepped/events.py.

References
----------
[1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337.
[2] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops
    2021, doi:10.1109/CVPRW53098.2021.00144 (0.5 ms).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

LABELS = {"refractory": "dead time"}
SEPARATED_BY = {
    "refractory": "fast, high-contrast edges: no two events of a pixel are nearer than a fixed"
    " time, at every brightness, and more is lost the steeper the edge"
}


@dataclass(frozen=True, kw_only=True)
class Refractory(Section):
    """Dead time after each event."""

    period_us: float = parameter(
        500.0,
        unit="us",
        meaning="dead time after an event",
        above=0,
        source="v2e default 0.5 ms",
        fit=Fit(1.0, 2e6, 5000.0, log=True, starts=(1500.0, 5000.0, 15000.0)),
    )
