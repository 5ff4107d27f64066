"""Events and images side by side, and the short pieces of them that a training draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from networks.firenet import BINS, grid_of
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, cut
from experiments.simulators.clip import Clip, Simulator

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Pair:
    """Events of a clip, and some of its images.

    Attributes
    ----------
    events : Events
        Sorted.
    images : array of float32, (images, rows, columns)
        Light, 0 black and 1 white.
    times_us : array of int64, (images,)
        On the clock of the events.
    """

    events: Events
    images: Array
    times_us: NDArray[np.int64]

    @classmethod
    def simulated(cls, clip: Clip, simulator: Simulator, seed: int, every: int) -> Pair:
        """Return the events of all frames, and one frame in `every` of them."""
        images = clip.frames[::every].astype(np.float32) / np.float32(255.0)
        return cls(simulator.events(clip, seed), images, clip.times_ns[::every] // 1000)

    def grid(self, window: int, corner: tuple[int, int], size: tuple[int, int]) -> Array:
        """Return the grid of the events between an image and the next, of a part of the picture."""
        events = cut(self.events, *(int(t) for t in self.times_us[window : window + 2]))
        x, y = events["x"].astype(np.int64) - corner[0], events["y"].astype(np.int64) - corner[1]
        inside = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
        part = events[inside].copy()
        part["x"], part["y"] = x[inside], y[inside]
        return grid_of(part, size)

    def save(self, path: Path) -> None:
        """Write it as ``.npz``."""
        with path.open("wb") as file:
            np.savez(file, events=self.events, images=self.images, times_us=self.times_us)

    @classmethod
    def load(cls, path: Path) -> Pair:
        """Read it."""
        with np.load(path) as held:
            return cls(held["events"], held["images"], held["times_us"])


@dataclass(frozen=True)
class Batches:
    """What a training draws: runs of windows, of a part of the picture, mirrored or not.

    Attributes
    ----------
    pairs : sequence of Pair
    batch, length : int
        Runs at a time, and windows of each.
    crop : (int, int)
        Columns and rows of the part.

    Raises
    ------
    DataError
        A pair has too few images or pixels.
    """

    pairs: Sequence[Pair]
    batch: int
    length: int
    crop: tuple[int, int]

    def __post_init__(self) -> None:
        if not self.pairs:
            raise DataError("no sequence to train on")
        for pair in self.pairs:
            count, rows, columns = pair.images.shape
            if count <= self.length or columns < self.crop[0] or rows < self.crop[1]:
                raise DataError(
                    f"a sequence of {count} images of {columns}x{rows} pixels is too small for runs"
                    f" of {self.length} windows of {self.crop[0]}x{self.crop[1]}"
                )

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return grids (length, batch, bins, rows, columns), images (length, batch, 1, ...)."""
        columns, rows = self.crop
        grids = np.empty((self.length, self.batch, BINS, rows, columns), np.float32)
        images = np.empty((self.length, self.batch, 1, rows, columns), np.float32)
        for one in range(self.batch):
            pair = self.pairs[rng.integers(len(self.pairs))]
            count, height, width = pair.images.shape
            first = int(rng.integers(count - self.length))
            x, y = (int(rng.integers(most + 1)) for most in (width - columns, height - rows))
            turned = tuple(slice(None, None, -1 if rng.random() < 0.5 else 1) for _ in range(2))
            for k in range(self.length):
                grids[k, one] = pair.grid(first + k, (x, y), self.crop)[(slice(None), *turned)]
                image = pair.images[first + k + 1, y : y + rows, x : x + columns]
                images[k, one, 0] = image[turned]
        return grids, images
