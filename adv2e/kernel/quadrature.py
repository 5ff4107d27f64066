"""Gauss and Legendre rules for the lag at the end of an interval, or of a dead time.

What is integrated is e^-tau of :mod:`adv2e.kernel.screen`.  A relative error eps of the lag moves
an event by eps / w.  The error of a rule is measured here, for corners up to one and a half times
that at white and steps of the light either way, not estimated.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

NODES_MAX = 32

REACH = 20.0
"""Corner times time beyond which the past is forgotten: e^-20 of a lag is less than a tie."""

WITHIN_US = 0.01
"""Error of event times that a rule for an interval may make [us]."""

WITHIN_DEAD_US = 0.001
"""Error of event times that a rule for a dead time may make [us].

It is smaller: the signal at its end becomes the reference, which later events inherit.
"""


class Rules(NamedTuple):
    """Rules for a number of intervals."""

    nodes: NDArray[np.float64]  # (intervals, NODES_MAX), on [0, 1]
    weights: NDArray[np.float64]
    counts: NDArray[np.int64]  # (intervals,): how many of them there are
    nodes_dead: NDArray[np.float64]  # the same for dead times within the intervals
    weights_dead: NDArray[np.float64]
    counts_dead: NDArray[np.int64]


class Rule(NamedTuple):
    """Rules for one interval."""

    nodes: NDArray[np.float64]
    weights: NDArray[np.float64]
    nodes_dead: NDArray[np.float64]
    weights_dead: NDArray[np.float64]


def rules_for(lengths: NDArray[np.float64], fastest: float, dead_time: float) -> Rules:
    """Return rules for intervals.

    Parameters
    ----------
    lengths : (intervals,)
        Of the intervals [us].
    fastest : float
        Corner at white [rad/us].
    dead_time : float
        [us], 0: none.
    """
    shape = lengths.size, NODES_MAX
    rules = Rules(
        np.zeros(shape), np.zeros(shape), np.zeros(lengths.size, np.int64),
        np.zeros(shape), np.zeros(shape), np.zeros(lengths.size, np.int64),
    )  # fmt: skip
    # rounded up so that jitter of the frame times does not miss the cache
    roughly = np.array([rounded(length) for length in (1.005 * lengths).tolist()])
    for lasts in dict.fromkeys(roughly.tolist()):
        own = roughly == lasts
        node, weight = _remembered(lasts, fastest, WITHIN_US, 1.0)
        _put(node, weight, own, rules.nodes, rules.weights, rules.counts)
        if dead_time > 0.0:
            dead = min(dead_time, lasts)
            node, weight = _remembered(dead, fastest, WITHIN_DEAD_US, dead / lasts)
            _put(node, weight, own, rules.nodes_dead, rules.weights_dead, rules.counts_dead)
    return rules


def rounded(length: float) -> float:
    """Return a length that jitter of the frame times hardly changes [us]."""
    return float(f"{length:.2e}")


def _put(node: Any, weight: Any, own: Any, nodes: Any, weights: Any, counts: Any) -> None:
    counts[own] = node.size
    nodes[own, : node.size] = node
    weights[own, : node.size] = weight


def quadrature(
    length: float, fastest: float, within_us: float = WITHIN_US, step: float = 1.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the fewest Gauss nodes and weights on [0, 1] that are good enough.

    Parameters
    ----------
    length : float
        Of the time to integrate over [us].
    fastest : float
        Corner at white [rad/us].
    within_us : float
        Error of event times [us].
    step : float
        Largest change of log intensity over that time.
    """
    a1 = np.geomspace(1e-3, max(1.5 * fastest * length, 2e-3), 60)
    worst = within_us * a1 / length
    exact = _integral(a1, 120, step)
    for count in range(3, NODES_MAX):
        error = np.abs(_integral(a1, count, step) / exact - 1.0)
        if np.all(error <= np.maximum(worst, 1e-9)):
            break
    return _nodes(count)


_remembered = lru_cache(maxsize=512)(quadrature)


def _nodes(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    node, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (node + 1.0), 0.5 * weight


def _integral(a1: NDArray[np.float64], count: int, step: float) -> NDArray[np.float64]:
    """Integral of e^-tau for a light that is exponential in time, for changes up to `step`."""
    node, weight = _nodes(count)
    rows = []
    for dx in step * np.array([-1.0, -0.3, 0.0, 0.3, 1.0]):
        upto = np.minimum(1.0, REACH * (1.0 + 0.6 * max(dx, 0.0)) / a1)
        v = upto[:, None] * node
        z = -dx * v
        half = np.where(np.abs(z) < 1e-4, 0.5 + z / 6, (np.expm1(z) - z) / np.where(z, z, 1) ** 2)
        tau = v * a1[:, None] * (1.0 - dx * v * half)
        rows.append(upto * (np.exp(-tau) @ weight))
    return np.array(rows)
