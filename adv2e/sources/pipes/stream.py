"""Bytes through standard input, of which no more is believed than comes, and frames in them."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from io import BufferedIOBase
from typing import cast

from adv2e.errors import DataError
from adv2e.geometry import MOST_PIXELS
from adv2e.process.signals import Interrupt, wait_for
from adv2e.sources.frame import Image, Light, Pixels
from adv2e.sources.times.rates import FrameRate

# ---- Layout of frames in a stream: one after the other, of fixed size.


@dataclass(frozen=True)
class Layout:
    """Frames of one size, of so many bytes each.

    Attributes
    ----------
    kind : str
        ``y4m`` or ``raw``.
    nbytes : int
    pixels : callable
        Returns the pixels of a frame from its bytes and its name for messages.
    light : Light
        Encoding and white of the numbers.
    rate : FrameRate, optional
        Frame rate, where the stream states it.
    marked : bool
        A line ``FRAME`` stands before each.
    note : str
        Note on the layout.
    """

    kind: str
    nbytes: int
    pixels: Callable[[bytes, str], Pixels]
    light: Light
    rate: FrameRate | None = None
    marked: bool = False
    note: str = ""


def check_size(width: int, height: int) -> None:
    """Raise DataError unless frames may have this size."""
    if width < 1 or height < 1 or width * height > MOST_PIXELS:
        raise DataError(
            f"{NAME}: frames of {width}x{height}, must have from 1 to {MOST_PIXELS:,} pixels"
        )


def pixels_of(image: Image, bits: int, label: str) -> Pixels:
    """Return the pixels of an image of so many bits, lowest bits used; DataError if it has more."""
    white, largest = (1 << bits) - 1, int(image.max())
    if largest > white:
        raise DataError(f"{label}: a number of {largest}, above the {white} of {bits} bits")
    return Pixels(image)


def white_of(bits: int) -> float | None:
    """Return the number that means white in so many bits, if it is not that of the data type."""
    return None if bits in (8, 16) else float((1 << bits) - 1)


NAME = "standard input"

_PIECE = 1 << 16  # as much as a pipe holds, mostly


def standard_input() -> BufferedIOBase:
    """Return the stream; DataError if nothing can come through it."""
    if sys.stdin is None or sys.stdin.closed:
        raise DataError(f"{NAME}: is closed; frames must come through it")
    if sys.stdin.isatty():
        raise DataError(f"{NAME}: is a terminal; frames must come through it, as from ffmpeg")
    return cast(BufferedIOBase, sys.stdin.buffer)


class Stream:
    """A stream whose beginning can be looked at before it is read.

    Attributes
    ----------
    interrupt : Interrupt or None
        Once it came, what the pipe holds by then is all that can be read.
    pipe : int or None
        Descriptor, where others may send for as long as they please: not of a file.
    """

    def __init__(self, file: BufferedIOBase) -> None:
        self._file, self._seen = file, b""
        self.interrupt: Interrupt | None = None
        self._left: int | None = None
        self.pipe: int | None = None
        with suppress(OSError, ValueError):  # it has no descriptor
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                self.pipe = file.fileno()

    def peek(self, size: int) -> bytes:
        """Return the next bytes, fewer only where it ends; they are still to be read."""
        self._seen = self.read(size)
        return self._seen

    def read(self, size: int) -> bytes:
        """Return so many bytes, fewer only where it ends; those that never come take no memory."""
        pieces, self._seen = [self._seen[:size]], self._seen[size:]
        left = size - len(pieces[0])
        while left and (piece := self._some(min(left, _PIECE))):
            pieces.append(piece)
            left -= len(piece)
        return b"".join(pieces)

    def _some(self, most: int) -> bytes:
        """Return the next bytes, at most `most`; none at the end.

        Nothing stays in the buffer of the file, where nobody could wait for it.
        """
        if self.pipe is None:
            return self._file.read1(most)
        if self.interrupt is None:
            wait_for(self.pipe)
            return self._file.read1(most)
        if self._left is None and self.interrupt.comes_before(self.pipe):
            self._left = _waiting_in(self.pipe)
        if self._left is None:
            return self._file.read1(most)
        piece = self._file.read1(min(most, self._left)) if self._left else b""
        self._left -= len(piece)
        return piece

    def line(self, longest: int) -> bytes:
        """Return the bytes up to the end of a line, that included; no more than `longest`."""
        found = bytearray()
        while len(found) < longest and (byte := self.read(1)):
            found += byte
            if byte == b"\n":
                break
        return bytes(found)


def _waiting_in(pipe: int) -> int:
    """Return the number of bytes that were sent and not read yet."""
    import fcntl  # noqa: PLC0415 - Windows has none
    import termios  # noqa: PLC0415

    try:
        found = fcntl.ioctl(pipe, termios.FIONREAD, bytes(4))
    except OSError:  # it does not tell
        return 0
    return int.from_bytes(found, sys.byteorder)
