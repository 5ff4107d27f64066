"""Limited slew rate of the photoreceptor.

    |dy/dt| <= s

y           output of the first pole (the effect low_pass)
s           per_s: what its bias current can charge the load with

The pole follows its equation as long as that asks for less.  Beyond, its output is a ramp.  Large
steps of the light are then late, by more the larger they are; small steps are not.

Compiled in adv2e/kernel/stepped/signal.py.

References
----------
[1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337 (photoreceptor and
    its buffer, both biased by fixed currents).
[2] P. R. Gray, P. J. Hurst, S. H. Lewis, R. G. Meyer, "Analysis and Design of Analog Integrated
    Circuits", 5th ed., Wiley 2009, section 9.6 (slew rate: bias current over capacitance).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {
    "slew_limit": "steps of several sizes (more than a factor of e) at the same light: latency"
    " grows with the size of the step"
}


@dataclass(frozen=True, kw_only=True)
class SlewLimit(Section):
    """Limited slew rate of the first pole."""

    per_s: float = parameter(
        unit="ln/s",
        meaning="fastest change of the filtered signal",
        above=0,
        fit=Fit(0.5, 1e4, 30.0, log=True, starts=(10.0, 30.0, 90.0)),
    )
