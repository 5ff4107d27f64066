"""Laying out: captions, panels side by side, contact sheets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from adv2e.rendering.styles import Picture, Style

STRIP = 26
"""Height of the strip with the caption [pixels]."""

GAP = 8
"""Space between panels and between cells [pixels]."""

MOST_PIXELS = 1800
"""Width up to which a sheet is drawn unless told otherwise [pixels]."""

_FONT, _SIZE = cv2.FONT_HERSHEY_SIMPLEX, 0.45


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
    """Return the colours of paper and ink around the panels."""
    if style.name == "black":
        return (28, 28, 28), (225, 225, 225)
    return (240, 240, 240), (20, 20, 20)


def _write(picture: Picture, text: str, left: int, ink: tuple[int, int, int]) -> int:
    """Write `text` into the strip; return the column where it ends."""
    place = (left, STRIP - 9)
    cv2.putText(picture, text, place, _FONT, _SIZE, ink, 1, cv2.LINE_AA)
    return left + int(cv2.getTextSize(text, _FONT, _SIZE, 1)[0][0])


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
