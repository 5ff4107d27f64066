"""Animated GIF, written picture by picture with one palette for all.

OpenCV's writer takes all pictures at once, and the colours that it chooses are up to 72 levels off
here.  The codes come from a compiled loop: of all that draws, this alone imports Numba.

References
----------
.. [1] CompuServe, "Graphics Interchange Format, Version 89a", 1990.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.errors import UsageError
from adv2e.rendering.styles import Picture, Style

MOST_FPS = 50.0
"""Viewers slow films down whose pictures last less than 20 ms."""

_CLEAR, _END, _FIRST = 256, 257, 258  # codes of a palette of 256 colours
_MOST_CODES = 4096


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


class GifWriter:
    """A GIF film that repeats for ever; holds one picture in memory.

    Raises
    ------
    UsageError
        `fps` is above ``MOST_FPS``.
    """

    def __init__(self, path: Path, fps: float, colours: NDArray[np.uint8]) -> None:
        if fps > MOST_FPS:
            raise UsageError(f"a GIF shows at most {MOST_FPS:g} pictures a second, not {fps:g}")
        self._path, self._fps, self._colours = path, fps, colours
        self._nearest = _nearest(colours)
        self._table = np.zeros(_MOST_CODES * 256, np.int32)
        self._file: BinaryIO | None = None
        self._count = 0

    def add(self, picture: Picture) -> None:
        """Append a picture (rows, columns, 3), RGB, all of one size."""
        rows, columns = picture.shape[:2]
        if self._file is None:
            self._file = self._path.open("wb")
            self._file.write(_head(columns, rows, self._colours))
        # whole hundredths of a second, rounded so that the errors do not add up
        ends = [round(100 * number / self._fps) for number in (self._count, self._count + 1)]
        self._file.write(struct.pack("<BBBBHBB", 0x21, 0xF9, 4, 4, ends[1] - ends[0], 0, 0))
        self._file.write(struct.pack("<BHHHHBB", 0x2C, 0, 0, columns, rows, 0, 8))
        coarse = (picture >> 2).astype(np.int64)
        index = self._nearest[(coarse[..., 0] << 12) | (coarse[..., 1] << 6) | coarse[..., 2]]
        self._file.write(_blocks(compress(index.ravel(), self._table)))
        self._count += 1

    def finish(self) -> None:
        """Complete the file."""
        if self._file is not None:
            self._file.write(b"\x3b")
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        if self._file is not None:
            self._file.close()


def _head(columns: int, rows: int, colours: NDArray[np.uint8]) -> bytes:
    """Return header, palette and the extension that makes viewers repeat the film."""
    screen = struct.pack("<6sHHBBB", b"GIF89a", columns, rows, 0xF7, 0, 0)
    again = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
    return screen + colours.tobytes() + again


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


def _blocks(data: bytes) -> bytes:
    """Return `data` cut into blocks of up to 255 bytes, each led by its length."""
    parts = [data[start : start + 255] for start in range(0, len(data), 255)]
    return b"".join(bytes([len(part)]) + part for part in parts) + b"\0"


def compress(pixels: NDArray[np.uint8], table: NDArray[np.int32] | None = None) -> bytes:
    """Return the LZW codes of `pixels`, (n,), for a palette of 256 colours.

    `table` is scratch memory, 2**20 zeros at first, that calls may share.
    """
    if table is None:
        table = np.zeros(_MOST_CODES * 256, np.int32)
    table[:] = 0
    out = np.empty(2 * pixels.size + 64, np.uint8)
    return out[: _lzw(pixels, table, out)].tobytes()


@kernel
def _lzw(pixels: NDArray[np.uint8], table: NDArray[np.int32], out: NDArray[np.uint8]) -> int:
    """Fill `out`; return its length.  `table[code*256 + pixel]`: the longer code, or older junk.

    Entries carry the number of the table they belong to above bit 12, so that starting a new table
    costs nothing.
    """
    written, bits, waiting = 0, 0, 0
    generation, width, following = 1, 9, _FIRST
    bits |= _CLEAR
    waiting += width
    prefix = np.int64(pixels[0])
    for i in range(1, pixels.size + 1):
        last = i == pixels.size
        place = prefix * 256 + (0 if last else np.int64(pixels[i]))
        if not last and table[place] >> 12 == generation:
            prefix = table[place] & 4095
            continue
        bits |= int(prefix) << waiting
        waiting += width
        while waiting >= 8:
            out[written] = bits & 255
            written += 1
            bits >>= 8
            waiting -= 8
        if last:
            if following == 1 << width and width < 12:
                width += 1  # a reader makes one more entry before it comes to the end code
            break
        if following < _MOST_CODES:
            table[place] = generation << 12 | following
            if following == 1 << width:
                width += 1
            following += 1
        else:
            bits |= _CLEAR << waiting
            waiting += width
            generation += 1
            width, following = 9, _FIRST
        prefix = np.int64(pixels[i])
    bits |= _END << waiting
    waiting += width
    while waiting > 0:
        out[written] = bits & 255
        written += 1
        bits >>= 8
        waiting -= 8
    return written
