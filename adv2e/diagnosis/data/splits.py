"""Split of a recording into data for training, validation and test.

Neighbouring pixels and milliseconds are correlated, so the parts are blocks: tiles of pixels
crossed with segments of time, in the manner of a Latin square, such that every part has all kinds
of scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.stream import Stream

TRAIN, VALIDATION, TEST = 0, 1, 2
COUNT = 3
NAMES = ("train", "validation", "test")

_TILE = 8
_SEGMENTS = 4
_PATTERN = np.array([TRAIN, VALIDATION, TRAIN, TEST], np.int8)


@dataclass(frozen=True)
class Split:
    """Train, validation or test label of each pixel in each segment of time.

    Attributes
    ----------
    borders_us : (segments + 1,)
        Times at which segments begin [us], and the end.
    label : (segments, pixels) int8
    """

    borders_us: NDArray[np.float64]
    label: NDArray[np.int8]

    @classmethod
    def of(cls, width: int, height: int, start_us: float, stop_us: float) -> Split:
        """Return the division of a recording."""
        size = max(1, min(_TILE, width // 4, height // 4))
        y, x = np.mgrid[:height, :width] // size
        segment = np.arange(_SEGMENTS)[:, None, None]
        label = _PATTERN[(x + 2 * y + segment + x // 4) % 4]
        borders = np.linspace(start_us, stop_us, _SEGMENTS + 1)
        return cls(borders, label.reshape(_SEGMENTS, -1))

    @property
    def segments(self) -> int:
        """Number of segments of time."""
        return len(self.label)

    def segment_of(self, t: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the segment of each of sorted times [us]."""
        inner = np.searchsorted(t, self.borders_us[1:-1])  # sorted: few searches, not many
        return np.repeat(np.arange(self.segments), np.diff(np.r_[0, inner, len(t)]))

    def chosen(self, stream: Stream, *parts: int) -> Stream:
        """Return the events of one part of the data, or of several."""
        label = self.label[self.segment_of(stream.t), stream.pixel]
        return stream.chosen(np.isin(label, parts))

    def share(self, part: int) -> float:
        """Return the share of pixels and time that a part has."""
        return float(np.mean(self.label == part))

    def text(self) -> str:
        """Return a sentence about the split, with the share of each part."""
        shares = ", ".join(f"{name} {self.share(k):.0%}" for k, name in enumerate(NAMES))
        return (
            f"the sensor was divided into tiles and the time into {self.segments} segments, shared"
            f" out as: {shares}; the test data were looked at once, at the end"
        )
