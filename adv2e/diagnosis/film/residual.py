"""Residual of recordings of a film: numbers of events in cells, and times between events.

Every number is a square root of a count, so that chance moves all of them alike, and is given for
each recording: numbers of events of either polarity in cells of the sensor and of time, smoothed;
numbers of all its pixels in these cells of time; and numbers of times between two events of a
pixel, of one polarity and of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.splits import Stream

Array = NDArray[np.float64]
Cells = NDArray[np.float32]

BIN_US = 5_000.0
"""Shortest cell of time [us]."""
_MOST_BINS, _MOST_CELLS = 200, 2_000_000
_SPACE, _TIME = np.array([1, 4, 6, 4, 1]) / 16, np.array([1, 2, 1]) / 4
"""Kernels by which numbers in cells are smoothed, of rows and columns, and of time."""
_APART = 2
"""Of smoothed numbers, every second row and column is kept."""
_LEAST = 0.05
"""Number of events in a cell beside which fewer do not count."""
_GAPS_US = np.concatenate([[0.0, 2.0], np.geomspace(100.0, 1e6, 41)])
"""Borders of times between events of a pixel; below 2 us are stamps that coincide."""


@dataclass(frozen=True)
class Numbers:
    """Square roots of counts.

    Attributes
    ----------
    cells : (recordings, polarities, bins, rows, columns)
    others : (recordings, counts)
        Of all pixels in time, and of times between events.
    """

    cells: Cells
    others: Array

    def __sub__(self, other: Numbers) -> Numbers:
        return Numbers(self.cells - other.cells, self.others - other.others)

    def scaled(self, by: float) -> Numbers:
        return Numbers(self.cells * np.float32(by), self.others * by)

    def times(self, other: Numbers, bins: slice = slice(None)) -> float:
        """Return the sum of products with others; of some bins alone, without the rest."""
        return float(self.each(other, bins).sum())

    def each(self, other: Numbers, bins: slice = slice(None)) -> Array:
        """Return :meth:`times` of each recording, (recordings,)."""
        a, b = self.cells[:, :, bins], other.cells[:, :, bins]
        found = np.einsum("rptyx,rptyx->r", a, b, dtype=np.float64)
        if bins == slice(None):
            found = found + np.einsum("ri,ri->r", self.others, other.others)
        return np.asarray(found)


def places_of(stream: Stream, recordings: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return recording, row and column of each event of recordings side by side."""
    y, x = np.divmod(stream.pixel, stream.width)
    number, x = np.divmod(x, stream.width // recordings)
    return number, y, x


class Counting:
    """Turns the events of recordings side by side into :class:`Numbers`.

    `width`: columns of one recording; `span_us`: first and last time.
    """

    def __init__(self, width: int, height: int, recordings: int, span_us: tuple[float, float]):
        self._width, self._height, self._recordings = width, height, recordings
        first, last = span_us
        bin_us = max(BIN_US, (last - first) / _MOST_BINS)
        self.bins = max(1, round((last - first) / bin_us))
        self.borders_us = np.linspace(first, last, self.bins + 1)
        size = 1
        while recordings * 2 * self.bins * (width // size) * (height // size) > 4 * _MOST_CELLS:
            size += 1
        self._size = size

    def bins_between(self, begin_us: float, end_us: float) -> slice:
        """Return the bins that a stretch of time touches."""
        low = int(np.searchsorted(self.borders_us, begin_us, "right")) - 1
        high = int(np.searchsorted(self.borders_us, end_us, "left"))
        return slice(max(low, 0), max(min(high, self.bins), 0))

    def numbers(self, stream: Stream) -> Numbers:
        """Return the numbers of a stream of all recordings, (recordings * width) columns wide."""
        number, y, x = places_of(stream, self._recordings)
        bins = np.searchsorted(self.borders_us, stream.t, "right") - 1
        bins = np.clip(bins, 0, self.bins - 1)
        cells = self._cells((number, stream.on, bins, y // self._size, x // self._size))
        return Numbers(cells, self._others(stream, number, bins))

    def _cells(self, places: tuple[NDArray[Any], ...]) -> Cells:
        rows, columns = -(-self._height // self._size), -(-self._width // self._size)
        shape = self._recordings, 2, self.bins, rows, columns
        place = np.ravel_multi_index(places, shape)
        cells = np.bincount(place, minlength=int(np.prod(shape))).reshape(shape)
        smooth = cells.astype(np.float32)
        for axis, kernel in ((4, _SPACE), (3, _SPACE), (2, _TIME)):
            smooth = _smoothed(smooth, axis, kernel)
        kept = smooth[..., ::_APART, ::_APART]
        # of an even change of all numbers, both kinds of numbers tell as much as counts do
        return np.asarray(_APART * np.sqrt(kept + np.float32(_LEAST)))

    def _others(self, stream: Stream, number: NDArray[Any], bins: NDArray[Any]) -> Array:
        """Return the course in time of both polarities, then times between events."""
        since, count = stream.since, len(_GAPS_US) - 1
        gap = np.searchsorted(_GAPS_US, since, "right") - 1
        kind = (stream.on != stream.on_before) * count
        found = np.flatnonzero((since >= 0) & (gap < count))
        rows = np.zeros((self._recordings, 2 * (self.bins + count)))
        np.add.at(rows, (number, bins + self.bins * stream.on), 1.0)
        np.add.at(rows, (number[found], 2 * self.bins + gap[found] + kind[found]), 1.0)
        return np.sqrt(rows + 3 / 8)


def _smoothed(values: Cells, axis: int, kernel: Array) -> Cells:
    """Return a convolution along an axis; beyond the ends is nothing."""
    reach = len(kernel) // 2
    moved = np.moveaxis(values, axis, 0)
    result = np.zeros_like(moved)
    for offset, weight in enumerate(kernel.astype(np.float32), -reach):
        n = len(moved) - abs(offset)
        if n > 0:
            there, here = max(offset, 0), max(-offset, 0)
            result[here : here + n] += weight * moved[there : there + n]
    return np.moveaxis(result, 0, axis)
