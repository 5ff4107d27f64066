"""Where a simulation hangs on how the light between the frames was made up.

The recording is simulated from every second frame alone.  What changes by that is no less than what
interpolation of all frames gets wrong, if errors grow with the gaps; tiles of pixels in which it is
large say nothing of the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.windows import Windows
from adv2e.events import Events, cut
from adv2e.representations.voxel_grid import smoothed, voxel_grid

TILE = 8
"""Pixels along a tile."""
MOST = 0.2
"""Change of a tile's norm above which it is not judged by, relative."""
LINES = (0.1, MOST, 0.3, 0.5, 0.7, 1.0, np.inf)
"""Where that line may be drawn as well: how much hangs on it is told."""
_BINS = 5


@dataclass(frozen=True)
class Stability:
    """What changes when every second frame is dropped.

    Attributes
    ----------
    change : float
        Norm of the change over that of the simulation, chance taken off; median over windows.
    tiles : (windows, rows, columns) float
        The same of each pixel's tile; infinite where something changes and nothing was.
    windows : Windows
        Those it was told for.
    """

    change: float
    tiles: NDArray[np.float64]
    windows: Windows

    def alone(self, events: Events, most: float) -> Events:
        """Return the events in the windows whose tiles change by no more than `most`, a copy."""
        parts = []
        for window, changes in zip(self.windows.used, self.tiles, strict=True):
            part = cut(events, *window)
            parts.append(part[changes[part["y"], part["x"]] <= most])
        return np.concatenate(parts)


def compare_halved(
    whole: tuple[Events, Events], halved: tuple[Events, Events],
    windows: Windows, width: int, height: int,
) -> Stability:  # fmt: skip
    """Return what dropping frames changes.

    Parameters
    ----------
    whole, halved : (Events, Events)
        Two seeds from all frames, and the same two from every second one: the change is read off
        the product of the two differences, in which chance cancels on average.
    windows : Windows
    width, height : int
    """
    changes, tiles = [], []

    def grid(events: Events, window: tuple[int, int]) -> NDArray[Any]:
        return smoothed(voxel_grid(cut(events, *window), _BINS, (width, height), window))

    for window in windows.used:
        a, b = (grid(one, window) for one in whole)
        c, d = (grid(one, window) for one in halved)
        moved, power = np.maximum(_tiled((a - c) * (b - d)), 0.0), _tiled(a * b)
        whole_power = max(float((a * b).sum()), 1e-9)
        changes.append(np.sqrt(max(float(((a - c) * (b - d)).sum()), 0.0) / whole_power))
        nothing = np.where(moved > 0, np.inf, 0.0)
        squared = np.divide(moved, power, out=nothing, where=power > 0)
        tiles.append(_pixels(np.sqrt(squared), height, width))
    return Stability(float(np.median(changes)), np.array(tiles), windows)


def _tiled(grid: NDArray[Any]) -> NDArray[Any]:
    """Return sums over bins and tiles."""
    flat = grid.sum(axis=0)
    rows, columns = (-(-n // TILE) * TILE for n in flat.shape)
    padded = np.zeros((rows, columns))
    padded[: flat.shape[0], : flat.shape[1]] = flat
    tiles: NDArray[Any] = padded.reshape(rows // TILE, TILE, columns // TILE, TILE).sum(axis=(1, 3))
    return tiles


def _pixels(tiles: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.float64]:
    full = np.repeat(np.repeat(tiles, TILE, axis=0), TILE, axis=1)
    return full[:rows, :columns]
