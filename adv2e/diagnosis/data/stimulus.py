"""Light that is known at all times, in the place of frames: an LED's steps, a lamp with a trace.

Every pixel of a region sees the same light.  It is a line between two instants; where it leaps, two
of them are 0.1 us apart, which is less than a stamp tells.  The pixels' own simulation takes the
logarithm of the light for a line, so that instants are put between two that are far apart: what is
left is at most 5e-5 ln.

In a film hardly two pixels see the same, and some pixel changes much at any time.  So its rows are
what frames are elsewhere: the line between two is followed in ten steps, as those of frames are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.splits import Stream

LEAP_NS = 100
"""Time that a leap takes."""
_NEAR_LN = 0.02
"""Most by which the light of neighbouring instants differs: a line is off by its square / 8 [ln]"""
_LENGTHS_NS = tuple(k * 10**e for e in range(9, 1, -1) for k in (5, 2, 1))
_OFTEN, _ALIKE = 50, 1e-3
"""Of times between instants: those that a trace has, or that all others are made of, nearly."""
_DARK_DN = 0.1
"""Light below which no difference counts."""
_GRID_S, _FINEST_S = 2e-3, 1e-4
_OF_A_STEP = 0.25
"""Time between instants that are looked at, where leaps are near, as a share of that between two"""
_MOST = 4000
"""Times between instants that are looked at."""
_LEAST_LN, _APART_US = 0.05, 200
"""A leap: by at least so much, and not so soon after another."""
FILM_STEPS, _FILM_NS = 10, 5_000_000
"""Of a film: steps from one instant to the next, and how far apart these are at most."""


@dataclass(frozen=True)
class Stimulus:
    """The course of a known light.

    Attributes
    ----------
    name : str
        Its file.
    times_ns : (instants,) int64
        Increasing.
    light : (instants, regions)
        Light at them [DN].
    region : (rows, columns)
        Which of the regions each pixel is in.
    steps : int
        In which pixels follow the line from one instant to the next.
    """

    name: str
    times_ns: NDArray[np.int64]
    light: NDArray[np.float64]
    region: NDArray[np.intp]
    steps: int = 1

    def at(self, times_ns: NDArray[Any]) -> NDArray[np.float64]:
        """Return the light at some times, (times, regions); of a leap, that before it."""
        columns = [np.interp(times_ns, self.times_ns, one) for one in self.light.T]
        return np.stack(columns, axis=1)

    def cut(self, rows: slice, columns: slice) -> Stimulus:
        return replace(self, region=self.region[rows, columns])

    def between(self, start_ns: int, stop_ns: int) -> Stimulus:
        """Return the course from one time to another, which are instants of it then."""
        inner = self.times_ns[(self.times_ns > start_ns) & (self.times_ns < stop_ns)]
        times = np.array([start_ns, *inner.tolist(), stop_ns], np.int64)
        return replace(self, times_ns=times, light=self.at(times))

    def instants(self, span_ns: Sequence[int]) -> int:
        """Return the number of instants from the first to the last of some times [ns]."""
        first, last = np.searchsorted(self.times_ns, [span_ns[0], span_ns[-1]])
        return int(last - first)

    @cached_property
    def leaps(self) -> Leaps:
        each = [_leaps_us(self.times_ns, one) for one in self.light.T]
        return Leaps(tuple(each), self.region.ravel())

    def looked_at_ns(self) -> NDArray[np.int64]:
        """Return evenly spaced instants, near enough that a change and its events are together."""
        first, last = int(self.times_ns[0]), int(self.times_ns[-1])
        apart_us = [np.diff(one) for one in self.leaps.times_us if len(one) > 1]
        step_s = _GRID_S
        if apart_us:
            step_s = min(step_s, _OF_A_STEP * 1e-6 * float(np.median(np.concatenate(apart_us))))
        step_s = max(step_s, _FINEST_S, 1e-9 * (last - first) / _MOST)
        count = max(int(np.ceil(1e-9 * (last - first) / step_s - 1e-6)), 2)
        return np.rint(np.linspace(first, last, count + 1)).astype(np.int64)


def refined(times_ns: NDArray[np.int64], light: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the instants of a course, and more where a line of its logarithm would be another.

    `times_ns`: (instants,); `light`: (instants, regions).  Between them lie times of few lengths,
    as what solves an interval is made anew for each length that there is, by every model.
    """
    log = np.log(np.maximum(light, _DARK_DN))
    apart = np.diff(times_ns)
    lengths, which, often = np.unique(apart, return_inverse=True, return_counts=True)
    kept = (often[which] >= _OFTEN) | (lengths[which] <= LEAP_NS)
    kept &= np.abs(np.diff(log, axis=0)).max(axis=1) <= _NEAR_LN
    kept |= apart <= LEAP_NS
    found = times_ns.tolist()
    for k in np.flatnonzero(~kept).tolist():
        found += _between(found[k], found[k + 1], light[k], light[k + 1])
    return np.unique(np.array(found, np.int64))


