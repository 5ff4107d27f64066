"""Distances between two event streams, each with the definition it goes by.

The literature means several things by "distance between the temporal bins"; the numbers differ
several times over, so each is named and none stands alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adv2e.comparison.smoothed_error import SIGMAS_US, smoothed_errors
from adv2e.comparison.windows import Windows, holding_events
from adv2e.events import Events, Window, cut
from adv2e.representations.voxel_grid import Grid, own_window, signed_grid, smoothed, z_scored

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
