"""A frame, and what the numbers in it stand for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import encoding_of_images, full_scale_of
from adv2e.errors import DataError
from adv2e.sources.paths import Offset

Image = NDArray[Any]
"""(rows, columns) or (rows, columns, 3) RGB; uint8, uint16, float32 or float64."""


LARGEST = 1 << 27
"""Pixels of the largest frame: 16384x8192, which holds video of 16K and pictures of any camera."""


def check_pixels(width: int, height: int, label: str) -> None:
    """Raise DataError if a frame has more pixels than are read, best before room is made for it."""
    if width * height > LARGEST:
        raise DataError(
            f"{label}: {width}x{height} pixels; frames of more than {LARGEST:,} pixels (16384x8192)"
            " are not read: make it smaller"
        )


@dataclass(frozen=True)
class Pixels:
    """An image as its file has it.

    Attributes
    ----------
    image : array
        Grey or RGB.
    alpha : (rows, columns) float32, optional
        How much of each pixel is there, 0..1; None: all of it.  The colours are not multiplied
        by it.
    composed : bool
        The file has transparent pixels, and its colours are light over black already.
    white : float, optional
        Number that means white, where the file says it and it is not that of the data type.
    offset : (float, float), optional
        Where on it the sensor looks, from the middle: to the right and down [its pixels].
    encoding, says : str
        What its file states of the numbers, if it does, and how; what else is to be told of that.
    densities : (int, int)
        Pixels a unit of length, across and down.
    """

    image: Image
    alpha: NDArray[np.float32] | None = None
    composed: bool = False
    white: float | None = None
    offset: Offset | None = None
    encoding: str = ""
    says: str = ""
    densities: tuple[int, int] = (1, 1)


OVER_BLACK = "transparent pixels are composed over black, in linear light"
"""Note on a source with transparent pixels, given once."""


RECORDED = "frames of a recording"
"""Reason for linear frames in recordings of event cameras."""


@dataclass(frozen=True)
class Light:
    """Encoding and white of the numbers of frames, with the reasons in a few words.

    Attributes
    ----------
    encoding : str
        Encoding for ``encoding: auto``.
    encoding_reason : str
    full_scale : float, optional
        Number that means white, whatever the files of the frames say of it.
    full_scale_reason : str
        Empty where the reason is the same, or the data type says it.
    is_guess : bool
        Such numbers stand for other light nearly as often.
    """

    encoding: str
    encoding_reason: str
    full_scale: float | None = None
    full_scale_reason: str = ""
    is_guess: bool = False


@dataclass(frozen=True)
class Frame:
    """One frame.

    Attributes
    ----------
    t_ns : int
        Its time [ns].
    image : array
        As read, colour as RGB.
    label : str
        Its name, for messages.
    alpha : array, optional
        See :class:`Pixels`.
    white : float, optional
        Number that means white in it; None: that of the data type.
    odd_white : str
        How the white that its file states differs from that of the first frame.
    offset : (float, float), optional
        See :class:`Pixels`.
    """

    t_ns: int
    image: Image
    label: str = ""
    alpha: NDArray[np.float32] | None = None
    white: float | None = None
    odd_white: str = ""
    offset: Offset | None = None


@dataclass(frozen=True)
class Shot:
    """A frame not loaded yet: time on the source's clock [ns], name for messages, loader."""

    t_ns: int
    label: str
    load: Callable[[], Pixels]


def rotated180(pixels: Pixels) -> Pixels:
    """Return an image turned by half a turn."""
    alpha = None if pixels.alpha is None else np.ascontiguousarray(pixels.alpha[::-1, ::-1])
    return replace(pixels, image=np.ascontiguousarray(pixels.image[::-1, ::-1]), alpha=alpha)


def odd_white(pixels: Pixels, first: float | None) -> str:
    """Return a complaint if the white of an image differs from `first`, that of the first image.

    None stands for the white of the data type.  In a black image the white does not matter.
    """
    usual = full_scale_of(pixels.image.dtype)
    white, expected = pixels.white or usual, first or usual
    if white == expected or not pixels.image.any():
        return ""
    return (
        f"white is {white:g} in it, but {expected:g} in the first frame; say what it is in all,"
        f" with frames.full_scale={expected:g} or another number"
    )


def as_pixels(loaded: Image | Pixels) -> Pixels:
    """Return the result of a loader as pixels."""
    return loaded if isinstance(loaded, Pixels) else Pixels(loaded)


def light_of_images(pixels: Pixels, name: str = "images") -> Light:
    """Return the encoding of images, or of arrays (`name`), and the reason.

    It is the one that they state, else the usual one.  8-bit pictures are sRGB, nearly always in
    colour; grey ones may be a camera's own numbers, and 16-bit ones are written by cameras and by
    photo editors alike.
    """
    if pixels.encoding:
        return Light(pixels.encoding, pixels.says)
    dtype, colour = pixels.image.dtype, pixels.image.ndim == 3
    depth = "floating-point" if dtype.kind == "f" else f"{8 * dtype.itemsize}-bit"
    reason = f"{depth} {'colour' if colour else 'grey'} {name}"
    if pixels.says:
        reason += f"; {pixels.says}"
    is_guess = dtype.kind != "f" and not (colour and dtype == np.uint8)
    return Light(encoding_of_images(dtype), reason, is_guess=is_guess)


def check_values(image: Image, label: str) -> None:
    """Raise DataError if a float image holds NaN, infinite or negative values."""
    if image.dtype.kind != "f" or image.size == 0:
        return
    low, high = float(image.min()), float(image.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise DataError(f"{label}: pixels that are NaN or infinite; light must be a finite number")
    if low < 0:
        raise DataError(f"{label}: a pixel of {low:g}; light cannot be negative")