def of_film(times_ns: NDArray[np.int64], light: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the instants of a film, and more between those that are far apart as it changes.

    Arguments as of :func:`refined`.
    """
    changes = np.any(np.diff(light, axis=0) != 0.0, axis=1)
    pieces = np.where(changes, -(-np.diff(times_ns) // _FILM_NS), 1)
    ends = zip(times_ns[:-1], times_ns[1:], pieces, strict=True)
    found = [a + np.rint(np.linspace(0, b - a, count + 1)).astype(np.int64) for a, b, count in ends]
    return np.unique(np.concatenate(found))


def _between(
    start_ns: int, stop_ns: int, first: NDArray[np.float64], last: NDArray[np.float64]
) -> list[int]:
    """Return instants between two of a course, the light of which is given, (regions,)."""
    slope = (last - first) / (stop_ns - start_ns)
    found: list[int] = []
    rests, t_ns = not slope.any(), start_ns

    def log(at_ns: int) -> NDArray[np.float64]:
        return np.log(np.maximum(first + slope * (at_ns - start_ns), _DARK_DN))

    while True:
        left_ns = stop_ns - t_ns
        here = log(t_ns)
        for length in _LENGTHS_NS:
            if length * (1.0 - _ALIKE) > left_ns:
                continue
            if rests or np.abs(log(t_ns + length) - here).max() <= _NEAR_LN:
                break
        t_ns += length
        if t_ns > stop_ns - _LENGTHS_NS[-1] or t_ns > stop_ns - _ALIKE * length:
            return found
        found.append(t_ns)


def _leaps_us(times_ns: NDArray[np.int64], course: NDArray[np.float64]) -> NDArray[np.int64]:
    change = np.abs(np.diff(np.log(np.maximum(course, _DARK_DN))))
    quick = (change > _LEAST_LN) & (np.diff(times_ns) <= LEAP_NS)
    found: list[int] = []
    for t_us in (times_ns[:-1][quick] // 1000).tolist():
        if not found or t_us - found[-1] >= _APART_US:
            found.append(t_us)
    return np.array(found, np.int64)


@dataclass(frozen=True)
class Leaps:
    """Times [us] at which the light leaps, of each region, and the region of each pixel."""

    times_us: tuple[NDArray[np.int64], ...]
    region: NDArray[np.intp]

    def since(self, stream: Stream) -> NDArray[np.int64]:
        """Return the time from the last leap that its pixel saw to each event [us].

        -1: there was none.
        """
        every = np.concatenate(self.times_us)
        if not len(every):
            return np.full(len(stream), -1, np.int64)
        # one region after the other, each as long as all leaps and a moment before them
        first, length = every.min() - 1, every.max() - every.min() + 2
        counts = [len(leaps) for leaps in self.times_us]
        place = np.repeat(np.arange(len(counts)), counts) * length + every - first
        of_region = self.region[stream.pixel]
        begin = np.r_[0, np.cumsum(counts)][of_region]
        seen = of_region * length + np.clip(stream.t - first, 0, length - 1)
        before = np.searchsorted(place, seen, "right") - 1
        return np.where(before >= begin, stream.t - every[np.maximum(before, 0)], -1)


class Seen(Sequence[NDArray[Any]]):
    """Frames of a known light, each made when it is asked for: those of a whole sensor are many.

    `light`: (frames, regions) float32 [DN]; `region`: (rows, columns).
    """

    def __init__(self, light: NDArray[np.float32], region: NDArray[np.intp]) -> None:
        self.light, self.region = light, region

    def __len__(self) -> int:
        return len(self.light)

    @overload
    def __getitem__(self, which: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, which: slice) -> Seen: ...
    def __getitem__(self, which: int | slice) -> NDArray[Any] | Seen:
        if isinstance(which, slice):
            return Seen(self.light[which], self.region)
        return np.asarray(self.light[which][self.region])


def joined(before: Sequence[NDArray[Any]], after: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
    if isinstance(before, Seen) and isinstance(after, Seen):
        return Seen(np.concatenate([before.light, after.light]), after.region)
    return [*before, *after]
