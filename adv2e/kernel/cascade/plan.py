"""How intervals are cut for :mod:`adv2e.kernel.cascade`, and what is the same for all pixels."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MOST = 10
"""Most substeps of a piece: those whose lags are kept at a time."""

WEIGHTS = 8
"""Of the second pole: what it keeps, six for its input, and the lag behind a ramp."""

LONGEST = 0.8
"""Longest substep, in time constants at white: with 1.25, events that a leak of 9 Hz made after a
step to white were 1.8 us off; with 0.8, a tenth of that."""

FEWEST = 2
"""Substeps of an interval: the light may change by a third in it."""

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(40)


class Plan(NamedTuple):
    """How each interval is cut."""

    pieces: NDArray[np.int64]  # (intervals,)
    substeps: NDArray[np.int64]  # (intervals,): of a piece
    weights: NDArray[np.float64]  # (intervals, WEIGHTS)
    factors: NDArray[np.float64]  # (intervals + 1,): on both thresholds, at the ends
    simple: bool  # whether nothing but a second pole needs the cascade


def plan_for(
    lengths: NDArray[np.float64],
    fastest: float,
    follower: float,
    factors: NDArray[np.float64],
    simple: bool,
) -> Plan:
    """Return the plan of intervals.

    Parameters
    ----------
    lengths : (intervals,)
        Of the intervals [us].
    fastest : float
        Corner of the first pole at white [rad/us].
    follower : float
        Corner of the second pole [rad/us], 0: there is none.
    factors : (intervals + 1,)
        On both thresholds.
    simple : bool
        See :class:`Plan`.
    """
    needed = np.maximum(np.ceil(1.001 * lengths * fastest / LONGEST), FEWEST).astype(np.int64)
    pieces = -(-needed // MOST)
    substeps = -(-needed // pieces)
    corners = follower * lengths / (pieces * substeps)
    weights = np.array([_weights(corner) for corner in corners.tolist()]).reshape(-1, WEIGHTS)
    return Plan(pieces, substeps, weights, factors, simple)


@lru_cache(maxsize=512)
def _weights(b: float) -> tuple[float, ...]:
    """Return what a pole of corner `b` in a substep takes.

    Of its lag at the start; of value, slope and curvature of its input at the start, and at the
    end; and of what x moves by.
    """
    if b == 0.0:
        return (0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    upto = min(1.0, 40.0 / b)
    v = 0.5 * upto * (_NODES + 1.0)
    part = 0.5 * upto * _NODE_WEIGHTS * b * np.exp(-b * v)
    t = 1.0 - v
    basis = (
        1.0 - t**3 * (10.0 - t * (15.0 - 6.0 * t)),
        t * (1.0 - t * t * (6.0 - t * (8.0 - 3.0 * t))),
        0.5 * t * t * v**3,
        t**3 * (10.0 - t * (15.0 - 6.0 * t)),
        -(t**3) * (4.0 - t * (7.0 - 3.0 * t)),
        0.5 * t**3 * v * v,
    )
    ramp = -math.expm1(-b) / b
    return (math.exp(-b), *(float(part @ values) for values in basis), ramp)
