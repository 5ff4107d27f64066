"""Rates and times of frames: as people give them, as decimals, their unit, and frames missing."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise
from pathlib import PurePath
from statistics import median
from typing import Any

import numpy as np

from adv2e.label import guessed
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
    """One line of a list of times; with an exposure, its middle is the time."""

    t_ns: int
    line: int
    name: str | None
    exposure_ns: int = 0


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


def nine_decimals(t_ns: int) -> str:
    """Return a time [ns] in seconds with nine decimals, exactly."""
    whole, rest = divmod(abs(int(t_ns)), NS_PER_S)
    return f"{'-' if t_ns < 0 else ''}{whole}.{rest:09d}"


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


# ---- Unit of the timestamps of frames: one rule for every list.
#
# The first of these that tells something decides:
#
# 1. the user (``--time-unit``); 2. the file (a heading such as ``#timestamp [ns]``, a column
# ``t_us``, or that we wrote it); 3. the times themselves, as below; what they leave open is told
# as a doubt.
#
# Frames, by the number that typically lies between one and the next (the median):
#
# ============== ====== ====================== ====================================
# number         unit   that is                told as a doubt
# ============== ====== ====================== ====================================
# below 0.5      s      over 2 frames/s        only where they are nearer than 10 us
# 0.5 to 1       s      1 to 2 frames/s        yes
# 1, mostly      s      1 frame/s              yes: frame numbers look like that
# 1 to 1000      ms     1 to 1000 frames/s     yes
# 1000 to 10^6   us     1 to 1000 frames/s     yes
# above          ns     up to 1000 frames/s    yes
# ============== ====== ====================== ====================================
#
# But dates from 2000 to 2100, counted from 1970, are in the unit that makes them so, beyond doubt
# where frames are nearer than 1 s; in doubt, and in seconds, up to a minute.
#
# Frames that are a thousandfold nearer or farther apart than the video's own times say are told,
# too.


UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Units of time [ns]."""

SETTLED = "--time-unit settles it"

_EARLIEST_S, _LATEST_S = 946_684_800, 4_102_444_800
"""Dates that are taken for such: 2000 to 2100 [s since 1970]."""
_LONGEST_S = 60.0
"""Frames with dates are nearer than this, typically [s]."""
_SLOW_S = 0.5
"""Frames farther apart than this may be milliseconds at a little over 1000 a second [s]."""
_NEAR_S, _FAR_S = 1e-5, 10.0
"""Frames nearer or farther apart than this are told even where the unit is known [s]."""


@dataclass(frozen=True)
class Unit:
    """A unit of time: its name in `UNITS`, and what is to be told if it is in doubt."""

    name: str
    doubt: str = ""

    @property
    def ns(self) -> int:
        return UNITS[self.name]


def frame_unit(
    times: Sequence[Decimal],
    *,
    given: str | None = None,
    stated: str | None = None,
    own_step_s: float | None = None,
) -> Unit:
    """Return the unit of the times of frames, as the rule of this module has it.

    Parameters
    ----------
    times : sequence of Decimal
        As the list has them, in any order.
    given, stated : {'s', 'ms', 'us', 'ns'}, optional
        What the user says, and what the list itself says.
    own_step_s : float, optional
        How far the frames are apart by the times of the video itself [s].
    """
    if given is not None:
        return Unit(given)
    ordered = sorted(times)
    steps = [after - before for before, after in pairwise(ordered) if after > before]
    if not steps:
        return Unit(stated or "s")
    step = float(median(steps))
    if stated is not None:
        unit, sure = stated, _NEAR_S < step * UNITS[stated] / 1e9 < _FAR_S
    else:
        unit, sure = _by_step(step, steps, ordered)
    apart_s = max(step * UNITS[unit] / 1e9, 1e-12)
    if own_step_s and not 1 / 300 < apart_s / own_step_s < 300:
        told = f"times taken as {unit} are {apart_s:.6g} s apart, where the video's own are"
        told += f" {own_step_s:.6g} s apart; {SETTLED}"
        return Unit(unit, told if stated else guessed_unit(told, unit))
    if sure:
        return Unit(unit)
    apart = f"{step:.6g} apart" + (", as frame numbers are," if min(steps) == 1 > step - 1 else "")
    rate = f"{1 / apart_s:.6g} frames a second"
    if stated is not None:
        return Unit(unit, f"times {apart} in {unit} are {rate}: is that right? {SETTLED}")
    told = f"no unit is stated: times {apart} are taken as {unit} ({rate}); {SETTLED}"
    return Unit(unit, guessed_unit(told, unit))


