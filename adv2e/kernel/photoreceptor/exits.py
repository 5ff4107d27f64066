"""How soon photoreceptor noise leaves an interval of levels: tables, and a level as it is seen.

The law is told in :mod:`adv2e.diagnosis.tables.threshold_noise`.  Noise is in standard deviations,
and time in units of the time constant of the slower pole.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FARTHEST = 26.0
"""Standard deviations that the tables reach."""
FINE = np.linspace(-FARTHEST, FARTHEST, 5201)
STEP = float(FINE[1] - FINE[0])
FARTHEST_SHIFT = 30.0
SHIFTS = np.linspace(-FARTHEST_SHIFT, FARTHEST_SHIFT, 6000)  # an even number leaves out 0
"""Values of u at which h(u) is kept."""
SHIFT_STEP = float(SHIFTS[1] - SHIFTS[0])

COMPARABLE_POLES = 0.13
"""Fitted: what poles of comparable corners bring a level nearer, times rho e^{-level/2}."""
SAMPLING_SHIFT = 0.5826
"""-zeta(1/2)/sqrt(2 pi): how far sampling moves a level, in standard deviations of one step."""
POLE_SHIFT = 1.4604
"""-zeta(1/2): how far a fast second pole moves a level, in units of sqrt(rho)."""
RAYLEIGH = float(np.sqrt(0.5 * np.pi))
"""Mean speed at which a high level is crossed, in standard deviations of the speed."""


@lru_cache(maxsize=1)
def integrals() -> Array:
    """Return S, m from there to infinity, m up to there, and the integral of S m, (places, 4).

    S is summed outwards and m inwards, as both change by many orders of magnitude.
    """

    def outwards(values: Array) -> Array:
        parts, middle = 0.5 * STEP * (values[1:] + values[:-1]), FINE.size // 2
        below = -np.cumsum(parts[:middle][::-1])[::-1]
        return np.concatenate([below, [0.0], np.cumsum(parts[middle:])])

    scale, speed = outwards(np.exp(0.5 * FINE**2)), np.exp(-0.5 * FINE**2)
    parts = 0.5 * STEP * (speed[1:] + speed[:-1])
    above = np.concatenate([np.cumsum(parts[::-1])[::-1], [0.0]])
    return np.stack([scale, above, above[::-1], outwards(scale * speed)], axis=1)


@lru_cache(maxsize=1)
def shifts() -> Array:
    """Return h at all SHIFTS."""
    u, count = SHIFTS, 256
    n = np.arange(1, count + 1)
    total = 2.0 * np.arcsinh(u[:, None] / (2.0 * np.sqrt(n))).sum(axis=1)
    last = np.arcsinh(u / (2.0 * np.sqrt(count)))
    # the rest of the sum by its integral (Euler and Maclaurin)
    integral = 2.0 * count * last + u * (np.sqrt(count + 0.25 * u * u) - 0.5 * np.abs(u))
    slope = -0.5 * u / (count * np.sqrt(count + 0.25 * u * u))
    limit = total - integral - last - slope / 12.0 - 0.5 * u * np.abs(u)
    return np.asarray(-limit / u - 0.5 * u)


class Exits(NamedTuple):
    """Tables for the compiled code."""

    scale: Array  # S, at FINE
    rate: Array  # ln of the rate at which noise at rest reaches a level, at FINE
    shift: Array  # h, at SHIFTS


@lru_cache(maxsize=1)
def exits() -> Exits:
    """Return the tables: they depend on nothing."""
    scale, _, below, both = integrals().T
    # from rest, or a deviation below where that is above the level, with no lower level
    begin = np.minimum(np.round(FINE / STEP).astype(np.int64) - round(1.0 / STEP), 0)
    begin = np.maximum(begin + FINE.size // 2, 0)
    time = (scale * below - both) - (scale * below - both)[begin]
    return Exits(np.ascontiguousarray(scale), -np.log(np.maximum(time, 1e-3)), shifts())
