"""Sizes and rectangles of pixels, as they are written: ``346x260`` and ``x,y,width,height``."""

from __future__ import annotations

import re
from typing import NamedTuple

MOST_PIXELS = 1 << 25
"""Pixels of the largest sensor: 8192x4096."""


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
    return Size(*_numbers(given, "x", 2, "columns x rows, such as 346x260"))


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
    wanted = "first column, first row, columns, rows, such as 10,0,320,240"
    return Rectangle(*_numbers(given, ",", 4, wanted))


def _numbers(given: str | tuple[int, ...], mark: str, count: int, wanted: str) -> list[int]:
    """Return so many numbers, with a mark between them, of which the last two are above zero."""
    text = mark.join(map(str, given)) if isinstance(given, (tuple, list)) else str(given)
    words = re.split(mark, text.replace(" ", ""), flags=re.IGNORECASE)
    if len(words) == count and all(re.fullmatch(r"\d{1,9}", word, re.ASCII) for word in words):
        numbers = list(map(int, words))
        if min(numbers[-2:]) > 0:
            return numbers
    raise ValueError(f"must be {wanted}, got {text!r}")
