r"""Styles: how the events of a window of time become a picture.

======== =========================================================================================
white    a pixel has the colour of its last event, on white; ON red and OFF blue unless told
         otherwise (other tools have them the other way round)
black    the same on black
grey     (clip(ON - OFF, -3, 3) + 3)/6: brighter for more ON, mid-grey without events (as v2e)
surface  time surface [1]_ on white: the colour of the last event, fading with its age as
         exp(-age/tau), tau a third of the window
======== =========================================================================================

References
----------
.. [1] X. Lagorce et al., "HOTS: A hierarchy of event-based time-surfaces for pattern recognition",
   IEEE TPAMI 39(7), 2017, doi:10.1109/TPAMI.2016.2574707.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import UsageError
from adv2e.events import Events, pixels_of

Picture = NDArray[np.uint8]
"""A picture (rows, columns, 3), RGB."""

Colour = tuple[int, int, int]

COLOURS: dict[str, Colour] = {
    "red": (214, 30, 36),
    "blue": (24, 84, 205),
    "green": (20, 150, 60),
    "orange": (245, 130, 20),
    "purple": (130, 50, 170),
    "cyan": (0, 170, 190),
    "yellow": (240, 200, 0),
    "black": (0, 0, 0),
    "white": (255, 255, 255),
    "grey": (128, 128, 128),
}

GREY_CLIP = 3
"""Net count at which the grey style is black or white."""

_WHITE = (255, 255, 255)
_BLACK = (0, 0, 0)


@dataclass(frozen=True, kw_only=True)
class Style:
    """Style of pictures: a name of ``STYLES``, colours (RGB), and the window of events [us]."""

    name: str = "white"
    on: Colour = COLOURS["red"]
    off: Colour = COLOURS["blue"]
    window_us: int = 20_000

    def __post_init__(self) -> None:
        if self.name not in STYLES:
            raise UsageError(f"style '{self.name}': must be one of {', '.join(STYLES)}")
        if self.window_us < 1:
            raise UsageError(f"window {self.window_us} us: must be at least 1 us")

    @property
    def background(self) -> Colour:
        """The colour of a pixel without events."""
        return {"black": _BLACK, "grey": _grey_levels(0)}.get(self.name, _WHITE)

    @property
    def colours(self) -> tuple[Colour, Colour]:
        """The colours of ON and OFF."""
        if self.name == "grey":
            return _grey_levels(GREY_CLIP), _grey_levels(-GREY_CLIP)
        return self.on, self.off


def parse_colour(text: str) -> Colour:
    """Return the RGB colour of a name or of ``#rrggbb``.

    Raises
    ------
    UsageError
        With the names there are.
    """
    if text.lower() in COLOURS:
        return COLOURS[text.lower()]
    digits = text.removeprefix("#")
    if len(digits) == 6 and all(digit in "0123456789abcdefABCDEF" for digit in digits):
        return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)
    raise UsageError(f"colour '{text}': must be #rrggbb or one of {', '.join(COLOURS)}")


def draw(events: Events, width: int, height: int, t_us: int, style: Style | None = None) -> Picture:
    """Return the picture of the events within the window that ends at `t_us`.

    Parameters
    ----------
    events : (n,) array of EVENT_DTYPE
        Sorted by time; those before `t_us` - window and those not before `t_us` are left out.
    width, height : int
        Size [pixels].
    t_us : int
        The instant [us].
    style : Style, optional

    Returns
    -------
    ndarray of uint8, (height, width, 3)
    """
    style = style or Style()
    first, last = np.searchsorted(events["t"], [t_us - style.window_us, t_us])
    return STYLES[style.name](events[first:last], width, height, t_us, style)


def _grey_levels(net: int) -> Colour:
    level = round(255 * (net + GREY_CLIP) / (2 * GREY_CLIP))
    return level, level, level


def _last_polarity(events: Events, width: int, height: int, t_us: int, style: Style) -> Picture:
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = style.background
    colours = np.array([style.off, style.on], np.uint8)
    picture[events["y"], events["x"]] = colours[events["p"]]  # of several, the last one stays
    return picture


def _net_count(events: Events, width: int, height: int, t_us: int, style: Style) -> Picture:
    pixel = pixels_of(events, width)
    sign = events["p"].astype(np.float64) * 2 - 1
    net = np.bincount(pixel, weights=sign, minlength=width * height)
    clipped = np.clip(net, -GREY_CLIP, GREY_CLIP).reshape(height, width)
    level = np.rint(255 * (clipped + GREY_CLIP) / (2 * GREY_CLIP)).astype(np.uint8)
    return np.repeat(level[:, :, None], 3, axis=2)


def _time_surface(events: Events, width: int, height: int, t_us: int, style: Style) -> Picture:
    strength = np.zeros((height, width, 1))
    age = (t_us - events["t"]) / (style.window_us / 3)
    strength[events["y"], events["x"], 0] = np.exp(-age)
    colour = _last_polarity(events, width, height, t_us, style)
    background = np.array(style.background, np.float64)
    return np.rint(background + strength * (colour - background)).astype(np.uint8)


STYLES: dict[str, Callable[[Events, int, int, int, Style], Picture]] = {
    "white": _last_polarity,
    "black": _last_polarity,
    "grey": _net_count,
    "surface": _time_surface,
}
"""The styles, by name."""
