"""Transparent pixels: one rule for the images of all formats.

They are composed over black, in linear light: the light of a pixel is that of its colour times its
alpha.  Colours that a file has multiplied by alpha already are divided by it first where they are
encoded whole numbers, as those are not light; where they are floats, they are light over black.
"""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.sources.frame import Frame, Image


class Alpha(Enum):
    """Meaning of the alpha channel of a file."""

    STRAIGHT = "straight"
    MULTIPLIED = "multiplied"
    UNSAID = "unsaid"
    NONE = "none"


def with_alpha(colours: Image, alpha: NDArray[Any], kind: Alpha, most: float, label: str) -> Frame:
    """Return a frame of grey or RGB colours with alpha of their data type.

    `most` is the alpha of pixels that are all there, and white of whole numbers; `label` is the
    name of the file, for messages.

    Raises
    ------
    DataError
        The file does not say what the channel is, and it is not the same everywhere.
    """
    if kind is Alpha.NONE or float(alpha.min()) >= most:
        return Frame(colours)
    if kind is Alpha.UNSAID:
        raise DataError(
            f"{label}: a channel beyond the colours, and its header does not say that it is alpha"
            " (ExtraSamples); write the image without it"
        )
    share = np.clip(alpha.astype(np.float32) / np.float32(most), 0, 1)
    if kind is Alpha.STRAIGHT:
        return Frame(colours, share)
    if colours.dtype.kind == "f":
        return Frame(colours, composed=True)
    return Frame(_divided(colours, share, most), share)


def _divided(colours: Image, share: NDArray[np.float32], most: float) -> Image:
    by = share if colours.ndim == 2 else share[..., np.newaxis]
    whole = np.divide(colours, by, out=np.zeros(colours.shape, np.float32), where=by > 0)
    return np.minimum(np.rint(whole), most).astype(colours.dtype)
