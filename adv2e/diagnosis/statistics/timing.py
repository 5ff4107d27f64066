"""Times of events: lag behind the light, drift, shift, inter-event times, and stamps."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import BRIGHTNESSES, LIGHT_NAMES, STILL, Placed, Scene
from adv2e.diagnosis.statistics.groups import (
    POLARITIES,
    Array,
    Entry,
    Group,
    counts,
    exponential,
    numbers,
    share,
    stabilised,
)
from adv2e.diagnosis.statistics.rates import (
    count_neighbours,
    find_places,
    spans_text,
    sum_slopes,
)
from adv2e.reports.quantities import NO_UNIT

LAGS_MS = (-20.0, -8.0, -4.0, -2.0, 0.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
_PAIRS_MS = ((-2.0, 4.0), (-8.0, 16.0))
_BESIDE_MS = (2.0, 10.0)


_SUMMED_MS = tuple(sorted({*LAGS_MS, *np.ravel(_PAIRS_MS).tolist()}))


class Slopes:
    """Change of log light about events, bounded so that single large steps do not decide.

    `change`: what is summed up, in words; from -1 to 1.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        moving = np.abs(scene.slope[scene.speed > 0])
        typical = max(float(np.median(moving)) if moving.size else 1.0, 1e-6)
        self.bounded = scene.slope / (np.abs(scene.slope) + np.float32(typical))
        self.change = f"mean change s of log light, as s/(|s| + {typical:.3g} ln/s),"

    def sums(self, placed: Placed) -> Array:
        """Return the change before events in their direction, summed, made once for a stream.

        At all of `_SUMMED_MS`: (lags, parts, brightnesses, segments).
        """
        if self not in placed.made:
            stream, scene = placed.stream, self.scene
            shape = len(_SUMMED_MS), splits.COUNT, BRIGHTNESSES, scene.split.segments
            cell = np.ravel_multi_index((placed.part, placed.brightness, placed.segment), shape[1:])
            sums = np.zeros((len(_SUMMED_MS), math.prod(shape[1:])))
            sum_slopes(
                stream.t, stream.pixel, stream.on, cell,
                scene.times_us, 1e3 * np.array(_SUMMED_MS), self.bounded, sums,
            )  # fmt: skip
            placed.made[self] = sums.reshape(shape)
        return np.asarray(placed.made[self])


def _with_sums(number: Array, sums: Array, lags_ms: Sequence[float] | Array) -> Array:
    """Return numbers of events, then sums at some of the lags, (parts, cells + lags x cells)."""
    chosen = sums[np.searchsorted(_SUMMED_MS, lags_ms)].swapaxes(0, 1)
    return np.concatenate([number, chosen.reshape(splits.COUNT, -1)], axis=1)


def _when(lag_ms: float) -> str:
    """Return the words for a lag before an event; a negative one is after it."""
    return f"{abs(lag_ms):g} ms {'after' if lag_ms < 0.0 else 'before'}"


def lag(slopes: Slopes) -> Group:
    """Return the mean change of light before an event, in its direction, by brightness."""
    entries = [
        Entry(
            f"change {lag:g} ms before, {light}",
            f"{slopes.change} {_when(lag)} an event, in its direction, where it is"
            f" {slopes.scene.bounds_of_light[k]}",
            NO_UNIT,
        )
        for lag in LAGS_MS
        for k, light in enumerate(LIGHT_NAMES)
    ]

    def count(placed: Placed) -> Array:
        number = counts(placed.part, placed.brightness, BRIGHTNESSES)
        return _with_sums(number, slopes.sums(placed).sum(axis=3), LAGS_MS)

    def values(raw: Array) -> Array:
        number, *sums = raw.reshape(-1, BRIGHTNESSES)
        return share(np.array(sums), number).ravel()

    return Group("lag behind the light", 0.002, entries, count, values)


def drift(slopes: Slopes) -> Group:
    """Return statistics of the lag by segment of time, which show a drift of the clock."""
    segments = slopes.scene.split.segments
    spans = spans_text(slopes.scene.split.borders_us)
    entries = [
        Entry(
            f"lag {b:g} less {a:g} ms, time {k + 1}/{segments}",
            f"{slopes.change} {_when(b)} an event less that {_when(a)} it, {spans[k]}",
            NO_UNIT,
        )
        for a, b in _PAIRS_MS
        for k in range(segments)
    ]

    def count(placed: Placed) -> Array:
        number = counts(placed.part, placed.segment, segments)
        return _with_sums(number, slopes.sums(placed).sum(axis=2), np.ravel(_PAIRS_MS))

    def values(raw: Array) -> Array:
        sums = raw[segments:].reshape(len(_PAIRS_MS), 2, segments)
        return share(sums[:, 1] - sums[:, 0], raw[:segments]).ravel()

    return Group("lag over time", 0.002, entries, count, values)


def shift(slopes: Slopes) -> Group:
    """Return statistics of the change of light beside events, which show a shift in space."""
    entries = [
        Entry(
            f"change {name} of the event, {lag:g} ms before",
            f"{slopes.change} one pixel {side} an event less that on its other side,"
            f" {_when(lag)} it, in its direction",
            NO_UNIT,
        )
        for lag in _BESIDE_MS
        for name, side in (("right", "right of"), ("below", "below"))
    ]

    lags = 1e3 * np.array(_BESIDE_MS)
    scene = slopes.scene
    light = slopes.bounded.reshape(-1, scene.height, scene.width)
    across = np.zeros((2, *light.shape), np.float32)
    across[0, :, :, 1:-1] = light[:, :, 2:] - light[:, :, :-2]
    across[1, :, 1:-1] = light[:, 2:] - light[:, :-2]
    inside = np.zeros((scene.height, scene.width), np.bool_)
    inside[1:-1, 1:-1] = True

    def count(placed: Placed) -> Array:
        used = inside.take(placed.stream.pixel)
        stream, part = placed.stream.chosen(used), placed.part[used]
        sums = np.zeros((2, len(lags), splits.COUNT))
        for way, own in zip(across, sums, strict=True):
            change = way.reshape(scene.intervals, -1)
            sum_slopes(stream.t, stream.pixel, stream.on, part, scene.times_us, lags, change, own)
        number = np.bincount(part, minlength=splits.COUNT)
        return np.concatenate([number[:, None], sums.T.reshape(splits.COUNT, -1)], axis=1)

    def values(raw: Array) -> Array:
        return share(raw[1:], raw[0])

    return Group("place where the light changes", 0.002, entries, count, values)


