"""Pictures of any size through a network that takes some sizes only: padded, and cut into tiles.

A picture is padded to the right and below with the pixels of its border.  What is too large then,
or not of the size that the network was exported for, is cut into tiles of one size.  Neighbours
share at least a quarter of their length, up to OVERLAP.  There each counts the less, the nearer its
border is: its share grows linearly from one border of what they have in common to the other, so
that no seam is seen.  What moves further than they have in common may be lost there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]

LARGEST = 1024
"""Rows and columns of the largest tile [pixels]: the memory of a network grows with them."""

OVERLAP = 128
"""Most pixels that neighbours need to have in common."""


@dataclass(frozen=True)
class Tile:
    """Tile along one axis: its first pixel, and the weights of its pixels."""

    start: int
    weight: Image
    """(length,), between 0 and 1."""


class Axis:
    """Tiles along the rows or the columns of a picture.

    Parameters
    ----------
    length : int
        Rows or columns of the picture.
    fixed : int, optional
        The only length that the network takes.
    multiple : int
        Else it takes multiples of this.
    """

    def __init__(self, length: int, fixed: int | None, multiple: int) -> None:
        largest = LARGEST // multiple * multiple
        self.size = fixed or min(_up(length, multiple), largest)
        self.padded = max(length, self.size)
        common = min(OVERLAP, self.size // 4)
        count = 1 + -(-(self.padded - self.size) // max(1, self.size - common))
        starts = [round(k) for k in np.linspace(0, self.padded - self.size, count)]
        self.tiles = [Tile(start, self._weight(starts, n)) for n, start in enumerate(starts)]

    def _weight(self, starts: list[int], number: int) -> Image:
        weight = np.ones(self.size, np.float32)
        if number > 0:
            common = starts[number - 1] + self.size - starts[number]
            weight[:common] = _ramp(common)
        if number < len(starts) - 1:
            common = starts[number] + self.size - starts[number + 1]
            weight[-common:] *= 1 - _ramp(common)
        return weight


def in_tiles(
    pictures: tuple[NDArray[Any], ...],
    ask: Callable[..., NDArray[Any]],
    fixed: tuple[int | None, int | None],
    multiple: int,
) -> Image:
    """Return the picture that `ask` makes of others, tile by tile.

    Parameters
    ----------
    pictures : tuple of (rows, columns)
        All of one size.
    ask : callable
        Takes a tile of each picture and returns one of the same size.
    fixed : (int or None, int or None)
        The only rows and columns that it takes; None: it takes multiples of `multiple`.
    multiple : int

    Returns
    -------
    made : (rows, columns) float32
    """
    rows, columns = pictures[0].shape
    down, right = (
        Axis(length, size, multiple) for length, size in zip((rows, columns), fixed, strict=True)
    )
    below, beside = down.padded - rows, right.padded - columns
    padded = [
        cv2.copyMakeBorder(one, 0, below, 0, beside, cv2.BORDER_REPLICATE) for one in pictures
    ]
    if len(down.tiles) == len(right.tiles) == 1:
        return np.ascontiguousarray(ask(*padded)[:rows, :columns], np.float32)
    total, weights = (np.zeros((down.padded, right.padded), np.float32) for _ in range(2))
    for upper in down.tiles:
        for left in right.tiles:
            at = (
                slice(upper.start, upper.start + down.size),
                slice(left.start, left.start + right.size),
            )
            weight = np.outer(upper.weight, left.weight)
            total[at] += weight * ask(*(np.ascontiguousarray(one[at]) for one in padded))
            weights[at] += weight
    made: Image = (total / weights)[:rows, :columns]
    return made


def _up(length: int, multiple: int) -> int:
    return -(-length // multiple) * multiple


def _ramp(length: int) -> Image:
    """Return shares that grow from near 0 to near 1."""
    return ((np.arange(length) + 0.5) / length).astype(np.float32)
