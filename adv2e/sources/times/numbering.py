"""What the numbers in frames' names say, where a rate is given in place of times."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import PurePath
from statistics import median

from adv2e.sources.times.instants import FrameRate

_NO_NUMBERS = 1000
"""Steps from which on numbers are times: of nanoseconds, microseconds, or decimals of seconds."""


def numbering_doubt(paths: Sequence[str], rate: FrameRate) -> str:
    """Return what is to be told of frames at a constant rate whose numbers have gaps, or "".

    Parameters
    ----------
    paths : sequence of str
        Of the frames, in order.
    rate : FrameRate
        The rate that was given.
    """
    names = [PurePath(path).name for path in paths]
    for before, after in pairwise(names):
        if before != after and PurePath(before).stem == PurePath(after).stem:
            return f"{before} and {after} differ in their endings alone, and are two frames"
    numbers = _numbers(names)
    if len(numbers) < 2:
        return ""
    steps = [after - before for before, after in pairwise(numbers)]
    if median(steps) >= _NO_NUMBERS:
        return (
            f"the frames' names look like times ({names[0]}, {names[1]}), which --fps leaves"
            " unread; --timestamps takes a list of them"
        )
    usual = Counter(steps).most_common(1)[0][0]
    told = []
    if usual > 1:
        told.append(_sparse(names, usual, rate.hz, always=len(set(steps)) == 1))
    if missing := [at for at, step in enumerate(steps) if step > usual]:
        at = missing[0]
        more = f", and at {len(missing) - 1} more places" if len(missing) > 1 else ""
        told.append(
            f"frames are missing between {names[at]} and {names[at + 1]}{more}: --fps leaves no"
            " room for them; --timestamps does"
        )
    elif len(set(steps)) > 1:
        told.append("the numbers in their names do not rise evenly, which --fps does not show")
    return "; ".join(told)


def _sparse(names: Sequence[str], step: int, hz: Fraction, *, always: bool) -> str:
    fewer = hz / step
    rate = f"{hz}" if hz.denominator == 1 else f"{float(hz):.6g}"
    asked = f"{hz.numerator}/{hz.denominator * step}"
    return (
        f"the numbers in the frames' names are {'' if always else 'mostly '}{step} apart"
        f" ({names[0]}, {names[1]}): if all frames came at {rate} a second, these come at"
        f" {float(fewer):.4g}: give --fps {asked}"
    )


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
