"""Residuals over the sensor as pictures (PNG inside the page)."""

from __future__ import annotations

import base64
import warnings

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
_MOST_COLUMNS, _MOST_ROWS = 480, 480
"""Larger maps are averaged down."""

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
    """Return the colour (RGB) of each of `values` [standard deviations].

    Parameters
    ----------
    values : (...)
        Clipped at +-:data:`CLIP_SD`; NaN is grey.

    Returns
    -------
    (..., 3) uint8
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


def reduction(values: Map) -> int:
    """Return the side of the squares of pixels that are averaged to one; 1 for usual sensors."""
    rows, columns = map(int, values.shape)
    return max(1, -(-rows // _MOST_ROWS), -(-columns // _MOST_COLUMNS))


def reduced(values: Map, side: int) -> Map:
    """Return the means over squares of side x side pixels; masked pixels do not count."""
    if side == 1:
        return values
    rows, columns = (-(-length // side) * side for length in values.shape)
    whole = np.full((rows, columns), np.nan)
    whole[: values.shape[0], : values.shape[1]] = values
    blocks = whole.reshape(rows // side, side, columns // side, side)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # squares that are masked altogether
        means: Map = np.nanmean(blocks, axis=(1, 3))
    return means


def map_image(values: Map, description: str) -> Markup:
    """Return the picture of a map as an ``img`` element that holds its data.

    Parameters
    ----------
    values : (rows, columns)
        Residual in standard deviations, NaN: masked; row 0 is at the top.
    description : str
        Alternative text.
    """
    values = reduced(values, reduction(values))
    factor = max(1, -(-_WIDTH // max(values.shape)))
    picture = colours(values).repeat(factor, axis=0).repeat(factor, axis=1)
    done, data = cv2.imencode(".png", picture[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done
    encoded = base64.b64encode(data.tobytes()).decode("ascii")
    rows, columns = picture.shape[:2]
    source = f"data:image/png;base64,{encoded}"
    return tag("img", src=source, alt=description, width=columns, height=rows, class_="map")


def colour_bar() -> Markup:
    """Return the scale of the colours, as a picture (SVG)."""
    steps = 60
    middles = (np.arange(steps) + 0.5) / steps * 2 * CLIP_SD - CLIP_SD
    parts = [tag("title", f"Colours from -{CLIP_SD:g} to +{CLIP_SD:g} standard deviations")]
    for number, (red, green, blue) in enumerate(colours(middles)):
        fill = f"#{red:02x}{green:02x}{blue:02x}"
        # each reaches under the next, so that no seam shows
        parts.append(tag("rect", x=20 + 4 * number, y=4, width=5, height=12, fill=fill))
    for value in (-CLIP_SD, 0.0, CLIP_SD):
        x = 20 + 240 * (value / CLIP_SD + 1) / 2
        sign = {-CLIP_SD: "≤ -", 0.0: "", CLIP_SD: "≥ +"}[value]
        parts.append(tag("text", f"{sign}{abs(value):g}", x=x, y=30, text_anchor="middle"))
    parts.append(
        tag("rect", x=300, y=4, width=14, height=12, fill="#{:02x}{:02x}{:02x}".format(*_MASKED))
    )
    parts.append(tag("text", "masked", x=320, y=14))
    return tag("svg", *parts, viewBox="0 0 380 36", role="img", class_="bar")
