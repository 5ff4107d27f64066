"""Pictures of the sensor (PNG inside the page): events of a short time, and residuals."""

from __future__ import annotations

import base64
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.rendering.styles import COLOURS
from adv2e.reports.markup import Markup, tag
from adv2e.reports.result import Snapshot

# ---- Events of a short time as pictures (PNG inside the page), in colours that compare.


_FAINTEST = 0.4
"""Strength of the colour of a single event, where full colour is more."""
_LOUD = 0.99
"""Share of the pixels with events that are not brighter than full colour."""


def top_of(snapshot: Snapshot) -> int:
    """Return the number of events of a pixel that has full colour in all pictures."""
    every = np.concatenate(
        [one.ravel() for one in (snapshot.measured, snapshot.before, snapshot.after)]
    )
    some = every[every > 0]
    return int(np.quantile(some, _LOUD, method="lower")) if some.size else 1


def event_colours(number: NDArray[Any], top: int) -> NDArray[np.uint8]:
    """Return the colour (RGB) of numbers of OFF and ON events, (2, ...), as (..., 3) uint8.

    White without any, red with ON, blue with OFF, purple with both; the more, the stronger, up to
    `top`.
    """
    share = np.minimum(number, top) / top
    strength = np.where(number > 0, _FAINTEST + (1.0 - _FAINTEST) * share, 0.0)[..., None]
    inks = [1.0 - np.array(COLOURS[name]) / 255.0 for name in ("blue", "red")]
    light = np.prod([1.0 - one * ink for one, ink in zip(strength, inks, strict=True)], axis=0)
    return np.asarray(np.rint(255.0 * light), np.uint8)


def event_picture(number: NDArray[Any], top: int, description: str) -> Markup:
    """Return numbers of OFF and ON events, (2, rows, columns), as an ``img`` element."""
    return image_of(event_colours(number, top), description)


# ---- Residuals over the sensor as pictures (PNG inside the page).


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
