"""Interpolation by a network: what it was trained on decides what is between two frames.

The light of both frames goes to the network as values that it was trained on
(:mod:`.onnx_file`), unrounded, and the values that come back become light again.  Frames too large
for one call go in tiles.  A network that knows no time makes the middle of two
frames, then the middles beside it, so that L must be a power of two.

Frames that are equal are not shown to it.  All else is as it comes from the network: where things
are at rest, too, its light may differ a little from that of both frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import ConfigError
from adv2e.light.interpolation.flow import Paths
from adv2e.light.interpolation.linear import NOTHING, Beside, LinearUpsampler, check_pair, ordered
from adv2e.light.interpolation.onnx_file import Network

# ---- Pictures of any size through a network that takes some sizes only: padded, and cut into
# tiles.
#
# A picture is padded to the right and below with the pixels of its border. What is too large then,
# or not of the size that the network was exported for, is cut into tiles of one size. Neighbours
# share at least a quarter of their length, up to OVERLAP. There each counts the less, the nearer
# its border is: its share grows linearly from one border of what they have in common to the other,
# so that no seam is seen. What moves further than they have in common may be lost there.


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
        self.size = fixed or min(-(-length // multiple) * multiple, largest)
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


def _ramp(length: int) -> Image:
    return ((np.arange(length) + 0.5) / length).astype(np.float32)


Array = NDArray[Any]


class NetworkUpsampler:
    """Makes the frames of each interval with a network, `threads` of them at a time.

    Parameters
    ----------
    paths : Paths
        Which say how many frames an interval gets.

    Raises
    ------
    ConfigError
        The network makes middles, and L is no power of two.
    """

    def __init__(self, network: Network, paths: Paths, *, threads: int = 1) -> None:
        self._network, self._paths, self._threads = network, paths, threads
        if not network.knows_time and paths.L.bit_count() != 1:
            below = 1 << (paths.L.bit_length() - 1)
            raise ConfigError(
                f"sampling.L: {network.source['file']} takes no time, so it makes middles and"
                f" middles of these: L must be a power of two, such as {below} or {2 * below}, got"
                f" {paths.L}"
            )

    def count(self, a: Array, b: Array, beside: Beside = NOTHING) -> int:
        """Return the number of frames that :meth:`between` makes."""
        count = self._paths.count(a, b, beside)
        return count if self._network.knows_time else 1 << (count - 1).bit_length()

    def between(self, a: Array, b: Array, beside: Beside = NOTHING) -> Iterator[Array]:
        """Yield the frames, the last `b` itself; see :class:`.Upsampler`."""
        check_pair(a, b)
        count = self.count(a, b, beside)
        if count == 1 or np.array_equal(a, b):
            yield from LinearUpsampler(count).between(a, b)
        elif self._network.knows_time:
            first, second = self._network.value(a), self._network.value(b)

            def frame(step: int) -> Array:
                return self._made(first, second, step / count, a.dtype)

            yield from ordered(frame, count, self._threads)
            yield b
        else:
            yield from self._halved(a, b, count)

    def _halved(self, a: Array, b: Array, count: int) -> Iterator[Array]:
        """Yield the middles in the order of time; few are held at a time."""
        if count > 1:
            values = self._network.value(a), self._network.value(b)
            middle = self._made(*values, 0.5, a.dtype)
            yield from self._halved(a, middle, count // 2)
            yield from self._halved(middle, b, count // 2)
        else:
            yield b

    def _made(self, first: Array, second: Array, share: float, dtype: Any) -> Array:
        network = self._network

        def ask(one: Array, other: Array) -> Array:
            return network.ask(one, other, share)

        light = in_tiles((first, second), ask, network.size, network.multiple)
        return light.astype(dtype, copy=False)
