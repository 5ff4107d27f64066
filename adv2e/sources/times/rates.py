"""Frame rates that people give: a number, or the fraction that it stands for."""

from __future__ import annotations

import re
from fractions import Fraction

Rate = float | Fraction | str
"""A frame rate [Hz]: 30, 29.97, or exactly ``30000/1001``."""

_NUMBER = r"(\d{1,40}\.?\d{0,40}|\.\d{1,40})"
_FORM = re.compile(rf"[+-]?{_NUMBER}([eE][+-]?\d{{1,2}})?(/{_NUMBER})?", re.ASCII)
_LOWEST_HZ, _HIGHEST_HZ = Fraction(1, 10**6), 10**9
"""Beyond these, times do not fit 64 bits of nanoseconds, or frames share one."""


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
