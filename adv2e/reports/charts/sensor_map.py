"""Residuals over the sensor as pictures (PNG inside the page)."""

from __future__ import annotations

import base64

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.reports.markup import Markup, tag

Map = NDArray[np.float64]
Picture = NDArray[np.uint8]

CLIP_SD = 5.0
"""Standard deviations at which the colours end."""
_WIDTH = 440
"""Width that pictures are enlarged to, at least [pixels]."""

_ANCHORS = np.array(
    [
        (5, 48, 97),
        (33, 102, 172),
        (67, 147, 195),
        (146, 197, 222),
        (209, 229, 240),
        (247, 247, 247),
        (253, 219, 199),
        (244, 165, 130),
        (214, 96, 77),
        (178, 24, 43),
        (103, 0, 31),
    ],
    dtype=np.float64,
)
"""ColorBrewer's RdBu turned round: blue below zero, red above; safe for colour-blind readers."""
_LEVELS = 129
"""Colours in all, an odd number: the middle one is zero."""
_MASKED = (128, 128, 128)


def colours(values: Map) -> Picture:
    """Return the colour (RGB) of each of `values` [standard deviations], (..., 3) uint8.

    Clipped at +-:data:`CLIP_SD`; NaN is grey.
    """
    places = np.linspace(0, _LEVELS - 1, len(_ANCHORS))
    levels = np.arange(_LEVELS)
    table = np.column_stack([np.interp(levels, places, part) for part in _ANCHORS.T])
    table = np.vstack([np.rint(table), _MASKED]).astype(np.uint8)
    share = np.clip(values, -CLIP_SD, CLIP_SD) / (2 * CLIP_SD) + 0.5
    masked = np.isnan(share)
    index = np.rint(np.where(masked, 0.0, share) * (_LEVELS - 1)).astype(np.intp)
    picture: Picture = table[np.where(masked, _LEVELS, index)]
    return picture


def map_image(values: Map, description: str) -> Markup:
    """Return the picture of a map as an ``img`` element that holds its data.

    `values`, (rows, columns): residual in standard deviations, NaN: masked; row 0 is at the top.
    """
    return image_of(colours(values), description)


def image_of(picture: Picture, description: str) -> Markup:
    """Return a picture of a sensor, RGB (rows, columns, 3), enlarged, as an ``img`` element."""
    factor = max(1, -(-_WIDTH // max(picture.shape[:2])))
    picture = picture.repeat(factor, axis=0).repeat(factor, axis=1)
    done, data = cv2.imencode(".png", picture[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done
    encoded = base64.b64encode(data.tobytes()).decode("ascii")
    rows, columns = picture.shape[:2]
    source = f"data:image/png;base64,{encoded}"
    return tag("img", src=source, alt=description, width=columns, height=rows, class_="map")


def colour_bar() -> Markup:
    """Return the scale of the colours, as a picture."""
    scale = np.linspace(-CLIP_SD, CLIP_SD, _LEVELS)[None].repeat(6, axis=0)
    return map_image(scale, f"Colours from -{CLIP_SD:g} to +{CLIP_SD:g} standard deviations")
