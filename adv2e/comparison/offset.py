r"""Latency offset: common delay of the simulated events behind the measured ones.

The signed streams are correlated pixel by pixel, both smoothed with a Gaussian of 2 ms,

.. math:: C(\tau) = \sum_{pixels} \sum_{ij} s_i s_j\,
    \exp\!\left(-\frac{(t^{sim}_j - t^{meas}_i - \tau)^2}{4\sigma^2}\right),

and the offset is where :math:`C` is largest.  It is like a latency: it cannot tell a slow pixel
from clocks that differ.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.distances import keys, stride_of
from adv2e.events import Events
from adv2e.representations.voxel_grid import signs

SIGMA_US = 2_000
"""Deviation of the Gaussian [us]."""
REACH_US = 50_000
"""Largest offset looked for [us]."""
_BIN_US = 10
_KERNEL_REACH_US = 12 * SIGMA_US
_SIGNIFICANT = 5.0


def latency_offset_us(measured: Events, simulated: Events, width: int) -> float | None:
    """Return the offset to 10 us [us], positive where the simulated events are later.

    None where the correlation does not rise above five deviations of what pairs of random sign
    give, or is largest at one of the ends, +-50 ms.

    Parameters
    ----------
    measured, simulated : Events
        The streams, cut to the same time.
    width : int
        Columns of the sensor.
    """
    signed, pairs = _pair_histograms(measured, simulated, width, REACH_US + _KERNEL_REACH_US)
    ahead = np.arange(-_KERNEL_REACH_US, _KERNEL_REACH_US + 1, _BIN_US)
    kernel = np.exp(-((ahead / (2.0 * SIGMA_US)) ** 2))
    correlation = np.convolve(signed, kernel, mode="valid")
    peak = int(np.argmax(correlation))
    noise = np.sqrt(pairs[peak : peak + len(kernel)] @ kernel**2)
    if peak in (0, len(correlation) - 1) or correlation[peak] <= _SIGNIFICANT * noise:
        return None
    return float(peak * _BIN_US - REACH_US)


def _pair_histograms(
    measured: Events, simulated: Events, width: int, reach: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return signed and plain counts of t_sim - t_meas over the pairs of one pixel."""
    start, stride = stride_of(measured, simulated, reach=2 * (reach + _BIN_US))
    bins = 2 * (reach // _BIN_US) + 1
    signed, pairs = np.zeros(bins), np.zeros(bins)
    early, early_sign = _train(measured, width, start, stride)
    late, late_sign = _train(simulated, width, start, stride)
    lowest = -reach - _BIN_US // 2
    active = np.arange(len(early))
    other = np.searchsorted(late, early + lowest)
    while len(active):
        there = other < len(late)
        active, other = active[there], other[there]
        place = (late[other] - early[active] - lowest) // _BIN_US
        near = place < bins
        active, other, place = active[near], other[near], place[near]
        signed += np.bincount(place, early_sign[active] * late_sign[other], bins)
        pairs += np.bincount(place, minlength=bins)
        other = other + 1
    return signed, pairs


def _train(
    events: Events, width: int, start: int, stride: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    key = keys(events, width, start, stride)
    order = np.argsort(key, kind="stable")
    return key[order], signs(events)[order]
