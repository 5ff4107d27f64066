"""Layout of frames in a stream: one after the other, of fixed size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from adv2e.errors import DataError
from adv2e.geometry import MOST_PIXELS
from adv2e.sources.frame import Image, Light, Pixels
from adv2e.sources.pipes.stream import NAME
from adv2e.sources.times.rates import FrameRate


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
