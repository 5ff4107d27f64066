r"""Source follower behind the photoreceptor: a second pole, the same at every brightness.

.. math:: \dot z = 2\pi f_s\,(y - z)

y is the output of the photoreceptor low-pass; the comparator sees z.  ``exact`` solves both poles
together; the K-step forms of the low-pass take y as a straight line in each step, for which the
second pole is solved exactly.

References
----------
.. [1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
   contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.jit import inlined
from adv2e.kernel.workspace import LAG, LAG2, Array, Circuit
from adv2e.parameters import Fit, Section, parameter


@dataclass(frozen=True, kw_only=True)
class SourceFollower(Section):
    """Second pole of the pixel."""

    cutoff_hz: float = parameter(
        unit="Hz",
        meaning="corner (-3 dB)",
        above=0,
        fit=Fit(5.0, 5000.0, 200.0, log=True),
    )


@inlined
def follower_series(
    ws: Array, order: int, lag2: float, dx: float, h: float, circuit: Circuit
) -> None:
    """Row LAG2: power series of v = z - x from that of u = y - x in row LAG.

    dv/dt = w2 (u - v) - dx/dt over a sub-step of h us.
    """
    ws[LAG2, 0] = lag2
    rate = circuit.follower * h
    for k in range(order):
        slope = rate * (ws[LAG, k] - ws[LAG2, k])
        if k == 0:
            slope -= dx
        ws[LAG2, k + 1] = slope / (k + 1)
