"""Names of event columns and sensor sizes; guesses for columns without names.

========== ============================ ============================================
column     names                        meaning
========== ============================ ============================================
time       t, ts, time(stamp)(s)        told from the times: :mod:`adv2e.formats.units`
           the same with _s, _ms, ...   as they say: t_us, timestamp_ns
column     x, xs                        from the left
row        y, ys                        from the top
polarity   p, ps, pol(arity), on        ON above 0
========== ============================ ============================================

Sizes are two numbers with a name each (``width``, ``height``), or one name for both.  What is
called a shape has its rows first, as arrays do, and ``sensor_resolution``, too [1]_; what is called
a size, ``resolution`` or ``geometry`` has its columns first.

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
from adv2e.sources.times.units import UNITS

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
    """Return by what name values state the size of a sensor, and (width, height) [pixels].

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


def order_of(rows: NDArray[Any], usual: str = "txyp") -> str:
    """Return the order of four columns without names, such as "xypt".

    It is the usual one, unless the columns contradict it and fit one other alone: a single one
    holds but -1, 0 and 1, and another single one rises.

    Parameters
    ----------
    rows : array of numbers, (events, 4)
        Of the beginning of a file.
    usual : str
        What the columns are called where nothing speaks against it.
    """
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
