"""Columns of events: names, the size of the sensor, guesses where nothing is named, and units.

========== ============================ ============================================
column     names                        meaning
========== ============================ ============================================
time       t, ts, time(stamp)(s)        told from the times, as below
           the same with _s, _ms, ...   as they say: t_us, timestamp_ns
column     x, xs                        from the left
row        y, ys                        from the top
polarity   p, ps, pol(arity), on        ON above 0
========== ============================ ============================================

Sizes are two numbers with a name each (``width``, ``height``), or one name for both.  What is
called a shape has its rows first, as arrays do, and ``sensor_resolution``, too [1]_; what is called
a size, ``resolution`` or ``geometry`` has its columns first.

The unit of the times of events follows from one rule for every file.  Events come at any rate, so
that their times tell less than those of frames
(:mod:`adv2e.sources.times.rates`), which decide where both are whole numbers, or neither is.  Else
events are, of the first kind that fits:

============================================ ===============================================
dates from 2000 to 2100                      in the unit that makes them so
finer than a thousandth                      s: ms are not written finer than cameras' ticks
whole numbers at a rate that us allow        us, told as a doubt
others                                       in the unit that comes nearest to one event a
                                             pixel a second, told as a doubt
fewer than 100                               us if whole numbers, told as a doubt; else s
============================================ ===============================================

Event rates that no camera has (`_LEAST_RATE`, `_MOST_RATE`) are told, too.

References
----------
.. [1] github.com/TimoStoff/event_utils, event_packagers.py.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.sources.times.rates import SETTLED, UNITS, Unit, are_dates, guessed_unit

FEW = 20
"""Number of events below which nothing can be told about their columns."""

_TIMES = ("t", "ts", "time", "times", "timestamp", "timestamps")
_NAMES = {
    "time": (*(f"{name}_{unit}" for name in _TIMES for unit in ("us", "ns", "ms", "s")), *_TIMES),
    "x": ("x", "xs"),
    "y": ("y", "ys"),
    "polarity": ("p", "ps", "pol", "polarity", "on"),
}

_MOST = 1 << 16
_SIDES = (
    *(("width", "height"), ("sensor_width", "sensor_height"), ("frame_width", "frame_height")),
    *(("image_width", "image_height"), ("columns", "rows"), ("cols", "rows")),
)
_ROWS_FIRST = ("sensor_resolution", "sensor_shape", "frame_shape", "image_shape", "shape")
_COLUMNS_FIRST = (
    *("resolution", "sensor_size", "frame_size", "image_size", "camera_size", "geometry", "size"),
)
SIZE_NAMES = (*_ROWS_FIRST, *_COLUMNS_FIRST, *dict.fromkeys(n for pair in _SIDES for n in pair))
"""Names of the size of a sensor, or of a side of it."""
_STATED = re.compile(r"([a-z_][a-z_ ]*)[\s:=(\[]*(\d+)(?:\s*[x,*]?\s*(\d+))?")

_UNIT_WORDS = {
    "s": ("s", "sec", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "usec", "\u00b5s", "\u03bcs", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
}


def find_columns(given: Collection[str], label: str) -> tuple[str, str, str, str]:
    """Return the names of the columns of time, x, y and polarity among those that a file has.

    Raises
    ------
    DataError
        One of them is missing; the text begins with `label`.
    """
    t, x, y, p = (_find(column, given, label) for column in _NAMES)
    return t, x, y, p


def _find(column: str, given: Collection[str], label: str) -> str:
    names = _NAMES[column]
    name = next((name for name in names if name in given), None)
    if name is None:
        shown = (*names[:4], *_TIMES) if column == "time" else names
        raise DataError(
            f"{label}: no column for {column} ({', '.join(dict.fromkeys(shown))}); it has"
            f" {', '.join(given) or 'nothing'}"
        )
    return name


def stated_unit(time: str) -> str | None:
    """Return the unit that the name of the column of times states."""
    name, _, unit = time.rpartition("_")
    return unit if name and unit in UNITS else None


def unit_of_attribute(text: str) -> str | None:
    """Return the unit that an attribute of a column says in words; None: none that is known."""
    word = text.strip().lower()
    return next((name for name, words in _UNIT_WORDS.items() if word in words), None)


def named_geometry(values: Mapping[str, Any]) -> tuple[str, tuple[int, int] | None]:
    """Return the name by which values state the size of a sensor, and (width, height) [pixels].

    None: they state none; the name is empty then.
    """
    for names in _SIDES:
        if all(name in values for name in names):
            size = _numbers([values[name] for name in names])
            if size is not None:
                return ", ".join(names), size
    for name, value in values.items():
        if name in (*_ROWS_FIRST, *_COLUMNS_FIRST):
            size = _numbers(value)
            if size is not None:
                return name, size if name in _COLUMNS_FIRST else (size[1], size[0])
    return "", None


def geometry_in(text: str) -> tuple[str, tuple[int, int] | None]:
    """Return the sensor size in the lines of a comment, as :func:`named_geometry` does."""
    found: dict[str, Any] = {}
    for words, first, second in _STATED.findall(text.lower()):
        key = re.sub(r"[\W_]+", "_", words.strip())
        if key in SIZE_NAMES:
            found[key] = [int(first), int(second)] if second else int(first)
    return named_geometry(found)


def _numbers(value: Any) -> tuple[int, int] | None:
    """Return the first two of two or three whole numbers that can be a size; None: others."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        value = re.findall(r"\d+", value)
    try:
        numbers = [float(number) for number in np.ravel(np.asarray(value)).tolist()]
    except (TypeError, ValueError):
        return None
    if len(numbers) not in (2, 3) or not all(n.is_integer() and n > 0 for n in numbers):
        return None
    return (int(numbers[0]), int(numbers[1])) if max(numbers[:2]) <= _MOST else None


