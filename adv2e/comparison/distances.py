"""Distances between two event streams, each with the definition it goes by.

The literature means several things by "distance between the temporal bins"; the numbers differ
several times over, so each is named and none stands alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.windows import Windows, holding_events
from adv2e.compiled import kernel
from adv2e.errors import DataError
from adv2e.events import Events, Window, cut, pixels_of
from adv2e.representations.voxel_grid import (
    Grid,
    own_window,
    signed_grid,
    signs,
    smoothed,
    z_scored,
)

# ---- Events as one train a pixel: sorted by pixel, then time, in a single integer.
#
# ``key = pixel * stride + (t - start)`` with a stride beyond the span: events of one pixel are
# neighbours, and their keys differ by their time difference [us].


Keys = NDArray[np.int64]


def stride_of(*streams: Events, reach: int = 0) -> tuple[int, int]:
    """Return start [us] and stride that keep pixels apart by more than `reach` [us]."""
    filled = [events["t"] for events in streams if len(events)]
    if not filled:
        return 0, reach + 1
    start = min(int(t.min()) for t in filled)
    stop = max(int(t.max()) for t in filled)
    return start, stop - start + reach + 1


def keys(events: Events, width: int, start: int, stride: int) -> Keys:
    """Return the key of each event, in the order of `events`."""
    pixel = pixels_of(events, width)
    if len(pixel) and (int(pixel.max()) + 1) * stride > np.iinfo(np.int64).max:
        raise DataError(
            f"events {stride / 1e6:,.6g} s apart, of pixels up to {int(pixel.max()):,}, are too far"
            " from each other to be compared: is a time wrong ('adv2e info' tells gaps)?"
        )
    key: Keys = pixel * stride + (events["t"] - start)
    return key


# ---- Compiled sum over the pairs of events of one pixel.


@kernel
def add_pairs(key: Any, weight: Any, decay: Any, reach: Any, sums: Any) -> None:
    """Add 2 w_i w_j exp(-decay (key_j - key_i)^2) over all pairs i < j within reach.

    Parameters
    ----------
    key : array of int64, (events,)
        Increasing; keys of different pixels are farther apart than every reach.
    weight : array of float64, (events,)
        Signed weights.
    decay, reach : arrays of float64, (scales,)
        Scales with the widest reach first.
    sums : array of float64, (scales,)
        What is added to.
    """
    for i in range(key.shape[0]):
        for j in range(i + 1, key.shape[0]):
            apart = float(key[j] - key[i])
            if apart > reach[0]:
                break
            product = 2.0 * weight[i] * weight[j]
            for n in range(decay.shape[0]):
                if apart > reach[n]:
                    break
                sums[n] += product * math.exp(-decay[n] * apart * apart)


# ---- Two streams on a sensor too large for grids of it: rows and columns without events go.
#
# The distances look at a pixel and at its neighbours, so that of columns without events between
# two with some only two have to stay: what smoothing spills over from either side then falls on
# the same pixels as before. All numbers are those of the whole sensor.


ENOUGH = 1 << 21
"""Pixels up to which the sensor is taken as it is."""

MOST = 1 << 23
"""Pixels of the grids; each takes some 400 bytes."""

_APART = 3
"""Columns that are farther from each other do not meet."""


def compact(streams: list[Events], width: int, height: int) -> tuple[list[Events], int, int]:
    """Return the streams and the size of a sensor that gives the same distances.

    Raises
    ------
    DataError
        Too many pixels are left.
    """
    if width * height <= ENOUGH:
        return streams, width, height
    columns, kept_width = _places([events["x"] for events in streams], width)
    rows, kept_height = _places([events["y"] for events in streams], height)
    if kept_width * kept_height > MOST:
        raise DataError(
            f"events of {kept_width} columns and {kept_height} rows are too many to compare;"
            f" {MOST:,} pixels are the most: crop the streams"
        )
    moved = [events.copy() for events in streams]
    for events in moved:
        events["x"], events["y"] = columns[events["x"]], rows[events["y"]]
    return moved, kept_width, kept_height


def _places(used: list[NDArray[Any]], size: int) -> tuple[NDArray[np.int64], int]:
    """Return the new place of each coordinate, (size,), and how many there are."""
    there = np.zeros(size, np.bool_)
    for coordinates in used:
        there[coordinates] = True
    at = np.flatnonzero(there)
    places = np.zeros(size, np.int64)
    if not at.size:
        return places, 1
    # an edge of the sensor is kept where it is near, as nothing is smoothed beyond it
    first = min(int(at[0]), 1)
    places[at] = first + np.cumsum(np.r_[0, np.minimum(np.diff(at), _APART)])
    return places, int(places[at[-1]]) + 1 + min(size - 1 - int(at[-1]), 1)


BINS = 5
"""Temporal bins of a window."""


@dataclass(frozen=True)
class Measure:
    """Definition of a distance between two streams."""

    definition: str
    pooled: str
    """Pooling over the windows: mean or median."""


_GRID = f"signed grids of {BINS} temporal bins, bilinear in time, the window's ends shared"

MEASURES = {
    "bins_shared_window": Measure(
        f"Euclidean distance of {_GRID}, raw; mean over windows",
        "mean",
    ),
    "bins_own_span": Measure(
        f"Euclidean distance of signed grids of {BINS} temporal bins, bilinear between each"
        " stream's own first and last event in the window, raw; mean over windows",
        "mean",
    ),
    "bins_z_scored": Measure(
        f"Euclidean distance of {_GRID}, each grid less its mean and over its standard deviation,"
        " both over its non-zero cells; mean over windows",
        "mean",
    ),
    "relative_5_bins": Measure(
        f"Euclidean distance of {_GRID}, over the norm of the measured grid; median over windows",
        "median",
    ),
    "relative_5_bins_smoothed": Measure(
        "as relative_5_bins, both grids after a 3x3 Gaussian in space (sigma 1 pixel)",
        "median",
    ),
    "relative_1_bin_smoothed": Measure(
        "as relative_5_bins_smoothed, with one bin: signed counts of the window",
        "median",
    ),
    "error": Measure(
        "Euclidean distance of the signed streams smoothed in time with a Gaussian, pixel by pixel"
        " and without bins, over the norm of the measured one; mean over sigma = 2, 10, 50 and"
        " 100 ms, all windows as one stretch",
        "mean",
    ),
}
"""The measures by name, the first the primary one.  Relative ones: 1 is as far as no events."""


@dataclass(frozen=True)
class Distances:
    """Values of all measures; None where there is nothing to divide by."""

    values: dict[str, float | None]
    per_window: dict[str, list[float | None]]
    """By measure, one value a window; for ``error`` one value a scale."""


def distances(
    measured: Events,
    simulated: Events,
    windows: Windows,
    width: int,
    height: int,
    *,
    whole: Events | None = None,
) -> Distances:
    """Return all distances between two sorted streams, which are cut to the windows here.

    `whole` is the stream whose norm the relative measures are divided by, where not `measured`.
    """
    unit = [] if whole is None else [whole]
    per_window: dict[str, list[float | None]] = {name: [] for name in MEASURES}
    streams = (measured, simulated, *unit)
    nothing = [events[:0] for events in streams]
    still = _window_distances(nothing, (0, 0), 1, 1)  # the same wherever nothing fires
    for window, fires in zip(windows.used, holding_events(windows, streams), strict=True):
        found = still
        if fires:
            parts = [cut(events, *window) for events in streams]
            found = _window_distances(parts, window, width, height)
        for name, value in found.items():
            per_window[name].append(value)
    a, b, *c = (cut(events, windows.start, windows.stop) for events in (measured, simulated, *unit))
    errors = smoothed_errors(a, b, width, SIGMAS_US, whole=c[0] if c else None)
    per_window["error"] = [None] * len(SIGMAS_US) if errors is None else list(errors)
    values = {name: pooled(per_window[name], about.pooled) for name, about in MEASURES.items()}
    return Distances(values, per_window)


def _window_distances(
    parts: Sequence[Events], window: Window, width: int, height: int
) -> dict[str, float | None]:
    """Return the grid measures between two of `parts`, relative to a third or the first."""
    grids = [signed_grid(part, BINS, (width, height), window) for part in parts]
    counts = [signed_grid(part, 1, (width, height), window) for part in parts]
    own_a, own_b = (
        signed_grid(part, BINS, (width, height), own_window(part)) for part in parts[:2]
    )
    which = 2 if len(parts) > 2 else 0
    apart, apart_1 = grids[0] - grids[1], counts[0] - counts[1]
    return {
        "bins_shared_window": _norm(apart),
        "bins_own_span": _norm(own_a - own_b),
        "bins_z_scored": _norm(z_scored(grids[0]) - z_scored(grids[1])),
        "relative_5_bins": _ratio(apart, grids[which]),
        "relative_5_bins_smoothed": _ratio(smoothed(apart), smoothed(grids[which])),
        "relative_1_bin_smoothed": _ratio(smoothed(apart_1), smoothed(counts[which])),
    }


def _norm(grid: Grid) -> float:
    return math.sqrt(float(np.square(grid).sum()))


def _ratio(apart: Grid, unit: Grid) -> float | None:
    norm = _norm(unit)
    return _norm(apart) / norm if norm else None


def pooled(values: Sequence[float | None], how: str) -> float | None:
    """Return mean or median of the values that are there, None if there are none."""
    there = [value for value in values if value is not None]
    if not there:
        return None
    return float(np.median(there) if how == "median" else np.mean(there))


# ---- Distance between two streams smoothed in time with a Gaussian, pixel by pixel.
#
# A stream is a train of signed pulses a pixel, :math:`s(t) = \sum_i s_i \delta(t - t_i)`. The
# error at the scale :math:`\sigma` is the norm of the smoothed difference over that of the
# smoothed measured stream, over all pixels and all time; ``error`` is its mean over 2, 10, 50 and
# 100 ms. Smoothed pulses have inner products in closed form,
#
# .. math::
#     \int (G_\sigma * \delta_{t_i})(G_\sigma * \delta_{t_j})\,dt
#       = \frac{1}{2\sigma\sqrt\pi}\exp\!\left(-\frac{(t_i - t_j)^2}{4\sigma^2}\right),
#
# so that a norm is a sum over the pairs of one pixel, without bins. Pairs farther apart than six
# deviations of that kernel (:math:`6\sqrt2\,\sigma`) are left out; each weighs under 2e-8.
#
# References
# ----------
# .. [1] M. van Rossum, "A novel spike distance", Neural Computation 13, 2001,
#    doi:10.1162/089976601300014321.


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
