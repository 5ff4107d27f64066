"""Gaps between frames, as a recording that was interrupted and resumed has them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from adv2e.sources.times.instants import NS_PER_S, seconds

_LONG_NS = NS_PER_S
_USUAL, _UNUSUAL = 3, 30
"""How many usual steps a long gap has at least, and one of any length."""


def gap_doubts(times_ns: Sequence[int], label: str) -> list[str]:
    """Return what is to be told of gaps between frames: one line, or none.

    A gap is a step of over a second and three usual ones, or of thirty usual ones.

    Parameters
    ----------
    times_ns : sequence of int
        When the frames are, increasing [ns].
    label : str
        What they are the frames of.
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
