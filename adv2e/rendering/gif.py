"""Animated GIF, with one palette for all pictures, by PyAV.

FFmpeg's own choice of colours, like OpenCV's, is far off for events: a palette of the style's own
has them exactly.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import UsageError
from adv2e.rendering.styles import Picture, Style
from adv2e.rendering.video import VideoFile

MOST_FPS = 50.0
"""Viewers slow films down whose pictures last less than 20 ms."""

_TICK = Fraction(1, 100)
"""Unit of GIF's delays [s]."""


def palette(style: Style) -> NDArray[np.uint8]:
    """Return 256 colours for pictures in `style`: greys, shades of ON and OFF, a colour cube."""
    grey = np.rint(np.linspace(0, 255, 96))
    shades = np.linspace(0, 1, 32)[:, None]
    background = np.array(style.background, np.float64)
    on, off = (np.array(colour, np.float64) for colour in style.colours)
    red, green, blue = np.meshgrid(
        np.linspace(0, 255, 4), np.linspace(0, 255, 6), np.linspace(0, 255, 4), indexing="ij"
    )
    parts = [
        np.stack([grey] * 3, axis=1),
        background + shades * (on - background),
        background + shades * (off - background),
        np.stack([red.ravel(), green.ravel(), blue.ravel()], axis=1),
    ]
    colours: NDArray[np.uint8] = np.rint(np.concatenate(parts)).astype(np.uint8)
    return colours


class GifFile(VideoFile):
    """A GIF film that repeats for ever, written picture by picture.

    Raises
    ------
    UsageError
        `fps` is above ``MOST_FPS``.
    NotWritten
        The file cannot be written.
    """

    def __init__(self, path: Path, fps: float, style: Style) -> None:
        if fps > MOST_FPS:
            raise UsageError(f"a GIF shows at most {MOST_FPS:g} pictures a second, not {fps:g}")
        super().__init__(path, fps)
        colours = palette(style)
        self._nearest = _nearest(colours)
        self._argb = np.insert(colours, 0, 255, axis=1)

    def _open(self, width: int, height: int, **more: str) -> None:
        last = f"{self._ticks(1)}"
        super()._open(width, height, loop="0", final_delay=last, **more)
        self._stream.codec_context.time_base = _TICK

    def _frame(self, picture: Picture) -> av.VideoFrame:
        coarse = (picture >> 2).astype(np.int64)
        index = self._nearest[(coarse[..., 0] << 12) | (coarse[..., 1] << 6) | coarse[..., 2]]
        # PyAV's annotation lacks palettes, its documentation has them
        frame = av.VideoFrame.from_ndarray((index, self._argb), format="pal8")  # type: ignore[arg-type]
        frame.time_base, frame.pts = _TICK, self._ticks(self._count)
        return frame

    def _ticks(self, pictures: int) -> int:
        return round(pictures / self._rate / _TICK)  # errors of rounding do not add up


def _nearest(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the palette entry nearest to each colour of 6 bits a channel, (2**18,)."""
    # the two ends of the 64 levels stand for 0 and 255 exactly
    level = np.rint(np.arange(64) * (255 / 63)).astype(np.float32)
    green, blue = np.meshgrid(level, level, indexing="ij")
    entries = colours.astype(np.float32)
    size = np.sum(entries**2, axis=1)
    found = np.empty((64, 4096), np.uint8)
    for number, red in enumerate(level):
        plane = np.stack([np.full(4096, red), green.ravel(), blue.ravel()], axis=1)
        found[number] = np.argmin(size - 2 * (plane @ entries.T), axis=1)
    return found.ravel()
