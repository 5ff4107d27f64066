"""Source follower behind the photoreceptor: a second pole, the same at every brightness.

    dz/dt = 2 pi f_s (y - z)

y           output of the photoreceptor low-pass
z           what the comparator sees
f_s         cutoff_hz

With low_pass.update: exact, y is a cubic in each step of time; with the forms of K steps it is a
straight line.  For either, the second pole is solved exactly.

Compiled in adv2e/kernel/cascade/ and adv2e/kernel/stepped/signal.py.

References
----------
[1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

LABELS = {"source_follower": "second low-pass (source follower)"}
SEPARATED_BY = {
    "source_follower": "fast and slow edges in bright light: it delays and weakens fast changes"
    " at every brightness, while a clock offset shifts slow ones as much"
}


@dataclass(frozen=True, kw_only=True)
class SourceFollower(Section):
    """Second pole of the pixel."""

    cutoff_hz: float = parameter(
        unit="Hz",
        meaning="corner (-3 dB)",
        above=0,
        fit=Fit(2.0, 1e5, 200.0, log=True, starts=(20.0, 60.0, 200.0, 600.0)),
    )