def order_of(rows: NDArray[Any]) -> str:
    """Return the order of four columns without names, (events, 4), such as "xypt".

    It is the usual one, unless the columns contradict it and fit one other alone: a single one
    holds but -1, 0 and 1, and another single one rises.
    """
    usual = "txyp"
    if len(rows) < FEW:
        return usual
    rises = [bool(np.all(np.diff(column) >= 0) and column[-1] > column[0]) for column in rows.T]
    t, p = usual.index("t"), usual.index("p")
    odd = int(np.count_nonzero(~np.isin(rows[:, p], (-1, 0, 1))))
    falls = int(np.count_nonzero(np.diff(rows[:, t]) < 0))
    if odd <= len(rows) // 100 and not (falls > len(rows) // 4 and any(rises)):
        return usual
    return told_order(rows, usual) or usual


def told_order(rows: NDArray[Any], usual: str = "txyp") -> str:
    """Return the order of four columns if they tell it, as for :func:`order_of`; else nothing."""
    if len(rows) < FEW:
        return ""
    signs = [bool(np.isin(column, (-1, 0, 1)).all()) for column in rows.T]
    rises = [bool(np.all(np.diff(column) >= 0) and column[-1] > column[0]) for column in rows.T]
    pairs = [(a, b) for a in range(4) for b in range(4) if a != b and rises[a] and signs[b]]
    if len(pairs) != 1:
        return ""
    others = iter(usual.replace("t", "").replace("p", ""))
    return "".join({pairs[0][0]: "t", pairs[0][1]: "p"}.get(k) or next(others) for k in range(4))


_FEW_TIMES = 100
"""Number of events below which nothing can be told about their unit."""
_LEAST_RATE = (1e-3, 1e3)
"""Events a pixel a second, and a second: both fewer is no camera's rate [Hz]."""
_MOST_RATE = (1e3, 1e7)
"""Events a pixel a second, and a second: both more is no camera's rate [Hz]."""
_THOUSANDTH, _FINE = 1e-3, 0.01
"""Numbers of less than 64 bits with larger steps tell nothing; fine ones are more than this share.

From 8192 on, thousandths leave out 24 of 1024 numbers of 32 bits.
"""
_SAMPLES = 10_000
"""Times that are looked at to see how fine they are."""


def event_unit(
    times: NDArray[Any],
    pixels: int,
    *,
    whole: bool,
    given: str | None = None,
    beside: Unit | None = None,
) -> Unit:
    """Return the unit of the times of events, as the rule of this module has it.

    Parameters
    ----------
    times : array of integers or floats, (events,)
        As the file has them, or many of them from its beginning.
    pixels : int
        Pixels of the sensor.
    whole : bool
        They are written as whole numbers.
    given : {'s', 'ms', 'us', 'ns'}, optional
        What the user says.
    beside : Unit, optional
        That of the frames in the same recording, where they are written as whole numbers exactly
        if these are.
    """
    if given is not None:
        return Unit(given)
    span = float(times.max()) - float(times.min()) if times.size else 0.0
    tells = times.size >= _FEW_TIMES and 0 < span < np.inf
    if tells and not whole:
        whole = bool(np.all(times == np.floor(times)))
    usual = "us" if whole else "s"
    if beside is not None:
        return Unit(beside.name)
    if not tells:
        return Unit(usual, _taken(usual) if whole else "")
    rates = {name: times.size / span * (1e9 / ns) for name, ns in UNITS.items()}
    first, last = times.min().item(), times.max().item()
    for name in UNITS:
        if are_dates(first, last, name) and _is_rate(rates[name], pixels):
            return Unit(name)
    is_coarse = times.dtype.kind == "f" and np.spacing(np.abs(times).min()) > _THOUSANDTH
    if is_coarse and not whole:  # what nothing else tells
        return Unit("s", _taken("s", rates["s"]))
    if not whole and _are_fine(times):
        return Unit("s", "" if _is_rate(rates["s"], pixels) else _taken("s", rates["s"]))
    nearest = min(UNITS, key=lambda name: abs(np.log10(rates[name] / pixels)))
    if whole and _is_rate(rates["us"], pixels):
        nearest = "us"
    # half of it, as the rate of few events is known to chance only
    sure = not whole and nearest == "s" and not _is_rate(500 * rates["s"], pixels)
    return Unit(nearest, "" if sure else _taken(nearest, rates[nearest]))


def _is_rate(rate_hz: float, pixels: int) -> bool:
    each = rate_hz / pixels
    few = each < _LEAST_RATE[0] and rate_hz < _LEAST_RATE[1]
    many = each > _MOST_RATE[0] and rate_hz > _MOST_RATE[1]
    return not few and not many


def _are_fine(times: NDArray[Any]) -> bool:
    """Tell whether most times have digits beyond the third after the point."""
    if times.dtype.kind != "f":
        return False
    some = times[:: max(1, times.size // _SAMPLES)]
    thousands = some.astype(np.float64) * 1e3
    if times.dtype.itemsize < 8:  # what is left of thousandths is not a matter of slack
        return bool(np.mean((np.rint(thousands) / 1e3).astype(times.dtype) != some) > _FINE)
    slack = np.abs(thousands) * 4 * float(np.finfo(times.dtype).eps) + 1e-9
    return bool(np.mean(np.abs(thousands - np.rint(thousands)) > slack) > 0.5)


def _taken(unit: str, rate_hz: float | None = None) -> str:
    """Return the note on events whose unit is a guess."""
    rate = "" if rate_hz is None else f", {rate_hz:.3g} events a second"
    return guessed_unit(f"no unit is stated: times are taken as {unit}{rate}; {SETTLED}", unit)
