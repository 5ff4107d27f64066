"""What the columns of events are called, in NumPy archives and in CSV.

========== ======================= =================================================
column     names                   meaning
========== ======================= =================================================
time       t_s, t_ms, t_us, t_ns   as they say
           t, ts, time(stamp)(s)   told from the times: :mod:`adv2e.formats.units`
column     x, xs                   from the left
row        y, ys                   from the top
polarity   p, ps, pol(arity), on   ON above 0
========== ======================= =================================================
"""

from __future__ import annotations

from collections.abc import Collection

from adv2e.errors import DataError

_NAMES = {
    "time": ("t_us", "t_ns", "t_ms", "t_s", "t", "ts", "time", "times", "timestamp", "timestamps"),
    "x": ("x", "xs"),
    "y": ("y", "ys"),
    "polarity": ("p", "ps", "pol", "polarity", "on"),
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
        raise DataError(
            f"{label}: no column for {column} ({', '.join(names)}); it has"
            f" {', '.join(given) or 'nothing'}"
        )
    return name


def stated_unit(time: str) -> str | None:
    """Return the unit that the name of the column of times states."""
    return time[2:] if time.startswith("t_") else None
