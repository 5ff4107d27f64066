r"""Styles and layout: how the events of a window of time become a picture.

======== =========================================================================================
white    a pixel has the colour of its last event, on white; ON red and OFF blue unless told
         otherwise (other tools have them the other way round)
black    the same on black
grey     (clip(ON - OFF, -3, 3) + 3)/6: brighter for more ON, mid-grey without events (as v2e)
surface  time surface [1]_ on white: the colour of the last event, fading with its age as
         exp(-age/tau), tau a third of the window
rate     events a second over the whole time, in bins of the window (:mod:`adv2e.rendering.rate`)
======== =========================================================================================

References
----------
.. [1] X. Lagorce et al., "HOTS: A hierarchy of event-based time-surfaces for pattern recognition",
   IEEE TPAMI 39(7), 2017, doi:10.1109/TPAMI.2016.2574707.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
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


RATE = "rate"
"""The style that is a picture of all events and not of a window."""


@dataclass(frozen=True, kw_only=True)
class Style:
    """Style of pictures: a name of ``STYLES``, colours (RGB), and the window of events [us].

    Of ``RATE``, a window of 0 is as long as suits the picture.
    """

    name: str = "white"
    on: Colour = COLOURS["red"]
    off: Colour = COLOURS["blue"]
    window_us: int = 20_000

    def __post_init__(self) -> None:
        if self.name not in (*STYLES, RATE):
            raise UsageError(f"style '{self.name}': must be one of {', '.join([*STYLES, RATE])}")
        if self.window_us < (self.name != RATE):
            raise UsageError(f"window {self.window_us} us: must be at least 1 us")

    @property
    def background(self) -> Colour:
        paper = COLOURS["black" if self.name == "black" else "white"]
        return _grey_levels(0) if self.name == "grey" else paper

    @property
    def colours(self) -> tuple[Colour, Colour]:
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


# ---- Laying out: captions, panels side by side, contact sheets.


STRIP = 26
"""Height of the strip with the caption [pixels]."""

GAP = 8
"""Space between panels and between cells [pixels]."""

MOST_PIXELS = 1800
"""Width up to which a sheet is drawn unless told otherwise [pixels]."""

FONT = cv2.FONT_HERSHEY_SIMPLEX

_SIZE = 0.45


@dataclass(frozen=True)
class Cell:
    """Panels of one instant, all of the same size, and what is written above them."""

    panels: tuple[Picture, ...]
    caption: str


def default_scale(width: int) -> int:
    """Return the whole-number scale at which a panel is about 640 columns wide."""
    return max(1, round(640 / width))


def compose(cell: Cell, scale: float, style: Style) -> Picture:
    """Return the picture of a cell: the panels side by side below a strip with caption and legend.

    Whole-number scales repeat pixels; scales below 1 average them.
    """
    panels = [_scaled(panel, scale) for panel in cell.panels]
    rows, columns = panels[0].shape[:2]
    paper, ink = _paper(style)
    width = len(panels) * columns + (len(panels) - 1) * GAP
    picture = np.empty((STRIP + rows, width, 3), np.uint8)
    picture[:] = paper
    for number, panel in enumerate(panels):
        left = number * (columns + GAP)
        picture[STRIP:, left : left + columns] = panel
    _legend(picture, style, _write(picture, cell.caption, 4, ink), ink)
    return picture


def sheet(cells: Sequence[Cell], style: Style, scale: float | None = None) -> Picture:
    """Return the cells in a grid, in reading order.

    Without `scale`, pixels are repeated, or averaged, so that the sheet is at most about
    ``MOST_PIXELS`` wide.
    """
    rows, columns = cells[0].panels[0].shape[:2]
    across = len(cells[0].panels)
    grid = _columns(len(cells), columns * across, rows)
    if scale is None:
        most = MOST_PIXELS / (grid * columns * across)
        scale = min(default_scale(columns), int(most)) if most >= 1 else most
    pictures = [compose(cell, scale, style) for cell in cells]
    height, width = pictures[0].shape[:2]
    lines = -(-len(cells) // grid)
    out = np.empty((lines * (height + GAP) + GAP, grid * (width + GAP) + GAP, 3), np.uint8)
    out[:] = _paper(style)[0]
    for number, picture in enumerate(pictures):
        top = GAP + (number // grid) * (height + GAP)
        left = GAP + (number % grid) * (width + GAP)
        out[top : top + height, left : left + width] = picture
    return out


def _columns(count: int, width: int, height: int) -> int:
    """Return the number of columns that brings a grid of `count` cells closest to 4:3."""

    def off(columns: int) -> float:
        lines = -(-count // columns)
        empty = columns * lines - count
        ratio = columns * width / (lines * height)
        return abs(math.log(ratio / (4 / 3))) + 0.5 * empty / count

    return min(range(1, count + 1), key=off)


def _scaled(picture: Picture, scale: float) -> Picture:
    if scale == 1:
        return picture
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST
    rows, columns = picture.shape[:2]
    size = (max(1, round(columns * scale)), max(1, round(rows * scale)))
    return cv2.resize(picture, size, interpolation=how).astype(np.uint8)


def _paper(style: Style) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    if style.name == "black":
        return (28, 28, 28), (225, 225, 225)
    return (240, 240, 240), (20, 20, 20)


def _write(picture: Picture, text: str, left: int, ink: tuple[int, int, int]) -> int:
    """Write `text` into the strip; return the column where it ends."""
    place = (left, STRIP - 9)
    cv2.putText(picture, text, place, FONT, _SIZE, ink, 1, cv2.LINE_AA)
    return left + int(cv2.getTextSize(text, FONT, _SIZE, 1)[0][0])


def _legend(picture: Picture, style: Style, after: int, ink: tuple[int, int, int]) -> None:
    """Write the legend at the right end of the strip, if it fits behind column `after`."""
    width = 94
    left = picture.shape[1] - width
    if left < after + 8:
        return
    for name, colour, place in zip(("ON", "OFF"), style.colours, (left, left + 44), strict=True):
        cv2.rectangle(picture, (place, 8), (place + 10, 18), colour, -1)
        cv2.rectangle(picture, (place, 8), (place + 10, 18), ink, 1)
        _write(picture, name, place + 15, ink)
