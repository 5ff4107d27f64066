"""Times of frames as decimal numbers.

Decimal seconds are read as text and become integer nanoseconds without passing through floating
point, so that stamps of 1.47e9 s keep every digit.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

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
