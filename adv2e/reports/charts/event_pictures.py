"""Events of a short time as pictures (PNG inside the page), in colours that compare."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.rendering.styles import COLOURS
from adv2e.reports.charts.sensor_map import image_of
from adv2e.reports.markup import Markup
from adv2e.reports.result import Snapshot

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
