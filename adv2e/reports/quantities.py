"""Numbers as people read them: significant digits, intervals, units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from adv2e.reports.result import Estimate

NOTHING = "-"
"""Stands where there is no number."""

NO_UNIT = "no unit"
"""Stands beside a number that has none."""

_LARGER = {"us": ((1e6, "s"), (1e3, "ms")), "ns": ((1e6, "ms"), (1e3, "µs"))}
"""Larger units, each with the number from which on it is easier to read, the largest first."""

_LARGE, _SMALL = 6, -4
"""Decimal exponents from which, and below which, numbers are written with an exponent."""


def native(value: Any) -> Any:
    """Return `value` with NumPy's scalars, arrays and tuples as plain numbers and lists."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): native(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [native(item) for item in value]
    return value


def number_text(value: float, digits: int = 3) -> str:
    """Return `value` with at least `digits` significant digits; whole digits are never cut off."""
    odd = _odd_text(value)
    if odd is not None:
        return odd
    exponent = _exponent(value, digits)
    if _SMALL <= exponent < _LARGE:
        return f"{value:,.{max(0, digits - 1 - exponent)}f}"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa}e{int(power)}"


def alike_texts(values: Sequence[float]) -> list[str]:
    """Return numbers to compare: all to the place of the last digit of the largest."""
    sizes = [abs(value) for value in values if math.isfinite(value) and value]
    if not sizes:
        return [number_text(value) for value in values]
    place = min(_exponent(max(sizes), 3) - 2, 0)
    return [_to_place(value, place) for value in values]


def short_text(value: float, digits: int = 4) -> str:
    """Return `value` with at most `digits` significant digits, without zeros at the end."""
    text = number_text(value, digits)
    mantissa, mark, power = text.partition("e")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}{mark}{power}"


def value_text(value: Any, interval: Sequence[Any] | None = None) -> str:
    """Return the value of a key; numbers have as many digits as `interval`, if any, warrants."""
    value = native(value)
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"[{', '.join(value_text(item) for item in value)}]"
    if not isinstance(value, (int, float)):
        return str(value)
    if interval is None:
        return short_text(value)
    return _to_place(value, _place(interval))


def interval_text(interval: Sequence[Any] | None) -> str:
    """Return ``low to high``, or a dash where no interval is known."""
    if interval is None:
        return NOTHING
    low, high = native(interval)
    if isinstance(low, list) or isinstance(high, list):
        return f"{value_text(low)} to {value_text(high)}"
    place = _place((low, high))
    return f"{_to_place(low, place)} to {_to_place(high, place)}"


def readable(path: str, value: Any, unit: str) -> tuple[float, str]:
    """Return a factor and a unit in which `value`, that of a key in `unit`, is easy to read.

    Long times are in larger units, and shares in percent.
    """
    if unit == "" and path.endswith("fraction"):
        return 100.0, "%"
    value = native(value)
    if isinstance(value, (int, float)):
        for least, larger in _LARGER.get(unit, ()):
            if abs(value) >= least:
                return 1.0 / least, larger
    return 1.0, unit_text(unit)


def scaled(value: Any, factor: float) -> Any:
    """Return a number, or each of a list, times `factor`; anything else as it is."""
    value = native(value)
    if isinstance(value, list):
        return [scaled(item, factor) for item in value]
    if factor == 1.0 or isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    return factor * value


def beside(value: Any, interval: Sequence[Any] | None) -> str:
    """Return `value` with as many decimals as one with that interval has, or more."""
    text = value_text(value)
    place = None
    if interval is not None and isinstance(native(value), (int, float)) and "e" not in text:
        place = _place(interval)
    if place is None or place >= 0:
        return text
    whole, _, decimals = text.partition(".")
    return f"{whole}.{decimals.ljust(-place, '0')}"


def estimate_text(estimate: Estimate) -> str:
    """Return value and interval, as in ``1.38 (1.30 to 1.46)``."""
    if estimate.interval is None or any(math.isnan(end) for end in estimate.interval):
        return number_text(estimate.value)
    return f"{value_text(estimate.value, estimate.interval)} ({interval_text(estimate.interval)})"


def percent_text(share: float) -> str:
    return NOTHING if math.isnan(share) else f"{short_text(100 * share, 2)} %"


def probability_text(p: float) -> str:
    """Return a probability after ``p``: ``= 0.034``, or ``< 0.001`` for all that is below."""
    if math.isnan(p):
        return "unknown"
    return "< 0.001" if p < 0.001 else f"= {number_text(p, 2)}"


def unit_text(unit: str) -> str:
    return {"us": "µs", "-": ""}.get(unit, unit)


def _odd_text(value: float) -> str | None:
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return "0" if value == 0 else None


def _exponent(value: float, digits: int) -> int:
    """Return the decimal exponent of `value` rounded to `digits` digits."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def _place(interval: Sequence[float]) -> int | None:
    """Return the decimal place to which a value with that interval is given: 0 for ones.

    Half the interval is then 2 to 20 units of that place.
    """
    half = (interval[1] - interval[0]) / 2
    if not (math.isfinite(half) and half > 0):
        return None
    return math.floor(math.log10(half / 2))


def _to_place(value: float, place: int | None) -> str:
    odd = _odd_text(value)
    if place is None or odd is not None:
        return odd or short_text(value)
    exponent = max(_exponent(value, 4), place)
    if _SMALL <= exponent < _LARGE:
        # adding zero turns a zero below zero into a plain one
        return f"{round(value, -place) + 0.0:,.{max(0, -place)}f}"
    return number_text(value, min(max(exponent - place + 1, 1), 15))
