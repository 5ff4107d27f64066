"""What differs from pixel to pixel: spread of the chip, silent and loud pixels, rows, columns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.statistics.base import Entry, Raw, excess, stabilised

HALVES = 2

_SILENT = "silent pixels"


class Pixels:
    """Numbers of events of each pixel against those that the declared model expects.

    Parameters
    ----------
    scene : Scene
    expected : (parts, numbers), optional
        Mean of :meth:`count` over simulations of the declared model; without it, only counting is
        possible.
    """

    title = "from pixel to pixel"

    def __init__(self, scene: Scene, expected: Raw | None = None) -> None:
        self._height, self._width = scene.height, scene.width
        self._halves = scene.parts.segments // HALVES
        self._expected = expected

    @cached_property
    def least(self) -> Sequence[float]:
        """Deviation below which each statistic is not trusted to be known."""
        # mostly there is no silent pixel, so that simulations do not tell how rare one is
        return [0.6 if entry.name == _SILENT else 0.01 for entry in self.entries]

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry("spread of ON", "variance of ON events from pixel to pixel over the expected"),
            Entry("spread of OFF", "variance of OFF events from pixel to pixel over the expected"),
            Entry("ON with OFF", "how excess of ON goes with excess of OFF in a pixel"),
            Entry("ON persists", "how excess of ON in one half of the time returns in the other"),
            Entry("OFF persists", "how excess of OFF in one half of the time returns in the other"),
            Entry("ON becomes OFF", "how excess of ON in one half goes with OFF in the other"),
            Entry(
                "loudest pixels", "logarithm of one and the mean excess of the loudest hundredth"
            ),
            Entry("loudest pixel", "logarithm of one and the excess of the loudest pixel"),
            Entry(_SILENT, "number of pixels that should have fired and did not", is_number=True),
            Entry("rows", "logarithm of the variance of the mean excess of a row"),
            Entry("columns", "logarithm of the variance of the mean excess of a column"),
            Entry("beside", "how excess goes with that of the pixel beside"),
            Entry("below", "how excess goes with that of the pixel below"),
            Entry("towards the corners", "excess towards the corners, ON and OFF"),
            Entry("left to right", "excess towards the right"),
            Entry("top to bottom", "excess towards the bottom"),
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream = placed.stream
        half = np.minimum(placed.segment // self._halves, HALVES - 1)
        pixels = self._height * self._width
        cells = HALVES * 2 * pixels
        cell = ((placed.part * HALVES + half) * 2 + stream.on) * pixels + stream.pixel
        number = np.bincount(cell, minlength=parts.COUNT * cells)
        which = np.eye(parts.COUNT)  # so that a sum over parts knows what to expect
        return np.concatenate([number.reshape(parts.COUNT, cells), which], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        assert self._expected is not None
        number, which = raw[: -parts.COUNT], raw[-parts.COUNT :]
        mean = (which @ self._expected)[: -parts.COUNT]
        shape = (HALVES, 2, self._height, self._width)
        n, mu = number.reshape(shape), mean.reshape(shape)
        residual = excess(n, mu)
        whole_n, whole_mu = n.sum(axis=0), mu.sum(axis=0)
        off, on = excess(whole_n, whole_mu)
        total_n, total_mu = whole_n.sum(axis=0), whole_mu.sum(axis=0)
        both = excess(total_n, total_mu)
        silent = (total_n == 0) & (total_mu > 4.0)
        ordered = np.sort(both, axis=None)
        top = max(1, both.size // 100)
        y, x = np.mgrid[-1.0 : 1.0 : self._height * 1j, -1.0 : 1.0 : self._width * 1j]
        radial = x * x + y * y
        return np.array(
            [
                np.mean(np.minimum(on * on, 100.0)),
                np.mean(np.minimum(off * off, 100.0)),
                _product(on, off),
                _product(residual[0, 1], residual[1, 1]),
                _product(residual[0, 0], residual[1, 0]),
                _product(residual[0, 1], residual[1, 0]) + _product(residual[0, 0], residual[1, 1]),
                np.log1p(max(0.0, float(ordered[-top:].mean()))),
                np.log1p(max(0.0, float(ordered[-1]))),
                float(stabilised(silent.sum())),
                float(np.log(np.var(both.mean(axis=1)) + 1e-3)),
                float(np.log(np.var(both.mean(axis=0)) + 1e-3)),
                _product(both[:, 1:], both[:, :-1]),
                _product(both[1:], both[:-1]),
                _slope(both, radial),
                _slope(both, x),
                _slope(both, y),
            ]
        )


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    if not a.size:  # nothing is beside the pixels of a single column
        return 0.0
    return float(np.mean(np.clip(a, -10, 10) * np.clip(b, -10, 10)))


def _slope(values: NDArray[np.float64], over: NDArray[np.float64]) -> float:
    centred = over - over.mean()
    spread = float(np.sum(centred * centred))
    if spread < 1e-9:  # all pixels are as far to a side as any other
        return 0.0
    return float(np.sum(np.clip(values, -10, 10) * centred)) / spread
