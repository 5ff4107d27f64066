"""Mosaics: frames as a sensor with a colour filter gives them, one number a pixel, made colour.

Colours between are interpolated linearly, which is right for light: a mosaic is what the sensor
measured, without a curve.  Neither white balance nor a matrix of the camera is applied.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from adv2e.errors import DataError
from adv2e.options import BAYER
from adv2e.sources.frame import Frame, Light, Shot

# OpenCV's own names are those of the second and third pixel of the second row
_CODES = {pattern: getattr(cv2, f"COLOR_Bayer{pattern}2RGB") for pattern in BAYER}
_SMALLEST = 4


def light_of(pattern: str) -> Light:
    """Return the encoding of a mosaic: linear light."""
    return Light("linear", f"a mosaic of {pattern}", is_stated=True)


def in_colour(shot: Shot, pattern: str) -> Shot:
    """Return a shot of a mosaic as one in colour."""
    return replace(shot, load=partial(_load, shot.load, pattern, shot.label))


def _load(load: Callable[[], Frame], pattern: str, label: str) -> Frame:
    mosaic = load()
    image = mosaic.image
    if image.ndim != 2 or mosaic.alpha is not None or mosaic.composed:
        raise DataError(
            f"{label}: --bayer {pattern}: a mosaic has one number a pixel, this has more"
        )
    if image.dtype not in (np.uint8, np.uint16):
        raise DataError(
            f"{label}: --bayer {pattern}: a mosaic must be of uint8 or uint16, this is of"
            f" {image.dtype.name}"
        )
    if min(image.shape) < _SMALLEST:
        raise DataError(
            f"{label}: --bayer {pattern}: a mosaic must have {_SMALLEST} rows and columns at least"
        )
    colour = cv2.cvtColor(np.ascontiguousarray(image), _CODES[pattern])
    return Frame(np.asarray(colour), white=mosaic.white)
