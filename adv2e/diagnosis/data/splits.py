"""Split of a recording into data for training, validation and test, and its events so divided.

Neighbouring pixels and milliseconds are correlated, so the parts are blocks: tiles of pixels
crossed with segments of time, in the manner of a Latin square, such that every part has all kinds
of scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.events import EVENT_DTYPE, Events

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
        size = max(1, min(_TILE, width // 4, height // 4))
        y, x = np.mgrid[:height, :width] // size
        segment = np.arange(_SEGMENTS)[:, None, None]
        label = _PATTERN[(x + 2 * y + segment + x // 4) % 4]
        borders = np.linspace(start_us, stop_us, _SEGMENTS + 1)
        return cls(borders, label.reshape(_SEGMENTS, -1))

    @property
    def segments(self) -> int:
        return len(self.label)

    def segment_of(self, t: NDArray[np.int64]) -> NDArray[np.int64]:
        inner = np.searchsorted(t, self.borders_us[1:-1])  # sorted: few searches, not many
        return np.repeat(np.arange(self.segments), np.diff(np.r_[0, inner, len(t)]))

    def chosen(self, stream: Stream, *parts: int) -> Stream:
        """Return the events of one part of the data, or of several."""
        label = self.label[self.segment_of(stream.t), stream.pixel]
        return stream.chosen(np.isin(label, parts))

    def share(self, part: int) -> float:
        return float(np.mean(self.label == part))

    def text(self) -> str:
        shares = ", ".join(f"{name} {self.share(k):.0%}" for k, name in enumerate(NAMES))
        return (
            f"the sensor was divided into tiles and the time into {self.segments} segments, shared"
            f" out as: {shares}; the test data were looked at once, at the end"
        )


# ---- Events in the form that statistics read, with each event's predecessor.


@dataclass(frozen=True)
class Stream:
    """Events of a sensor, sorted by time.

    Attributes
    ----------
    t : (n,) int64
        Time [us].
    pixel : (n,) int32
        Row times columns plus column.
    on : (n,) int8
        1: ON, 0: OFF.
    """

    t: NDArray[np.int64]
    pixel: NDArray[np.int32]
    on: NDArray[np.int8]
    width: int
    height: int

    @classmethod
    def of(cls, events: Events, width: int, height: int) -> Stream:
        """Return sorted `events` as a stream, those of one stamp by pixel.

        In which order a file has these is a habit of who wrote it, and no neighbours in time would
        be neighbours on the sensor as often as by chance.
        """
        t, pixel = events["t"].copy(), events["y"].astype(np.int32) * width + events["x"]
        on = events["p"].astype(np.int8)
        place = (t - t[:1]) * (width * height) + pixel
        if np.any(place[1:] < place[:-1]):  # those of pixels come in order
            order = np.argsort(place, kind="stable")
            t, pixel, on = t[order], pixel[order], on[order]
        return cls(t, pixel, on, width, height)

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start_us: float, stop_us: float) -> Stream:
        return self.chosen(slice(*np.searchsorted(self.t, [start_us, stop_us])))

    def chosen(self, which: Any) -> Stream:
        """Return some of the events, chosen by a mask, a slice or indices."""
        return Stream(self.t[which], self.pixel[which], self.on[which], self.width, self.height)

    def events(self) -> Events:
        events = np.empty(len(self), EVENT_DTYPE)
        events["t"], events["p"] = self.t, self.on
        events["y"], events["x"] = np.divmod(self.pixel, self.width)
        return events

    @cached_property
    def before(self) -> NDArray[np.int64]:
        """Index of the event before each in its pixel; its own where there is none."""
        before = np.empty(len(self), np.int64)
        _find_before(self.pixel, np.full(self.width * self.height, -1, np.int64), before)
        return before

    @cached_property
    def since(self) -> NDArray[np.int64]:
        """Time since the event before it in its pixel [us]; -1: there is none."""
        since = self.t - self.t[self.before]
        since[self.before == np.arange(len(self))] = -1
        return since

    @cached_property
    def on_before(self) -> NDArray[np.int8]:
        """Polarity of the event before it in its pixel; where there is none, its own."""
        return self.on[self.before]


@kernel
def _find_before(pixel: Any, last: Any, before: Any) -> None:
    """Compute :attr:`Stream.before`; `last`, (pixels,): -1, room for the last event of each."""
    for i in range(pixel.shape[0]):
        n = pixel[i]
        before[i] = i if last[n] < 0 else last[n]
        last[n] = i
