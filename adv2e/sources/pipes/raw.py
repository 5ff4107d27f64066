"""Raw video: numbers without a header, of a size and a kind that the user states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from adv2e.geometry import Size
from adv2e.sources.frame import Light, Pixels
from adv2e.sources.pipes.stream import Layout, check_size, pixels_of, white_of


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
    return Layout("raw", nbytes, partial(_pixels, size, form), light)


def _pixels(size: Size, form: _Format, data: bytes, label: str) -> Pixels:
    dtype = np.dtype(form.dtype)
    numbers = np.frombuffer(data, dtype).reshape(size.height, size.width, -1)
    channels = form.channels if len(form.channels) > 1 else form.channels[0]
    image = np.require(numbers[..., channels], dtype.newbyteorder("="), ["C", "W"])
    return pixels_of(image, form.bits, label)
