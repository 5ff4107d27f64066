"""Times of frames: decimal numbers, frame rates, and what a container's stamps stand for.

Decimal seconds are read as text and become integer nanoseconds without passing through floating
point, so that stamps of 1.47e9 s keep every digit.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

import numpy as np

from adv2e.ticks import LARGEST_NS

NS_PER_S = 10**9

NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
"""A time in a list."""


@dataclass(frozen=True)
class Stamp:
    """One line of a list of times."""

    t_ns: int
    line: int
    name: str | None


@dataclass(frozen=True)
class FrameRate:
    """Frames at an exact, constant rate [Hz]; the first is at zero."""

    hz: Fraction

    def time_ns(self, number: int) -> int:
        """Return the time [ns] of frame `number`, to the nearest nanosecond."""
        return round(Fraction(number * NS_PER_S) / self.hz)


def parse_ns(text: str, unit_ns: int = NS_PER_S) -> int:
    """Return the decimal number `text`, in units of `unit_ns`, as whole nanoseconds.

    Raises
    ------
    ValueError
        If the text is not a plain or scientific decimal number, or is beyond 146 years.
    """
    if not NUMBER.fullmatch(text):
        raise ValueError(f"{text[:40]!r} is not a number")
    t_ns = round(Fraction(Decimal(text)) * unit_ns)
    if abs(t_ns) > LARGEST_NS:
        raise ValueError(f"{text[:40]!r} is out of range: over 146 years")
    return t_ns


def seconds(t_ns: int) -> str:
    """Return a time [ns] as text in seconds, all digits that count."""
    sign = "-" if t_ns < 0 else ""
    whole, part = divmod(abs(t_ns), NS_PER_S)
    return sign + (f"{whole}.{part:09d}".rstrip("0").rstrip("."))


def constant_rate(
    stamps_ns: Sequence[int], *, stated_hz: float, tolerance_ns: int
) -> FrameRate | None:
    """Return the constant frame rate that stamps rounded to a coarse clock stand for, or None.

    The rates tried are the whole numbers and the whole numbers over 1.001 (24000/1001,
    30000/1001, ...) within 0.2 % of the stated or the mean rate, nearest first, then the stated
    rate itself.

    Parameters
    ----------
    stamps_ns : sequence of int
        Times of all frames, increasing [ns].
    stated_hz : float
        Rate that the container states; 0 if it does not.
    tolerance_ns : int
        How far a stamp may lie from its place at the constant rate: one tick of the clock [ns].
    """
    if len(stamps_ns) < 2:
        return None
    since_first = np.asarray(stamps_ns, dtype=np.int64) - stamps_ns[0]
    mean_hz = (len(stamps_ns) - 1) * NS_PER_S / max(int(since_first[-1]), 1)
    numbers = np.arange(len(stamps_ns))
    for hz in _candidates(stated_hz, mean_hz):
        places = numbers * (NS_PER_S / float(hz))
        if np.all(np.abs(since_first - places) <= tolerance_ns):
            return FrameRate(hz)
    return None


def _candidates(stated_hz: float, mean_hz: float) -> list[Fraction]:
    candidates = rates_near(stated_hz) + rates_near(mean_hz)
    if stated_hz > 0:
        candidates.append(Fraction(stated_hz).limit_denominator(1001))
    return [hz for hz in candidates if hz > 0]


def rates_near(about: float) -> list[Fraction]:
    """Return the usual rates within 0.2 % of one [Hz], nearest first: whole, or over 1.001."""
    whole, broadcast = Fraction(round(about)), Fraction(round(about * 1.001) * 1000, 1001)
    near = [hz for hz in (whole, broadcast) if hz > 0 and abs(float(hz) - about) <= 0.002 * about]
    return sorted(near, key=lambda hz: abs(float(hz) - about))
