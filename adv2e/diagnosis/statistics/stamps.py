"""Stamps of neighbouring events in the stream: what a readout does to them."""

from __future__ import annotations

import numpy as np

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import Placed
from adv2e.diagnosis.statistics.counting import count_gaps
from adv2e.diagnosis.statistics.groups import (
    Array,
    Entry,
    Group,
    counts,
    exponential,
    numbers,
    share,
    stabilised,
)

TICKS_US = (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)
_ON_TICK = np.array([[t % tick == 0 for tick in TICKS_US] for t in range(TICKS_US[-1])], float)
_GAPS_US = (1, 2, 3, 5, 8, 12, 20, 40, 80, 160)
_NEAR_US = (3, 12, 40, 160)
_QUANTILES = (0.1, 0.25, 0.5, 0.75)
_BIN_BORDERS_US = np.r_[
    np.arange(-0.5, 100.0), np.unique(np.rint(np.geomspace(100.0, 1e5, 100)))[1:] + 0.5
]
"""Of the gaps counted: each of whole microseconds by itself, longer ones within 7 %, up to 0.1 s.

No readout takes as long; what is longer counts as that.
"""
_BIN_OF = np.searchsorted(_BIN_BORDERS_US[1:-1], np.arange(int(_BIN_BORDERS_US[-1]) + 1))


def ticks() -> Group:
    """Return shares of stamps that are whole multiples of a time."""
    entries = [
        Entry(
            f"stamps on {tick} us",
            f"share of time stamps that are multiples of {tick} us",
            "of all stamps",
        )
        for tick in TICKS_US
    ]

    def count(placed: Placed) -> Array:
        # all ticks divide the largest one
        number = counts(placed.part, placed.stream.t % TICKS_US[-1], TICKS_US[-1])
        return np.concatenate([number.sum(axis=1)[:, None], number @ _ON_TICK], axis=1)

    return Group(
        "steps of the time stamps", 0.001, entries, count, lambda raw: share(raw[1:], raw[0])
    )


def gaps() -> Group:
    """Return times between neighbours in the whole stream, and how often they share a row."""
    bins = [f"{a}-{b} us" for a, b in zip((0, *_GAPS_US), _GAPS_US, strict=False)]
    entries = numbers(
        (f"next after {gap}", f"events {gap} after the event before, of any pixel")
        for gap in (*bins, f">= {_GAPS_US[-1]} us")
    )
    entries += [
        Entry(
            f"same row within {n} us",
            f"share that follows an event of its own row, of events less than {n} us after the one"
            " before",
            "of these events",
        )
        for n in _NEAR_US
    ]

    def count(placed: Placed) -> Array:
        stream = placed.stream
        number = np.zeros((splits.COUNT, len(_GAPS_US) + 1))
        rows = np.zeros((splits.COUNT, len(_NEAR_US), 2))
        count_gaps(
            stream.t, stream.pixel, placed.part, stream.width,
            np.array(_GAPS_US), np.array(_NEAR_US), number, rows,
        )  # fmt: skip
        return np.concatenate([number, rows.reshape(splits.COUNT, -1)], axis=1)

    def values(raw: Array) -> Array:
        number, near = raw[: len(_GAPS_US) + 1], raw[len(_GAPS_US) + 1 :]
        return np.concatenate([stabilised(number), (near[1::2] + 0.5) / (near[::2] + 1.0)])

    return Group("time between events of the sensor", 0.002, entries, count, values, kind="time")


def row_gaps() -> Group:
    """Return quantiles of the times between neighbours in the stream that are of two rows.

    A busy readout gives all of them the time that it takes for a row, however it differs.
    """
    entries = [
        Entry(
            f"{100 * q:g} % of gaps between rows",
            f"time from one row to the next that {100 * q:g} % of such times are shorter than",
            "us",
            exponential,
        )
        for q in _QUANTILES
    ]

    def count(placed: Placed) -> Array:
        stream = placed.stream
        other = np.flatnonzero(np.diff(stream.pixel // stream.width)) + 1
        gap = np.minimum(stream.t[other] - stream.t[other - 1], len(_BIN_OF) - 1)
        return counts(placed.part[other], _BIN_OF[gap], len(_BIN_BORDERS_US) - 1)

    def values(raw: Array) -> Array:
        up_to = np.cumsum(raw)
        if up_to[-1] == 0.0:
            return np.zeros(len(_QUANTILES))
        wanted = np.array(_QUANTILES) * up_to[-1]
        k = np.searchsorted(up_to, wanted)
        in_bin = 1.0 - (up_to[k] - wanted) / raw[k]
        gap = _BIN_BORDERS_US[k] + in_bin * np.diff(_BIN_BORDERS_US)[k]
        return np.asarray(np.log(np.maximum(gap, 0.5)))

    return Group("time between rows", 0.02, entries, count, values, kind="time")