# ---- Times between events of one pixel and of its neighbours, and runs of one polarity.


BORDERS_MS = (
    *(0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0),
    *(48.0, 64.0, 96.0, 128.0, 192.0, 256.0),
)
_REST_MS = (1.0, 4.0, 16.0, 64.0, 256.0)
_NEIGHBOURS_MS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
_PAIRS = ("OFF-OFF", "ON-OFF", "OFF-ON", "ON-ON")

_LONGEST_GAP_US = 50_000
_PLACES = ("1st", "2nd", "3rd", "4th", "5th-6th", "7th-9th", "10th or later")
_PLACE_OF = np.array([0, 1, 2, 3, 4, 4, 5, 5, 5, 6])


def _bins_text(borders_ms: Sequence[float]) -> list[str]:
    low = [0.0, *borders_ms]
    bins = [f"{a:g}-{b:g} ms" for a, b in zip(low, borders_ms, strict=False)]
    return [*bins, f"> {borders_ms[-1]:g} ms"]


def intervals(*, at_rest: bool = False) -> Group:
    """Return the histogram of the time since the pixel's event before, by both polarities."""
    borders_ms, where = (_REST_MS, " at rest") if at_rest else (BORDERS_MS, "")
    borders_us = np.round(np.array(borders_ms) * 1e3).astype(np.int64)
    longest_us = borders_us[-1]
    bin_of = np.searchsorted(borders_us, np.arange(longest_us + 1), "right").astype(np.int8)
    entries = numbers(
        (
            (
                f"{pair} after {text}{where}",
                f"pairs of events of a pixel{where}, {text} apart, {pair.replace('-', ' then ')}",
            )
            for text in _bins_text(borders_ms)
            for pair in _PAIRS
        ),
        "pairs",
    )

    def count(placed: Placed) -> Array:
        stream = placed.stream
        used = stream.since >= 0
        if at_rest:
            used &= placed.speed == STILL
        gap = bin_of[np.minimum(stream.since[used], longest_us)]
        cell = gap * 4 + stream.on[used] * 2 + stream.on_before[used]
        return counts(placed.part[used], cell, len(entries))

    return Group("time between events of a pixel", 0.6, entries, count, kind="time")


def runs() -> Group:
    """Return numbers of events by their place in a run of one polarity, which resets change."""
    entries = numbers(
        (
            f"{place} {p} event of a run",
            f"{p} events that are the {place} of their polarity in a row, without a gap of 50 ms",
        )
        for place in _PLACES
        for p in POLARITIES
    )

    def count(placed: Placed) -> Array:
        stream = placed.stream
        gap, on = stream.since, stream.on
        begins = (gap < 0) | (gap > _LONGEST_GAP_US) | (on != stream.on_before)
        places = np.empty(len(stream), np.int64)
        find_places(begins, stream.before, places)
        cell = _PLACE_OF[np.minimum(places, len(_PLACE_OF) - 1)] * 2 + on
        return counts(placed.part, cell, len(entries))

    return Group("runs of one polarity", 0.6, entries, count, kind="time")


def neighbours() -> Group:
    """Return the histogram of the time since an event of a neighbouring pixel."""
    entries = numbers(
        (
            f"{text} after a neighbour's {kind}",
            f"events {text} after the last event of the {kind} polarity in the four pixels beside",
        )
        for kind in ("other", "same")
        for text in _bins_text(_NEIGHBOURS_MS)
    )
    borders_us = np.round(np.array(_NEIGHBOURS_MS) * 1e3).astype(np.int64)

    def count(placed: Placed) -> Array:
        stream = placed.stream
        rows = stream.height + 2
        last = np.full((stream.width * rows, 2), -(1 << 60), np.int64)
        number = np.zeros((splits.COUNT, 2, len(borders_us) + 1))
        count_neighbours(
            stream.t, stream.pixel, stream.on, placed.part, stream.width, borders_us, last, number
        )
        return number.reshape(splits.COUNT, -1)

    return Group("neighbouring pixels", 0.6, entries, count, kind="time")


# ---- Stamps of neighbouring events in the stream: what a readout does to them.


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

    bin_of = np.searchsorted(_GAPS_US, np.arange(_GAPS_US[-1] + 1), "right")
    last_near = np.searchsorted(_GAPS_US, _NEAR_US)  # each is a border of those gaps

    def count(placed: Placed) -> Array:
        stream = placed.stream
        gap = np.minimum(np.diff(stream.t), _GAPS_US[-1])
        same = np.diff(stream.pixel // stream.width) == 0
        return counts(placed.part[1:], 2 * bin_of[gap] + same, 2 * len(_GAPS_US) + 2)

    def values(raw: Array) -> Array:
        number, same = raw[::2] + raw[1::2], raw[1::2]
        near, of_row = (np.cumsum(one)[last_near] for one in (number, same))
        return np.concatenate([stabilised(number), (of_row + 0.5) / (near + 1.0)])

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
