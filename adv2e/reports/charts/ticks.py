"""Places and labels of the ticks of an axis."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN_FROM, _PLAIN_TO = 1e-3, 1e5
"""Labels without exponents are between these."""


def linear_ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Return multiples of 1, 2 or 5 times a power of ten from `low` to `high`.

    Parameters
    ----------
    low, high : float
        Finite, `low` below `high`.
    most : int
        At most that many, and one more.

    Returns
    -------
    list of float
        Ascending; at least one, unless no such number can be told from its neighbours.
    """
    span = high - low
    if math.isinf(span):
        return [4 * tick for tick in linear_ticks(low / 4, high / 4, most)]
    power = math.floor(math.log10(span)) - 2
    for digits, exponent in ((d, power + n) for n in range(4) for d in (1, 2, 5)):
        step = float(f"{digits}e{exponent}")
        if step > 0 and span / step <= most:
            break
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # from decimal text, because multiples of a float such as 0.1 are off by its rounding
    ticks = (float(f"{n * digits}e{exponent}") for n in range(first, last + 1))
    return sorted({tick + 0.0 for tick in ticks if low <= tick <= high})


def log_ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Return ticks of a logarithmic axis: powers of ten, with 2 and 5 times those if few.

    Parameters
    ----------
    low, high : float
        Positive and finite, `low` below `high`.
    most : int
        At most that many powers of ten.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = max(1, math.ceil((last - first + 1) / most))
    decades = [float(f"1e{n}") for n in range(first, last + 1) if n % every == 0]
    ticks = [tick for tick in decades if low <= tick <= high]
    if len(ticks) >= 3:
        return ticks
    ticks = [
        tick
        for n in range(first, last + 1)
        for tick in (float(f"{digit}e{n}") for digit in (1, 2, 5))
        if low <= tick <= high
    ]
    return ticks if len(ticks) >= 3 else linear_ticks(low, high)


def tick_labels(ticks: Sequence[float], log: bool = False) -> list[str]:
    """Return the labels of `ticks`, all in the same style and all different."""
    sizes = [abs(tick) for tick in ticks if tick != 0]
    if not sizes:
        return ["0" for _ in ticks]
    smallest = min(sizes) if log else max(sizes)
    if smallest >= _PLAIN_FROM and max(sizes) < _PLAIN_TO:
        labels = [f"{tick:g}" for tick in ticks] if log else _same_decimals(ticks)
    elif log:
        labels = [_with_power(tick) for tick in ticks]
    else:
        power = math.floor(math.log10(max(sizes)))
        scaled = _same_decimals([_times_power(tick, -power) for tick in ticks])
        labels = [
            "0" if tick == 0 else f"{text}×{_power(power)}"
            for text, tick in zip(scaled, ticks, strict=True)
        ]
    return labels if len(set(labels)) == len(labels) else [repr(float(tick)) for tick in ticks]


def _same_decimals(ticks: Sequence[float]) -> list[str]:
    """Return decimals, as few as tell the ticks apart and give each to a part in a million."""
    gap = min((b - a for a, b in itertools.pairwise(ticks)), default=abs(ticks[0]))
    for decimals in range(8):
        texts = [f"{tick:.{decimals}f}" for tick in ticks]
        if all(
            abs(float(text) - tick) <= 1e-6 * gap for text, tick in zip(texts, ticks, strict=True)
        ):
            return texts
    return [repr(float(tick)) for tick in ticks]


def _times_power(value: float, power: int) -> float:
    """Return value 10^power without the rounding of that power."""
    mantissa, _, exponent = f"{value:.16e}".partition("e")
    return float(f"{mantissa}e{int(exponent) + power}")


def _power(power: int) -> str:
    return f"10{str(power).translate(_SUPERSCRIPTS)}"


def _with_power(tick: float) -> str:
    mantissa, _, power = f"{tick:.6e}".partition("e")
    factor = f"{float(mantissa):g}"
    return _power(int(power)) if factor == "1" else f"{factor}×{_power(int(power))}"
