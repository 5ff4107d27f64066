"""Sizes and rectangles of pixels, as they are written: ``346x260`` and ``x,y,width,height``."""

from __future__ import annotations

import re
from typing import NamedTuple

MOST_PIXELS = 1 << 25
"""Pixels of the largest sensor: 8192x4096."""

_SIZE = re.compile(r"(\d{1,9})[xX](\d{1,9})", re.ASCII)
_RECTANGLE = re.compile(r"(\d{1,9}),(\d{1,9}),(\d{1,9}),(\d{1,9})", re.ASCII)


class Size(NamedTuple):
    """Columns and rows of a picture or a sensor."""

    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.width}x{self.height}"


class Rectangle(NamedTuple):
    """A part of a picture: its first column and row, and its size [pixels]."""

    x: int
    y: int
    width: int
    height: int

    def __str__(self) -> str:
        return ",".join(map(str, self))

    def is_inside(self, width: int, height: int) -> bool:
        """Tell whether a picture of that size holds all of it."""
        return self.x + self.width <= width and self.y + self.height <= height


def parse_size(given: str | tuple[int, ...]) -> Size:
    """Return the size that a text, or numbers, say.

    Raises
    ------
    ValueError
        It is none; the text says what one is.

    Examples
    --------
    >>> parse_size("346x260")
    Size(width=346, height=260)
    """
    text = "x".join(map(str, given)) if isinstance(given, (tuple, list)) else str(given)
    found = _SIZE.fullmatch(text.replace(" ", ""))
    size = Size(*map(int, found.groups())) if found else Size(0, 0)
    if min(size) < 1:
        raise ValueError(f"must be columns x rows, such as 346x260, got {text!r}")
    return size


def parse_rectangle(given: str | tuple[int, ...]) -> Rectangle:
    """Return the rectangle that a text, or numbers, say.

    Raises
    ------
    ValueError
        It is none; the text says what one is.

    Examples
    --------
    >>> parse_rectangle("10,0,320,240")
    Rectangle(x=10, y=0, width=320, height=240)
    """
    text = given if isinstance(given, str) else ",".join(map(str, given))
    found = _RECTANGLE.fullmatch(text.replace(" ", ""))
    part = Rectangle(*map(int, found.groups())) if found else Rectangle(0, 0, 0, 0)
    if min(part.width, part.height) < 1:
        raise ValueError(
            f"must be first column, first row, columns, rows, such as 10,0,320,240, got {text!r}"
        )
    return part
