"""Y4M (YUV4MPEG2), as FFmpeg writes it through a pipe: ``-f yuv4mpegpipe -``.

References
----------
.. [1] MJPEG Tools, yuv4mpeg(5): the header and its tags; ``FRAME`` lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from adv2e.errors import DataError
from adv2e.sources.frame import Light, Pixels
from adv2e.sources.pipes.stream import NAME, Layout, Stream, check_size, pixels_of, white_of
from adv2e.sources.times.rates import FrameRate, parse_rate
from adv2e.sources.video.pictures import UNSTATED, encoding_of, rgb_of_planes

MAGIC = b"YUV4MPEG2 "
LONGEST_LINE = 1024
_SHARED = {"mono": (0, 0), "420": (2, 2), "422": (2, 1), "444": (1, 1)}
"""Columns and rows of luma that share a sample of each chroma; none without chroma."""
_PIXELS = re.compile(r"(mono|420|422|444)(?:(?<=420)(?:jpeg|mpeg2|paldv))?(?:p?(\d{1,2}))?", re.A)
_NOTE = (
    "Y4M does not say by which matrix its colours were made: BT.601 is taken; else send"
    " -f rawvideo -pix_fmt rgb24"
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
        """Bytes of all planes."""
        each = 2 if self.bits > 8 else 1
        return sum(rows * columns * each for rows, columns in self.shapes)

    def pixels(self, data: bytes, label: str) -> Pixels:
        """Return the pixels of a frame."""
        numbers = np.frombuffer(data, "<u2" if self.bits > 8 else "u1")
        planes, at = [], 0
        for rows, columns in self.shapes:
            planes.append(numbers[at : at + rows * columns].reshape(rows, columns))
            at += rows * columns
        kind = f"u{numbers.itemsize}"
        if len(planes) == 1 and self.full:
            return pixels_of(planes[0].astype(kind), self.bits, label)
        codes = [plane.astype(np.float32) for plane in planes]
        if len(planes) == 1:
            image = (codes[0] - np.float32(16 << self.bits - 8)) / np.float32(219 << self.bits - 8)
        else:
            image = rgb_of_planes(codes, UNSTATED, self.bits, full=self.full)
        whole = np.rint(np.clip(image, 0, 1) * ((1 << self.bits) - 1)).astype(kind)
        return pixels_of(np.ascontiguousarray(whole), self.bits, label)


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
        picture.pixels,
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
