"""Overshoot of the reset: the new reference lies beyond the signal, or short of it.

    r = y + p eps C_p

r           the new reference
y           signal at the end of the dead time
p           polarity of the event, 1 or -1
C_p         its threshold
eps         fraction: the charge that the reset switch injects when it opens

Without dead time the reference moves by p C_p (1 + eps) at a signal event.  After an event the next
one of the same polarity needs (1 + eps) of the threshold, one of the other polarity (1 - eps),
whatever the speed of the change.  Every event resets, those of noise too.

Compiled in adv2e/kernel/cascade/substep.py and adv2e/kernel/stepped/events.py.

References
----------
[1] M. Yang, S.-C. Liu, T. Delbruck, "A dynamic vision sensor with 1 % temporal contrast sensitivity
    and in-pixel asynchronous delta modulator for event encoding", IEEE JSSC 50(9), 2015,
    doi:10.1109/JSSC.2015.2425886 (charge injected at reset).
[2] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337 (reset switch).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

LABELS = {"reset_overshoot": "overshoot of the reset"}
SEPARATED_BY = {
    "reset_overshoot": "edges of different steepness: the first event after a reset comes late or"
    " early by the same contrast, whatever the steepness"
}


@dataclass(frozen=True, kw_only=True)
class ResetOvershoot(Section):
    """Overshoot of the reset."""

    fraction: float = parameter(
        unit="-",
        meaning="share of the threshold by which the new reference is carried on",
        above=-1,
        at_most=0.9,
        fit=Fit(-0.9, 0.9, 0.1, starts=(-0.1, 0.1, 0.25)),
    )
