"""Axes: from values to places in a picture, their ticks and labels, and how they are drawn."""

from __future__ import annotations

import itertools
import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.reports.markup import Markup, join, tag

# ---- Places and labels of the ticks of an axis.


def linear_ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Return multiples of 1, 2 or 5 times a power of ten from `low` to `high`, ascending.

    At most `most` of them, and one more; `low` is below `high` by more than rounding.
    """
    least = (high - low) / most
    exponent = math.floor(math.log10(least))
    digits = next(d for d in (1, 2, 5, 10) if float(f"{d}e{exponent}") >= least)
    step = float(f"{digits}e{exponent}")
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # from decimal text, because multiples of a float such as 0.1 are off by its rounding
    ticks = (float(f"{n * digits}e{exponent}") for n in range(first, last + 1))
    return sorted({tick + 0.0 for tick in ticks if low <= tick <= high})


def log_ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Return ticks of a logarithmic axis: powers of ten, with 2 and 5 times those if few.

    At most `most` powers of ten; `low`, above zero, is below `high`.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = max(1, math.ceil((last - first + 1) / most))
    decades = [n for n in range(first, last + 1) if n % every == 0]
    for exponents, digits in ((decades, (1,)), (range(first, last + 1), (1, 2, 5))):
        found = [float(f"{digit}e{n}") for n in exponents for digit in digits]
        ticks = [tick for tick in found if low <= tick <= high]
        if len(ticks) >= 3:
            return ticks
    return linear_ticks(low, high)


def tick_labels(ticks: Sequence[float]) -> list[str]:
    """Return the labels of `ticks`, each right to a part in a million of their distance."""
    gap = min((b - a for a, b in itertools.pairwise(ticks)), default=0.0)
    labels: list[str] = []
    for digits in range(6, 18):
        labels = [f"{tick:.{digits}g}" for tick in ticks]
        pairs = zip(labels, ticks, strict=True)
        if all(abs(float(label) - tick) <= 1e-6 * gap for label, tick in pairs):
            break
    return [re.sub(r"e\+?(-?)0*", r"e\1", label) for label in labels]


Floats = NDArray[np.float64]

_LARGEST = 1e250
"""Larger numbers are not drawn, and smaller ones than its inverse are zero: sums stay finite."""
LINE_HEIGHT = 14
"""Distance of lines of text in a picture."""
_CHARACTER = 5.9
"""Mean width of a character of the labels."""


def drawable(values: Floats) -> Floats:
    """Return `values` as floats, those that cannot be drawn as NaN."""
    values = np.asarray(values, dtype=np.float64)
    sizes = np.abs(values)
    kept = np.where(sizes < 1 / _LARGEST, 0.0, values)
    return np.where(sizes <= _LARGEST, kept, np.nan)


@dataclass(frozen=True)
class Axis:
    """An axis from `low` to `high`, which lie at `start` and `end` in the picture.

    `names`: of values, in the place of numbers at round ones.
    """

    low: float
    high: float
    start: float
    end: float
    log: bool = False
    names: Sequence[tuple[float, str]] = ()

    def place(self, values: Floats) -> Floats:
        """Return the positions of `values` on the axis; NaN where they have none, as log of 0."""
        low, high = (self._scaled(np.float64(end)) for end in (self.low, self.high))
        share = (self._scaled(values) - low) / (high - low)
        places: Floats = self.start + share * (self.end - self.start)
        return places

    def at(self, value: float) -> float:
        """Return the position of one value on the axis."""
        return float(self.place(np.asarray(value, dtype=np.float64)))

    def ticks(self) -> list[tuple[float, str]]:
        """Return places in the picture and labels."""
        if self.names:
            return [(self.at(value), name) for value, name in self.names]
        ticks = log_ticks(self.low, self.high) if self.log else linear_ticks(self.low, self.high)
        return [
            (self.at(tick), label) for tick, label in zip(ticks, tick_labels(ticks), strict=True)
        ]

    def _scaled(self, values: Floats | np.float64) -> Floats:
        if not self.log:
            return np.asarray(values, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            logarithm = np.log10(values)
        return np.where(np.isfinite(logarithm), logarithm, np.nan)


def axis_over(
    values: Iterable[Floats], start: float, end: float, *, log: bool, tight: bool = False
) -> Axis | None:
    """Return an axis that shows all `values`, or None if there is nothing to show.

    They are :func:`drawable`; a logarithm shows only those above zero.  An axis begins at zero
    where no value is below, so that heights compare as numbers do; a `tight` one at the values.
    """
    shown = np.concatenate([np.ravel(part) for part in values] or [np.empty(0)])
    shown = shown[np.isfinite(shown) & ((shown > 0) | (not log))]
    if not len(shown):
        return None
    low, high = float(shown.min()), float(shown.max())
    if log:
        return _log_axis(low, high, start, end, tight)
    if not tight and low > 0:
        low = 0.0
    room = 0.0 if tight else 0.05 * (high - low)
    size = max(abs(low), abs(high))
    if high - low <= 1e-6 * size:  # neighbouring numbers are no axis
        room = 0.5 * size or 0.5
    begins = low == 0 and (high > 0 or not tight)
    return Axis(low if begins else low - room, high + room, start, end)


def _log_axis(low: float, high: float, start: float, end: float, tight: bool) -> Axis:
    decades = math.log10(high) - math.log10(low)
    if decades < 1e-3:
        return Axis(low / 2, high * 2, start, end, log=True)
    room = 1.0 if tight else 10.0 ** (0.05 * decades)
    return Axis(low / room, high * room, start, end, log=True)


def wrapped(text: str, width: float) -> list[str]:
    """Return `text` in lines of about `width`."""
    return textwrap.wrap(text, max(8, int(width / _CHARACTER))) or [""]


def place_text(x: float, y: float, content: str, **attributes: object) -> Markup:
    """Return `content` with its base line at (x, y)."""
    return tag("text", content, x=f"{x:.1f}", y=f"{y:.1f}", **attributes)


def rule(x0: float, y0: float, x1: float, y1: float, class_: str) -> Markup:
    """Return a straight line."""
    return tag(
        "line", x1=f"{x0:.1f}", y1=f"{y0:.1f}", x2=f"{x1:.1f}", y2=f"{y1:.1f}", class_=class_
    )


def draw_axes(across: Axis, up: Axis, x_label: list[str], y_label: list[str]) -> Markup:
    """Return grid, ticks and labels; `up` starts at the bottom of the picture.

    The label of the vertical axis stands above it, where it can be read without turning the head.
    """
    left, right, bottom, top = across.start, across.end, up.start, up.end
    parts = []
    for y, label in up.ticks():
        parts.append(rule(left, y, right, y, "grid"))
        parts.append(place_text(left - 6, y + 4, label, text_anchor="end"))
    for x, label in _apart(across.ticks()):
        parts.append(rule(x, bottom, x, bottom + 4, "axis"))
        parts.append(place_text(x, bottom + 17, label, text_anchor="middle"))
    parts.append(rule(left, bottom, right, bottom, "axis"))
    for number, line in enumerate(x_label):
        y = bottom + 34 + number * LINE_HEIGHT
        parts.append(place_text((left + right) / 2, y, line, text_anchor="middle", class_="label"))
    for number, line in enumerate(reversed(y_label)):
        parts.append(place_text(4, top - 10 - number * LINE_HEIGHT, line, class_="label"))
    return join(*parts)


def _apart(ticks: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """Return the ticks whose labels do not touch the label before."""
    kept: list[tuple[float, str]] = []
    free = -math.inf
    for x, label in ticks:
        half = len(label) * _CHARACTER / 2
        if x - half >= free:
            kept.append((x, label))
            free = x + half + 6
    return kept
