"""Places and labels of the ticks of an axis."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence


def linear_ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Return multiples of 1, 2 or 5 times a power of ten from `low` to `high`, ascending.

    At most `most` of them, and one more; `low` is below `high` by more than rounding.
    """
    least = (high - low) / most
    exponent = math.floor(math.log10(least))
    digits = next(d for d in (1, 2, 5, 10) if float(f"{d}e{exponent}") >= least)
    step = float(f"{digits}e{exponent}")
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # from decimal text, because multiples of a float such as 0.1 are off by its rounding
    ticks = (float(f"{n * digits}e{exponent}") for n in range(first, last + 1))
    return sorted({tick + 0.0 for tick in ticks if low <= tick <= high})


def log_ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Return ticks of a logarithmic axis: powers of ten, with 2 and 5 times those if few.

    At most `most` powers of ten; `low`, above zero, is below `high`.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = max(1, math.ceil((last - first + 1) / most))
    decades = [n for n in range(first, last + 1) if n % every == 0]
    for exponents, digits in ((decades, (1,)), (range(first, last + 1), (1, 2, 5))):
        found = [float(f"{digit}e{n}") for n in exponents for digit in digits]
        ticks = [tick for tick in found if low <= tick <= high]
        if len(ticks) >= 3:
            return ticks
    return linear_ticks(low, high)


def tick_labels(ticks: Sequence[float]) -> list[str]:
    """Return the labels of `ticks`, each right to a part in a million of their distance."""
    gap = min((b - a for a, b in itertools.pairwise(ticks)), default=0.0)
    labels: list[str] = []
    for digits in range(6, 18):
        labels = [f"{tick:.{digits}g}" for tick in ticks]
        pairs = zip(labels, ticks, strict=True)
        if all(abs(float(label) - tick) <= 1e-6 * gap for label, tick in pairs):
            break
    return [re.sub(r"e\+?(-?)0*", r"e\1", label) for label in labels]