def guessed_unit(told: str, unit: str) -> str:
    """Return a line that tells a unit of times that is a guess."""
    return guessed(told, "time unit", unit, f"give --time-unit {unit}, or another")


def _by_step(step: float, steps: Sequence[Any], ordered: Sequence[Any]) -> tuple[str, bool]:
    """Return (unit, whether it is beyond doubt) of frames from the number between them."""
    dated = [name for name in UNITS if are_dates(ordered[0], ordered[-1], name)]
    for name in dated:
        if _NEAR_S < step * UNITS[name] / 1e9 < 1:
            return name, True
    if "s" in dated and step < _LONGEST_S:
        return "s", False
    if step < 1:
        return "s", _NEAR_S < step < _SLOW_S
    if step < 2 and min(steps) == 1:
        return "s", False
    unit = "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
    return unit, False


def are_dates(first: Any, last: Any, unit: str) -> bool:
    """Tell whether times in a unit are dates from 2000 to 2100, counted from 1970."""
    a_second = 10**9 // UNITS[unit]
    return bool(_EARLIEST_S * a_second <= first and last <= _LATEST_S * a_second)


# ---- Frames that are missing: by their times, or by the numbers in their names.
#
# A recording that was interrupted and resumed has gaps between its times. Where a rate is given in
# place of times, the numbers in the names tell.


_LONG_NS = NS_PER_S
_USUAL, _UNUSUAL = 3, 30
"""Least length of a gap in usual steps: of one above `_LONG_NS`, and of any gap."""
_NO_NUMBERS = 1000
"""Steps from which on numbers are times: of nanoseconds, microseconds, or decimals of seconds."""


def gap_doubts(times_ns: Sequence[int], label: str) -> list[str]:
    """Return a warning about gaps between frames: one line, or none.

    A gap is a step of over a second and three usual ones, or of thirty usual ones.  `times_ns`
    increase; `label` is the name of their source.
    """
    if len(times_ns) < 3:
        return []
    usual = median(after - before for before, after in pairwise(times_ns))
    gaps = [
        (after - before, number)
        for number, (before, after) in enumerate(pairwise(times_ns))
        if after - before > _USUAL * usual
        and (after - before > _LONG_NS or after - before >= _UNUSUAL * usual)
    ]
    if not gaps:
        return []
    longest, number = max(gaps)
    others = f" ({len(gaps)} such gaps; this is the longest)" if len(gaps) > 1 else ""
    return [
        f"{label}: no frame for {seconds(longest)} s between frames {number} and {number + 1}"
        f"{others}; usual are {seconds(round(usual))} s"
    ]


def numbering_doubt(paths: Sequence[str], rate: FrameRate) -> str:
    """Return a warning about gaps in the numbers of frames at a given rate, or ""."""
    names = [PurePath(path).name for path in paths]
    numbers = _numbers(names)
    steps = [after - before for before, after in pairwise(numbers)]
    if not steps or median(steps) >= _NO_NUMBERS:
        return ""
    usual = Counter(steps).most_common(1)[0][0]
    told = []
    if usual > 1:
        told.append(
            f"the numbers in the frames' names are mostly {usual} apart ({names[0]}, {names[1]}):"
            f" if all frames came at {float(rate.hz):.6g} a second, these come at"
            f" {float(rate.hz / usual):.4g}: give --fps {rate.hz.numerator}/"
            f"{rate.hz.denominator * usual}"
        )
    if missing := [at for at, step in enumerate(steps) if step > usual]:
        at = missing[0]
        more = f", and at {len(missing) - 1} more places" if len(missing) > 1 else ""
        told.append(
            f"frames are missing between {names[at]} and {names[at + 1]}{more}: --fps leaves no"
            " room for them; --timestamps does"
        )
    return "; ".join(told)


def _numbers(names: Sequence[str]) -> list[int]:
    """Return the one number in each name that differs from name to name; [] if that is unclear."""
    split = [re.split(r"([0-9]+)", name) for name in names]
    if len({len(parts) for parts in split}) != 1:
        return []
    columns = list(zip(*split, strict=True))
    differ = [at for at, column in enumerate(columns) if len(set(column)) > 1]
    if len(differ) != 1 or differ[0] % 2 == 0 or max(map(len, columns[differ[0]])) > 20:
        return []
    numbers = [int(text) for text in columns[differ[0]]]
    return numbers if all(before < after for before, after in pairwise(numbers)) else []
