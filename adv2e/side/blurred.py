"""Blurred frames: means of the light over exposures that follow one upon the other.

An exposure lasts from a frame to the N-th behind it, which begins the next one.  The light is
linear in time between frames, as the pixel sees it where frames are not moved: the mean over an
exposure is the sum of (light before + light behind) dt / 2 over its length.  It is encoded as the
frames are.

======================== ==================================================================
``blurred/%08d.png``     the means
``blurred.txt``          ``start end name`` of each, on the clock of the events
======================== ==================================================================

References
----------
.. [1] S. Nah, T. H. Kim, K. M. Lee, "Deep Multi-Scale Convolutional Neural Network for Dynamic
   Scene Deblurring", CVPR 2017 (means of frames of GOPRO; of numbers, and not of light).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import LightDecoder
from adv2e.files.backlog import Backlog
from adv2e.light.pictures import png_of
from adv2e.side.placement import Clock
from adv2e.sources.times.rates import nine_decimals


class BlurredFrames:
    """Takes frames, and keeps the mean over each exposure of `count` intervals, encoded, on disk.

    `encoding` and `white` are those of the pictures.
    """

    def __init__(self, count: int, encoding: str, white: float, folder: Path) -> None:
        self._count, self._meaning = count, (encoding, white)
        self._kept = Backlog(folder, limit=0)
        self._decoder: LightDecoder | None = None
        self._before: tuple[int, list[NDArray[Any]]] = (0, [])
        self._sums: list[NDArray[Any]] = []
        self._number = self._start_ns = 0

    def add(self, t_ns: int, picture: NDArray[Any]) -> None:
        """Take the next frame, uint8 or uint16, (rows, columns[, 3]); OSError if disk is full."""
        if self._decoder is None:
            self._decoder = LightDecoder(*self._meaning, picture.dtype, picture.ndim == 3)
        light = list(self._decoder.shares(picture))
        if self._number == 0:
            self._sums, self._start_ns = [np.zeros(one.shape) for one in light], t_ns
        else:
            half = (t_ns - self._before[0]) / 2
            planes = zip(self._sums, self._before[1], light, strict=True)
            self._sums = [
                total + half * (first.astype(np.float64) + last) for total, first, last in planes
            ]
            if self._number % self._count == 0:
                length = t_ns - self._start_ns
                made = self._decoder.encode(total / length for total in self._sums)
                self._kept.append(t_ns, np.frombuffer(png_of(made), np.uint8))
                self._sums, self._start_ns = [np.zeros(one.shape) for one in light], t_ns
        self._before, self._number = (t_ns, light), self._number + 1

    def files(self, clock: Callable[[], Clock]) -> Iterator[tuple[str, bytes]]:
        """Yield name and bytes of each picture, and of their list."""
        known, lines = clock(), []
        first = int(np.searchsorted(known.frames, known.first))
        for number in range(len(self._kept)):
            name = f"blurred/{number:08d}.png"
            ends = first + self._count * np.array([number, number + 1])
            times, _ = known.of_frames(ends)
            yield name, self._kept.take().tobytes()
            lines.append(" ".join([*map(nine_decimals, times), name]) + "\n")
        self._kept.close()
        yield "blurred.txt", "".join(lines).encode()
