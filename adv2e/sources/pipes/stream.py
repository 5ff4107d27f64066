"""Bytes through standard input, of which no more is believed than comes, and frames in them."""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from io import BufferedIOBase
from typing import cast

import numpy as np

from adv2e.errors import DataError
from adv2e.geometry import MOST_PIXELS, Size
from adv2e.label import guessed
from adv2e.process.signals import Interrupt, wait_for
from adv2e.sources.frame import Frame, Image, Light
from adv2e.sources.times.rates import FrameRate, parse_rate
from adv2e.sources.video.pictures import UNSTATED, encoding_of, rgb_of_planes

# ---- Layout of frames in a stream: one after the other, of fixed size.


@dataclass(frozen=True)
class Layout:
    """Frames of one size, of so many bytes each.

    Attributes
    ----------
    kind : str
        ``y4m`` or ``raw``.
    nbytes : int
    frame : callable
        Returns a frame from its bytes and its name for messages.
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
    frame: Callable[[bytes, str], Frame]
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


def in_range(image: Image, bits: int, label: str) -> Frame:
    """Return an image of so many bits, lowest bits used, as a frame; DataError if it has more."""
    white, largest = (1 << bits) - 1, int(image.max())
    if largest > white:
        raise DataError(f"{label}: a number of {largest}, above the {white} of {bits} bits")
    return Frame(image)


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
        """Return the next `size` bytes, fewer at the end; those that never come take no memory."""
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


# ---- Y4M (YUV4MPEG2), as FFmpeg writes it through a pipe: ``-f yuv4mpegpipe -``.
#
# References
# ----------
# .. [1] MJPEG Tools, yuv4mpeg(5): the header and its tags; ``FRAME`` lines.


MAGIC = b"YUV4MPEG2 "
LONGEST_LINE = 1024
_SHARED = {"mono": (0, 0), "420": (2, 2), "422": (2, 1), "444": (1, 1)}
"""Columns and rows of luma that share a sample of each chroma; none without chroma."""
_PIXELS = re.compile(r"(mono|420|422|444)(?:(?<=420)(?:jpeg|mpeg2|paldv))?(?:p?(\d{1,2}))?", re.A)
_HOW = "send -f rawvideo -pix_fmt rgb24"
_NOTE = guessed(
    f"Y4M does not say by which matrix its colours were made: BT.601 is taken; else {_HOW}",
    *("matrix of colours", "BT.601", _HOW),
)


@dataclass(frozen=True)
class _Picture:
    """Size, columns and rows that share chroma, bits, and whether all codes are in use."""

    width: int
    height: int
    across: int
    down: int
    bits: int
    full: bool

    @property
    def shapes(self) -> list[tuple[int, int]]:
        """Rows and columns of the planes."""
        luma = self.height, self.width
        if not self.across:
            return [luma]
        return [luma, *2 * [(-(-self.height // self.down), -(-self.width // self.across))]]

    @property
    def nbytes(self) -> int:
        each = 2 if self.bits > 8 else 1
        return sum(rows * columns * each for rows, columns in self.shapes)

    def frame(self, data: bytes, label: str) -> Frame:
        numbers = np.frombuffer(data, "<u2" if self.bits > 8 else "u1")
        planes, at = [], 0
        for rows, columns in self.shapes:
            planes.append(numbers[at : at + rows * columns].reshape(rows, columns))
            at += rows * columns
        kind = f"u{numbers.itemsize}"
        if len(planes) == 1 and self.full:
            return in_range(planes[0].astype(kind), self.bits, label)
        codes = [plane.astype(np.float32) for plane in planes]
        if len(planes) == 1:
            image = (codes[0] - np.float32(16 << self.bits - 8)) / np.float32(219 << self.bits - 8)
        else:
            image = rgb_of_planes(codes, UNSTATED, self.bits, full=self.full)
        whole = np.rint(np.clip(image, 0, 1) * ((1 << self.bits) - 1)).astype(kind)
        return in_range(np.ascontiguousarray(whole), self.bits, label)


def y4m_layout(stream: Stream) -> Layout:
    """Read the header of a stream, and return the layout of its frames.

    Raises
    ------
    DataError
        A header that cannot be read, or pictures that are not; says what FFmpeg should write.
    """
    line = stream.line(LONGEST_LINE)
    if not line.startswith(MAGIC) or not line.endswith(b"\n"):
        raise DataError(f"{NAME}: Y4M whose header does not end: damaged")
    tags = line[len(MAGIC) :].decode("latin-1").split()
    stated = {tag[0]: tag[1:] for tag in tags if tag[0] != "X"}
    size = [stated.get(tag, "") for tag in "WH"]
    if not all(re.fullmatch(r"\d{1,9}", text, re.A) for text in size):
        raise DataError(f"{NAME}: Y4M whose header does not state width and height: damaged")
    width, height = map(int, size)
    check_size(width, height)
    if stated.get("I", "p") not in ("p", "?"):
        raise DataError(
            f"{NAME}: interlaced Y4M (I{stated['I'][:9]}); make whole pictures of it: -vf bwdif"
        )
    colours = stated.get("C", "420jpeg")
    form = _PIXELS.fullmatch(colours)
    bits = int(form[2] or 8) if form else 0
    if form is None or not 8 <= bits <= (16 if form[1] == "mono" else 8):
        raise DataError(
            f"{NAME}: Y4M with pixels of {colours[:20]!r}; write others: -pix_fmt yuv420p, yuv422p,"
            " yuv444p or gray, or, with -strict -1, gray10le, gray12le or gray16le"
        )
    grey = form[1] == "mono"
    full = ("XCOLORRANGE=LIMITED" not in tags) if grey else ("XCOLORRANGE=FULL" in tags)
    picture = _Picture(width, height, *_SHARED[form[1]], bits, full)
    light = Light(*encoding_of(UNSTATED))
    if bits > 8:
        light = Light("linear", f"Y4M, grey of {bits} bits", white_of(bits))
    return Layout(
        "y4m",
        picture.nbytes,
        picture.frame,
        light,
        _rate(stated.get("F", "0:0")),
        marked=True,
        note="" if grey else _NOTE,
    )


def _rate(stated: str) -> FrameRate | None:
    """Return the rate that a header states; None if it is not known."""
    if not re.fullmatch(r"\d{1,10}:\d{1,10}", stated, re.A):
        raise DataError(f"{NAME}: Y4M with a frame rate of {stated[:20]!r}: damaged")
    above, _, below = stated.partition(":")
    if not int(above) or not int(below):
        return None
    try:
        return FrameRate(parse_rate(f"{above}/{below}"))
    except ValueError as error:
        raise DataError(f"{NAME}: Y4M with a frame rate that cannot be: {error}") from error


# ---- Raw video: numbers without a header, of a size and a kind that the user states.


@dataclass(frozen=True)
class _Format:
    """Pixel format: order of the channels (0 is red, or grey), data type, bits."""

    channels: tuple[int, ...]
    dtype: str
    bits: int


_FORMATS = {
    "gray": _Format((0,), "u1", 8),
    "gray10le": _Format((0,), "<u2", 10),
    "gray12le": _Format((0,), "<u2", 12),
    "gray14le": _Format((0,), "<u2", 14),
    "gray16le": _Format((0,), "<u2", 16),
    "rgb24": _Format((0, 1, 2), "u1", 8),
    "bgr24": _Format((2, 1, 0), "u1", 8),
    "rgb48le": _Format((0, 1, 2), "<u2", 16),
}
"""Pixel formats by their names in FFmpeg (``-pix_fmt``)."""

PIXEL_FORMATS = tuple(_FORMATS)


def raw_layout(size: Size, name: str) -> Layout:
    """Return the layout of frames of a size, in pixels of one of `PIXEL_FORMATS`.

    Raises
    ------
    DataError
        Frames larger than any.
    """
    check_size(*size)
    form = _FORMATS[name]
    deep = form.bits > 8 and len(form.channels) == 1
    light = Light("linear" if deep else "srgb", f"raw video of {name}", white_of(form.bits))
    nbytes = size.width * size.height * len(form.channels) * np.dtype(form.dtype).itemsize
    return Layout("raw", nbytes, partial(_frame, size, form), light)


def _frame(size: Size, form: _Format, data: bytes, label: str) -> Frame:
    dtype = np.dtype(form.dtype)
    numbers = np.frombuffer(data, dtype).reshape(size.height, size.width, -1)
    channels = form.channels if len(form.channels) > 1 else form.channels[0]
    image = np.require(numbers[..., channels], dtype.newbyteorder("="), ["C", "W"])
    return in_range(image, form.bits, label)
