"""Time windows in which two recordings are compared.

A window is half open, ``[start, stop)``.  Windows are the frame intervals of the measured
recording, or, where it has no frames, pieces of one length.  Only windows that lie inside the spans
of both streams count, so that a stream is never blamed for time that it does not cover; both
streams are cut to them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, Window

MOST = 1_000_000
"""Windows of one comparison: 14 hours of the usual length."""


@dataclass(frozen=True)
class Windows:
    """The windows in use, in order and without gaps."""

    kind: str
    """Kind of the windows, in words."""
    used: tuple[Window, ...]
    total: int
    """Number of windows before those outside the spans were dropped."""

    @property
    def start(self) -> int:
        return self.used[0][0]

    @property
    def stop(self) -> int:
        return self.used[-1][1]

    @property
    def duration_s(self) -> float:
        return (self.stop - self.start) / 1e6


def holding_events(windows: Windows, streams: Sequence[Events]) -> NDArray[np.bool_]:
    """Tell of each window in use whether any of the sorted `streams` has an event in it."""
    edges = np.array([*(start for start, _ in windows.used), windows.stop], np.int64)
    fires = np.zeros(len(windows.used), np.bool_)
    for events in streams:
        fires |= np.diff(np.searchsorted(events["t"], edges)) > 0
    return fires


def span_of(events: Events, frame_times_ns: NDArray[np.int64] | None = None) -> Window | None:
    """Return first and last time of the stream [us], None if there is nothing in it.

    Frame times [ns], where given, belong to the span: a simulated pixel may keep still on its
    first frames.
    """
    times = [events["t"][[0, -1]]] if len(events) else []
    if frame_times_ns is not None and len(frame_times_ns):
        times.append(to_us(frame_times_ns))
    if not times:
        return None
    return int(min(t.min() for t in times)), int(max(t.max() for t in times))


def to_us(times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return times [ns] in whole microseconds, to the nearest."""
    return (np.asarray(times_ns, dtype=np.int64) + 500) // 1000


def frame_windows(frame_times_ns: NDArray[np.int64], spans: Sequence[Window]) -> Windows:
    """Return the intervals of frames [ns] that lie inside all `spans`.

    Raises
    ------
    DataError
        The spans have no whole frame interval in common.
    """
    edges = [int(t) for t in to_us(frame_times_ns)]
    return _inside("frame intervals", list(itertools.pairwise(edges)), spans)


def fixed_windows(length_us: int, spans: Sequence[Window]) -> Windows:
    """Return windows of `length_us` from the later of the two beginnings on.

    Raises
    ------
    DataError
        The spans have no whole window in common, or more than `MOST`.
    """
    first, last = _common(spans)
    starts = range(first, last - length_us + 1, length_us)
    if len(starts) > MOST:
        raise DataError(
            f"the streams share {(last - first) / 1e6:,.6g} s, which are {len(starts):,} windows of"
            f" {length_us / 1e6:g} s; {MOST:,} are the most: 'adv2e info' tells gaps that a wrong"
            " time makes; else give longer windows with --window"
        )
    windows = [(start, start + length_us) for start in starts]
    return _inside(f"windows of {length_us / 1e6:g} s", windows, spans)


def _common(spans: Sequence[Window]) -> Window:
    return max(span[0] for span in spans), min(span[1] for span in spans)


def _inside(kind: str, windows: Sequence[Window], spans: Sequence[Window]) -> Windows:
    first, last = _common(spans)
    used = tuple(window for window in windows if first <= window[0] and window[1] <= last)
    if not used:
        raise DataError(
            f"the streams share {max(0, last - first) / 1e6:g} s, which hold none of the {kind}"
            " wholly: give shorter windows with --window, or longer streams"
        )
    return Windows(kind, used, len(windows))
