"""Frames that are missing: by their times, or by the numbers in their names.

A recording that was interrupted and resumed has gaps between its times.  Where a rate is given in
place of times, the numbers in the names tell.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import PurePath
from statistics import median

from adv2e.sources.times.rates import NS_PER_S, FrameRate, seconds

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
