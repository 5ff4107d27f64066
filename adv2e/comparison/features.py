"""Features by which the events of a recording, or of a window, are told from others.

They hold for a sensor of any size and for any length of time: places are strips of columns and of
rows, times are parts of the whole, and pixels come by how busy they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.distances import keys, stride_of
from adv2e.events import Events, Window

STRIPS = 48
"""Most strips of columns, and of rows; a smaller sensor has each column and row by itself."""

_GAP_EDGES = 10.0 ** (np.arange(29) / 4)
"""Quarters of decades from 1 us to 10 s; the first and the last bin are open."""

Features = NDArray[np.float64]
"""Values of one sample, (features,), or of all, (samples, features)."""


@dataclass(frozen=True)
class Feature:
    """Meaning of one value.

    Attributes
    ----------
    family : str
        What it has in common with others.
    words : str
        What is counted or measured.
    kind : str
        ``share``, ``count`` (ln(1 + n) in the values) or ``seconds``.
    """

    family: str
    words: str
    kind: str = "share"

    def natural(self, value: float) -> float:
        """Return a mean of values in the unit of the words."""
        return float(np.expm1(value)) if self.kind == "count" else float(value)

    def written(self, value: float) -> str:
        """Return a natural value for people."""
        if self.kind == "share":
            return f"{100 * value:.3g} %"
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def features(events: Events, size: tuple[int, int], span: Window, parts: int) -> Features:
    """Return the values that :func:`described` names, of sorted events.

    `size` are columns and rows of the sensor; `span` [us] is cut into `parts` of one length.
    """
    count, on = len(events), events["p"] > 0
    busy, gaps = trains(events, size[0])
    ranks = _ranks(size)
    counts = np.zeros(len(ranks))
    reached = ranks[ranks <= len(busy)]
    counts[: len(reached)] = np.sort(busy)[::-1][reached - 1]
    place = (events["t"] - span[0]) * parts // max(1, span[1] - span[0])
    place = np.clip(place, 0, parts - 1)
    t = events["t"]
    whole = [np.log1p(count), *((on.mean(), (t[-1] - t[0]) / 1e6) if count else (0.0, 0.0))]
    found = [
        np.array(whole),
        _shares(place, parts),
        _shares(place[on], parts),
        *(
            _shares(events[name] // _step(side), -(-side // _step(side)))
            for name, side in zip("xy", size, strict=True)
        ),
        _shares(_gap_bins(gaps), len(_GAP_EDGES) - 1),
        np.log1p(counts),
    ]
    return np.concatenate(found)


def described(size: tuple[int, int], parts: int) -> list[Feature]:
    """Return what each value of :func:`features` is."""
    strips = [
        Feature(kind, f"share of events in {kind} {_from_to(k * _step(side), _step(side), side)}")
        for kind, side in (("columns", size[0]), ("rows", size[1]))
        for k in range(-(-side // _step(side)))
    ]
    edges = _GAP_EDGES
    bounds = ["below {1}", *["of {0} to {1}"] * (len(edges) - 3), "above {0}"]
    return [
        Feature("events", "events", "count"),
        Feature("ON", "share of ON events"),
        Feature("length", "time from the first event to the last [s]", "seconds"),
        *(
            Feature(family, f"share of {what}events in part {k + 1} of {parts} of the time")
            for family, what in (("course", ""), ("ON course", "ON "))
            for k in range(parts)
        ),
        *strips,
        *(
            Feature(
                "gaps",
                "share of times between events of a pixel "
                + bound.format(_time(edges[k]), _time(edges[k + 1])),
            )
            for k, bound in enumerate(bounds)
        ),
        *(
            Feature("busiest", f"events of the pixel at place {k} of the busiest", "count")
            for k in _ranks(size)
        ),
    ]


def trains(events: Events, width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return events of each pixel that has any, and times between those of a pixel [us].

    Neither in a useful order; the times are to the next event, of either polarity.
    """
    start, stride = stride_of(events)
    ordered = np.sort(keys(events, width, start, stride))
    is_next = ordered[1:] // stride == ordered[:-1] // stride
    ends = np.flatnonzero(np.r_[~is_next, np.ones(min(1, len(ordered)), np.bool_)])
    gaps: NDArray[np.int64] = np.diff(ordered)[is_next]
    return np.diff(ends, prepend=-1), gaps


def _shares(at: NDArray[np.int64], bins: int) -> Features:
    return np.bincount(at, minlength=bins) / max(1, len(at))


def _gap_bins(gaps: NDArray[np.int64]) -> NDArray[np.int64]:
    bins = np.searchsorted(_GAP_EDGES, gaps, side="right") - 1
    return np.clip(bins, 0, len(_GAP_EDGES) - 2)


def _step(side: int) -> int:
    return -(-side // STRIPS)


def _ranks(size: tuple[int, int]) -> NDArray[np.int64]:
    """Return powers of two up to the number of pixels."""
    return 1 << np.arange((size[0] * size[1]).bit_length())


def _from_to(first: int, step: int, side: int) -> str:
    last = min(first + step, side) - 1
    return f"{first}" if first == last else f"{first} to {last}"


def _time(us: float) -> str:
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if us >= 0.999 * size:
            return f"{us / size:.2g} {unit}"
    return f"{us:.2g} us"
