r"""Leak of the memorised reference: regular ON events of a pixel at rest.

The reset switch leaks, so the reference falls,

.. math:: \dot r = -(R_0 + R_1\,DN / 255)\, C_{on}\, \xi

with R_0 = ``rate_hz``, R_1 = ``photo_rate_hz``, DN the unfiltered light and C_on that pixel's own
ON threshold, so that a pixel at rest fires at R_0 + R_1 DN/255.  ``jitter`` is the relative
standard deviation of the time between two leak events: xi is drawn anew after each event of the
pixel, as 1/(1 + jitter g) with g normal and cut symmetrically, so that the mean period stays.

References
----------
.. [1] Y. Nozaki, T. Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
   sensors", IEEE TED 64(8), 2017, doi:10.1109/TED.2017.2717848.
.. [2] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events",
   CVPR Workshops 2021, doi:10.1109/CVPRW53098.2021.00144 (0.1 Hz, jitter 10 %).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adv2e import rng
from adv2e.jit import entry, inlined, kernel
from adv2e.kernel.workspace import (
    LEAK,
    LIGHT,
    S_LEAK_DRAW,
    S_LEAK_FACTOR,
    S_ON,
    Array,
    Circuit,
)
from adv2e.parameters import Fit, Section, parameter


@dataclass(frozen=True, kw_only=True)
class Leak(Section):
    """Leak events."""

    rate_hz: float = parameter(
        0.1,
        unit="Hz",
        meaning="ON events a pixel a second from junction leakage",
        at_least=0,
        source="v2e: 0.01-0.1 Hz",
        fit=Fit(1e-3, 500.0, 2.0, log=True),
    )
    photo_rate_hz: float = parameter(
        0.0,
        unit="Hz",
        meaning="ON events a pixel a second from parasitic photocurrent, at white",
        at_least=0,
        fit=Fit(1e-2, 1000.0, 5.0, log=True),
    )
    jitter: float = parameter(
        0.0,
        unit="-",
        meaning="relative standard deviation of the time between two leak events",
        at_least=0,
        at_most=0.3,
        source="v2e: 0.1",
    )


@inlined
def leak_series(ws: Array, order: int, h: float, on: float, circuit: Circuit) -> None:
    """Row LEAK: fall of the reference since the start of a sub-step of h us, before jitter."""
    ws[LEAK, 0] = 0.0
    for k in range(order):
        ws[LEAK, k + 1] = on * h * circuit.photo_leak * ws[LIGHT, k] / (k + 1)
    ws[LEAK, 1] += on * h * circuit.leak


@kernel
def fill_falls(
    lo: int, count: int, length: float, mean: Array, circuit: Circuit, state: Array, falls: Array
) -> None:
    """Fall of the reference over an interval of `length` us: pixels lo.., mean light [DN]."""
    on = state[S_ON, lo : lo + count]
    constant, per_dn = circuit.leak * length, circuit.photo_leak * length
    if per_dn > 0.0:
        for k in range(count):
            falls[k] = on[k] * (constant + per_dn * mean[k])
    else:
        for k in range(count):
            falls[k] = on[k] * constant
    if circuit.leak_jitter > 0.0:
        factor = state[S_LEAK_FACTOR, lo : lo + count]
        for k in range(count):
            falls[k] *= factor[k]


@kernel
def _factor(seed: np.uint64, jitter: float, i: int, draw: float) -> float:
    """Leak speed of one cycle of pixel i, relative to the nominal one."""
    g = rng.normal(seed, rng.LEAK_PERIOD, i, draw)
    return 1.0 / (1.0 + jitter * min(max(g, -3.0), 3.0))


@kernel
def next_leak_factor(i: int, circuit: Circuit, state: Array) -> float:
    """Draw the leak speed of the cycle that now begins."""
    state[S_LEAK_DRAW, i] += 1
    factor = _factor(circuit.seed, circuit.leak_jitter, i, state[S_LEAK_DRAW, i])
    state[S_LEAK_FACTOR, i] = factor
    return factor


@entry
def fill_first_factors(seed: np.uint64, jitter: float, factors: Array) -> None:
    """Draw the leak speed of every pixel's first cycle."""
    for i in range(factors.shape[0]):
        factors[i] = _factor(seed, jitter, i, 0)
