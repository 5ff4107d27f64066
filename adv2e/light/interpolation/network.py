"""Interpolation by a network: what it was trained on decides what is between two frames.

The light of both frames goes to the network as values that it was trained on
(:mod:`.onnx_file`), unrounded, and the values that come back become light again.  Frames too large
for one call go in tiles (:mod:`.tiles`).  A network that knows no time makes the middle of two
frames, then the middles beside it, so that L must be a power of two.

Frames that are equal are not shown to it.  All else is as it comes from the network: where things
are at rest, too, its light may differ a little from that of both frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import ConfigError
from adv2e.light.interpolation.linear import LinearUpsampler, check_pair
from adv2e.light.interpolation.onnx_file import Network
from adv2e.light.interpolation.paths import Paths
from adv2e.light.interpolation.sequence import NOTHING, Beside, ordered
from adv2e.light.interpolation.tiles import in_tiles

Array = NDArray[Any]


class NetworkUpsampler:
    """Makes the frames of each interval with a network, `threads` of them at a time.

    Parameters
    ----------
    network : Network
    paths : Paths
        Which say how many frames an interval gets.
    threads : int

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
