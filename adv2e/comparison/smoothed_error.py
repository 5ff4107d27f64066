r"""Distance between two streams smoothed in time with a Gaussian, pixel by pixel.

A stream is a train of signed pulses a pixel, :math:`s(t) = \sum_i s_i \delta(t - t_i)`.  The error
at the scale :math:`\sigma` is the norm of the smoothed difference over that of the smoothed
measured stream, over all pixels and all time; ``error`` is its mean over 2, 10, 50 and 100 ms.
Smoothed pulses have inner products in closed form,

.. math::
    \int (G_\sigma * \delta_{t_i})(G_\sigma * \delta_{t_j})\,dt
      = \frac{1}{2\sigma\sqrt\pi}\exp\!\left(-\frac{(t_i - t_j)^2}{4\sigma^2}\right),

so that a norm is a sum over the pairs of one pixel, without bins.  Pairs farther apart than six
deviations of that kernel (:math:`6\sqrt2\,\sigma`) are left out; each weighs under 2e-8.

References
----------
.. [1] M. van Rossum, "A novel spike distance", Neural Computation 13, 2001,
   doi:10.1162/089976601300014321.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.pairs import add_pairs
from adv2e.comparison.trains import Keys, keys, stride_of
from adv2e.events import Events
from adv2e.representations.voxel_grid import signs

SIGMAS_US = (2_000, 10_000, 50_000, 100_000)
"""Scales of the error [us]."""
_CUT = 6.0 * math.sqrt(2.0)


def smoothed_errors(
    measured: Events,
    simulated: Events,
    width: int,
    sigmas_us: Sequence[float] = SIGMAS_US,
    *,
    whole: Events | None = None,
) -> list[float] | None:
    """Return the error of streams cut to one time, None if there is no event to divide by.

    One value for each deviation of the Gaussian [us].  `whole` is the stream whose norm is divided
    by, where it is not `measured`.
    """
    norms = smoothed_norms([(measured if whole is None else whole, 1.0)], width, sigmas_us)
    if not norms.all():
        return None
    apart = smoothed_norms([(measured, 1.0), (simulated, -1.0)], width, sigmas_us)
    return [float(value) for value in apart / norms]


def smoothed_norms(
    streams: Sequence[tuple[Events, float]], width: int, sigmas_us: Sequence[float]
) -> NDArray[np.float64]:
    """Return the norm of the weighted sum of the smoothed `streams`, at each scale.

    The unit is that of one smoothed pulse: a stream of a single event has the norm 1.
    """
    reach = math.ceil(_CUT * max(sigmas_us))
    start, stride = stride_of(*(events for events, _ in streams), reach=reach)
    key = np.concatenate([keys(events, width, start, stride) for events, _ in streams])
    weight = np.concatenate([signs(events) * factor for events, factor in streams])
    key, weight = _merged(key, weight)
    return np.sqrt(np.maximum(_energies(key, weight, sigmas_us), 0.0))


def _merged(key: Keys, weight: NDArray[np.float64]) -> tuple[Keys, NDArray[np.float64]]:
    """Sort, add up what falls on one time of one pixel, and drop what cancels there."""
    if not len(key):
        return key, weight
    order = np.argsort(key, kind="stable")
    key, weight = key[order], weight[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    key, weight = key[first], np.add.reduceat(weight, first)
    kept = weight != 0
    return key[kept], weight[kept]


def _energies(
    key: Keys, weight: NDArray[np.float64], sigmas_us: Sequence[float]
) -> NDArray[np.float64]:
    """Return the sum over all pairs of w_i w_j exp(-(t_i - t_j)^2/(4 sigma^2)), at each scale."""
    sigma = np.asarray(sigmas_us, dtype=np.float64)
    widest_first = np.argsort(-sigma)
    sums = np.full(len(sigma), float(weight @ weight))
    add_pairs(key, weight, 1.0 / (4.0 * sigma[widest_first] ** 2), _CUT * sigma[widest_first], sums)
    energies = np.empty_like(sums)
    energies[widest_first] = sums
    return energies
