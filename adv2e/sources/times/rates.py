"""Frame rates and times: as people give them, as decimal numbers, and rates that times have."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

import numpy as np

from adv2e.ticks import LARGEST_NS

# ---- Times of frames as decimal numbers.
#
# Decimal seconds are read as text and become integer nanoseconds without passing through floating
# point, so that stamps of 1.47e9 s keep every digit.


NS_PER_S = 10**9

NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
"""A time in a list."""


@dataclass(frozen=True)
class Stamp:
    """One line of a list of times."""

    t_ns: int
    line: int
    name: str | None


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


Rate = float | Fraction | str
"""A frame rate [Hz]: 30, 29.97, or exactly ``30000/1001``."""

_NUMBER = r"(\d{1,40}\.?\d{0,40}|\.\d{1,40})"
_FORM = re.compile(rf"[+-]?{_NUMBER}([eE][+-]?\d{{1,2}})?(/{_NUMBER})?", re.ASCII)
_LOWEST_HZ, _HIGHEST_HZ = Fraction(1, 10**6), 10**9
"""Beyond these, times do not fit 64 bits of nanoseconds, or frames share one."""


@dataclass(frozen=True)
class FrameRate:
    """Frames at an exact, constant rate [Hz]; the first is at zero."""

    hz: Fraction

    def time_ns(self, number: int) -> int:
        """Return the time [ns] of frame `number`, to the nearest nanosecond."""
        return round(Fraction(number * NS_PER_S) / self.hz)


def parse_rate(rate: Rate) -> Fraction:
    """Return a frame rate exactly: 29.97 is 2997/100, ``30000/1001`` is what it says.

    Raises
    ------
    ValueError
        If it is not a number or a fraction, or not between 1e-6 and 1e9 Hz; what would be right,
        as text.
    """
    text = str(rate).strip()
    if not _FORM.fullmatch(text):
        raise ValueError(f"must be a number, such as 30, 29.97 or 30000/1001, got {text[:60]!r}")
    above, _, below = text.partition("/")
    over = Fraction(below or 1)
    hz = Fraction(above) / over if over else Fraction(0)
    if hz <= 0:
        raise ValueError(f"must be above 0 Hz, got {text}")
    if not _LOWEST_HZ <= hz <= _HIGHEST_HZ:
        raise ValueError(f"must be from 1e-6 to 1e9 Hz, got {text}")
    return hz


def rates_near(about: float) -> list[Fraction]:
    """Return the usual rates within 0.2 % of one [Hz], nearest first: whole, or over 1.001."""
    whole, broadcast = Fraction(round(about)), Fraction(round(about * 1.001) * 1000, 1001)
    near = [hz for hz in (whole, broadcast) if hz > 0 and abs(float(hz) - about) <= 0.002 * about]
    return sorted(near, key=lambda hz: abs(float(hz) - about))


def constant_rate(
    stamps_ns: Sequence[int], *, stated_hz: float, tolerance_ns: int
) -> FrameRate | None:
    """Return the constant frame rate that stamps rounded to a coarse clock stand for, or None.

    The rates tried are the whole numbers and the whole numbers over 1.001 (24000/1001, 30000/1001,
    ...) within 0.2 % of the stated or the mean rate, nearest first, then the stated rate itself, 0
    if the container states none.  `tolerance_ns` is how far a stamp may lie from its place: one
    tick of the clock.
    """
    if len(stamps_ns) < 2:
        return None
    since_first = np.asarray(stamps_ns, dtype=np.int64) - stamps_ns[0]
    mean_hz = (len(stamps_ns) - 1) * NS_PER_S / max(int(since_first[-1]), 1)
    numbers = np.arange(len(stamps_ns))
    tried = rates_near(stated_hz) + rates_near(mean_hz)
    if stated_hz > 0:
        tried.append(Fraction(stated_hz).limit_denominator(1001))
    for hz in tried:
        places = numbers * (NS_PER_S / float(hz))
        if np.all(np.abs(since_first - places) <= tolerance_ns):
            return FrameRate(hz)
    return None
