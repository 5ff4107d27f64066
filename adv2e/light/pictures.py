"""Frames as pictures: what is stored beside the events, and what is drawn.

Whole numbers are stored as they are, so that what is read back is the same light; floats become
whole numbers of 16 bits, and all become 8 bits where the format holds no more.  Transparent pixels
are composed over black.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.effects.frames.encoding import LightDecoder, full_scale_of
from adv2e.sources.frame import Frame

if TYPE_CHECKING:
    from adv2e.light.sensor import Fitting


def _stays(dtype: DTypeLike, eight_bit: bool) -> bool:
    return np.dtype(dtype) == np.uint8 or (np.dtype(dtype) == np.uint16 and not eight_bit)


def picture_white(dtype: DTypeLike, white: float, eight_bit: bool) -> float:
    """Return the number that means white in the pictures of frames in which `white` does."""
    if _stays(dtype, eight_bit):
        return white
    return 255.0 if eight_bit else 65535.0


def picture_of(
    image: NDArray[Any],
    alpha: NDArray[Any] | None,
    decoder: LightDecoder,
    eight_bit: bool,
    fitting: Fitting | None = None,
) -> NDArray[Any]:
    """Return a frame as a picture of 8 or 16 bits, encoded as the frame is.

    With a `fitting`, it has the size of the sensor, and each channel is nearest to its light there.
    """
    picture, stored = image, decoder
    if not _stays(image.dtype, eight_bit):
        white = picture_white(image.dtype, decoder.full_scale, eight_bit)
        kind = np.uint8 if eight_bit else np.uint16
        if alpha is not None or fitting is not None:
            stored = _decoder(decoder.encoding, white, kind, decoder.colour)
        if fitting is None:
            picture = np.clip(np.rint(image * (white / decoder.full_scale)), 0, white).astype(kind)
    if fitting is not None:
        return stored.encode(map(fitting.plane, decoder.shares(image, alpha)))
    return picture if alpha is None else stored.over_black(picture, alpha)


def png_of(picture: NDArray[Any]) -> bytes:
    """Return a picture, grey or RGB, as PNG."""
    ordered = picture[..., ::-1] if picture.ndim == 3 else picture  # the colours of OpenCV
    done, data = cv2.imencode(".png", ordered)
    assert done
    return data.tobytes()


@lru_cache(maxsize=4)
def _decoder(encoding: str, white: float, dtype: type, colour: bool) -> LightDecoder:
    return LightDecoder(encoding, white, dtype, colour)


def eight_bit(image: NDArray[np.uint8 | np.uint16]) -> NDArray[np.uint8]:
    """Return a picture in 8 bits, as layouts store it that hold no more; 16 bit are rounded."""
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    return ((image.astype(np.uint32) + 128) // 257).astype(np.uint8)


def drawn(picture: NDArray[Any], white: float) -> NDArray[np.uint8]:
    """Return a picture in the 8 bits of a screen, `white` of it being 255."""
    if picture.dtype == np.uint8 and white == 255.0:
        return picture
    return np.clip(np.rint(picture * (255.0 / white)), 0, 255).astype(np.uint8)


def drawn_frame(frame: Frame, encoding: str) -> NDArray[np.uint8]:
    """Return a frame, encoded as `encoding` says, in the 8 bits of a screen."""
    dtype = frame.image.dtype
    white = frame.white or full_scale_of(dtype)
    if frame.alpha is None:
        return drawn(frame.image, white)
    decoder = LightDecoder(encoding, white, dtype, frame.image.ndim == 3)
    picture = picture_of(frame.image, frame.alpha, decoder, eight_bit=True)
    return drawn(picture, picture_white(dtype, white, eight_bit=True))
