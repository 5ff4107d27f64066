"""Rates of ON and OFF events over time: counts in bins, and their picture with axes."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import UsageError
from adv2e.events import Events
from adv2e.rendering.styles import FONT, GAP, Colour, Picture, Style

_LEAST_US = 100
"""Least length of a bin unless told otherwise [us]: one event is no rate of a million a second."""
_MOST_BINS = 100_000


class Rates:
    """Counts of events in bins of time.

    Parameters
    ----------
    begin_us, stop_us : int
        The time to count in, half open [us].
    bins : int
        Most bins.
    width_us : int
        Length of a bin in place of a round one that `bins` asks for [us]; 0: none is given.

    Attributes
    ----------
    counts : array of int64, (2, bins)
        Of OFF and of ON events.
    edges_us : array of int64, (bins + 1,)
        Where bins begin and end [us]; the last one may be shorter.

    Raises
    ------
    UsageError
        Bins of that length are too many.
    """

    def __init__(self, begin_us: int, stop_us: int, bins: int, width_us: int = 0) -> None:
        length = max(stop_us - begin_us, _LEAST_US)
        stop_us, least = begin_us + length, max(_LEAST_US, -(-length // bins))
        power = 10 ** (len(str(least)) - 1)
        nice = next(power * digits for digits in (1, 2, 5, 10) if power * digits >= least)
        self.width_us = width_us or nice
        number = -(-length // self.width_us)
        if number > _MOST_BINS:
            raise UsageError(
                f"--window is too short: {number:,} of them, where a picture of the rate has at"
                f" most {_MOST_BINS:,}"
            )
        self.counts = np.zeros((2, number), np.int64)
        edges_us = begin_us + self.width_us * np.arange(number + 1, dtype=np.int64)
        self.edges_us = np.minimum(edges_us, stop_us)

    def add(self, events: Events) -> None:
        """Count events of that time."""
        bins = self.counts.shape[1]
        place = (events["t"] - self.edges_us[0]) // self.width_us
        place += events["p"].astype(np.int64) * bins
        self.counts += np.bincount(place, minlength=2 * bins).reshape(2, bins)

    @property
    def per_second(self) -> NDArray[np.float64]:
        """Rates of OFF and of ON events [1/s], (2, bins)."""
        rates: NDArray[np.float64] = self.counts / (np.diff(self.edges_us) * 1e-6)
        return rates


# ---- The picture: steps of ON, OFF and both together, over axes with units.


_SIZE = (960, 340)
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 16, 44, 52
"""Space around the axes [pixels]."""
_UNITS = ((1e6, "million events a second"), (1e3, "thousand events a second"))
_PAPER, _INK, _LINE = (255, 255, 255), (20, 20, 20), (217, 217, 217)


def rate_picture(rates: Rates, origin_us: int, style: Style, scale: int = 1) -> Picture:
    """Return the picture of rates; times are counted from `origin_us`."""
    columns, rows = _SIZE
    picture = np.full((rows * scale, columns * scale, 3), _PAPER, np.uint8)
    seconds = (rates.edges_us - origin_us) * 1e-6
    off, on = rates.per_second
    top = float((on + off).max()) * 1.05 or 1.0
    unit, words = next((one for one in _UNITS if top >= one[0]), (1.0, "events a second"))
    bottom, right = rows - _BOTTOM, columns - _RIGHT
    x = _LEFT + (right - _LEFT) * (seconds - seconds[0]) / (seconds[-1] - seconds[0])

    def across(points: Sequence[tuple[float, float]], colour: Colour) -> None:
        corners = np.rint(np.array(points) * scale * 16).astype(np.int32)
        cv2.polylines(picture, [corners], False, colour, scale, cv2.LINE_AA, 4)

    def write(text: str, x: float, y: float, anchor: float = 0.0, colour: Colour = _INK) -> float:
        (length, _), _ = cv2.getTextSize(text, FONT, 0.42 * scale, scale)
        place = (round(x * scale - anchor * length), round(y * scale))
        cv2.putText(picture, text, place, FONT, 0.42 * scale, colour, scale, cv2.LINE_AA)
        return x + length / scale

    ticks = linear_ticks(0.0, top / unit, 5)
    for tick, label in zip(ticks, tick_labels(ticks), strict=True):
        y = bottom - (bottom - _TOP) * tick * unit / top
        across([(_LEFT, y), (right, y)], _INK if tick == 0 else _LINE)
        write(label, _LEFT - 6, y + 4, 1.0)
    ticks = linear_ticks(float(seconds[0]), float(seconds[-1]), 8)
    for tick, label in zip(ticks, tick_labels(ticks), strict=True):
        at = _LEFT + (right - _LEFT) * (tick - seconds[0]) / (seconds[-1] - seconds[0])
        across([(at, bottom), (at, bottom + 4)], _INK)
        write(label, at, bottom + 18, 0.5)
    write("time [s]", (_LEFT + right) / 2, rows - 14, 0.5)
    write(f"{words}, in bins of {rates.width_us / 1e3:g} ms", GAP, 18)
    after = float(right)
    for name, colour, value in zip(
        ("ON and OFF", "ON", "OFF"), (_INK, style.on, style.off), (on + off, on, off), strict=True
    ):
        steps = bottom - (bottom - _TOP) * np.repeat(value, 2) / top
        across(list(zip(np.repeat(x, 2)[1:-1], steps, strict=True)), colour)
        after -= write(name, after, 18, 1.0, colour) - after + 2 * GAP
    return picture


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


def tick_labels(ticks: Sequence[float]) -> list[str]:
    gap = min((b - a for a, b in itertools.pairwise(ticks)), default=0.0)
    labels: list[str] = []
    for digits in range(6, 18):
        labels = [f"{tick:.{digits}g}" for tick in ticks]
        pairs = zip(labels, ticks, strict=True)
        if all(abs(float(label) - tick) <= 1e-6 * gap for label, tick in pairs):
            break
    return [re.sub(r"e\+?(-?)0*", r"e\1", label) for label in labels]
