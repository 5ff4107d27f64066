"""What events tell of passages: latencies, events after the stop, distances of distributions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events

Values = NDArray[np.float64]

WINDOW_US = 30_000.0
"""Events later than this after a passage, or after the stop, are not counted to it [us]."""

LATE_US = 60_000.0
"""What pixels still fire from then on after a stop is taken for events of other causes [us]."""

SURE = 3.0
"""A decay is told of events that are this many standard deviations of their number."""


@dataclass(frozen=True)
class Passages:
    """When edges passed pixels.

    Attributes
    ----------
    time_us : (rows, columns)
        When the middle of the edge was at the pixel [us]; NaN where that is not known, or where the
        stop cut it short.
    last : array of bool, (rows, columns)
        Pixels that an edge came near to shortly before it stopped.
    band : array of int, (rows, columns)
        Which edge; -1: none.
    polarity : tuple of int
        Of each edge's events, 1 ON or 0 OFF.
    lead_us : float
        An edge is felt this long before it passes [us].
    stop_us, end_us : float
        When edges stopped, and the end of the events [us].
    """

    time_us: Values
    last: NDArray[np.bool_]
    band: NDArray[np.int64]
    polarity: tuple[int, ...]
    lead_us: float
    stop_us: float = np.nan
    end_us: float = np.nan


@dataclass(frozen=True)
class Latencies:
    """Events of one edge after it passed.

    Attributes
    ----------
    of : (events,)
        Time since the passage [us]; negative where the soft edge fires before its middle is there.
    number : (events,)
        1 for the first event of a pixel's passage, 2 for the next, and so on.
    pixels : int
        Passages.
    """

    of: Values
    number: NDArray[np.int64]
    pixels: int

    def numbered(self, number: int) -> Values:
        """Return the latencies of the `number`-th events [us]."""
        return self.of[self.number == number]

    @property
    def mean_count(self) -> float:
        """Events a passage."""
        return len(self.of) / self.pixels


@dataclass(frozen=True)
class After:
    """Events of one edge after it stopped, less those that other causes make in that time.

    Attributes
    ----------
    share : float
        Of the events of the pixels that the edge came near to shortly before.
    count : float
        For each line of the edge.
    decay_us : float
        Mean time since the stop [us], which is the time constant of an exponential decay; NaN where
        chance may have made these events, or where they do not decay.
    """

    share: float
    count: float
    decay_us: float


def latencies(events: Events, passages: Passages, band: int) -> Latencies:
    """Return the latencies of one edge's events, by pixels and times."""
    ours = events[events["p"] == passages.polarity[band]]
    passed = passages.time_us[ours["y"], ours["x"]]
    since = ours["t"] - passed  # NaN compares as False
    near = (since >= -passages.lead_us) & (since <= WINDOW_US)
    near &= passages.band[ours["y"], ours["x"]] == band
    ours, since = ours[near], since[near]
    pixel = ours["y"].astype(np.int64) * passages.band.shape[1] + ours["x"]
    order = np.lexsort((ours["t"], pixel))
    pixel, since = pixel[order], since[order]
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    lengths = np.diff(np.append(first, len(pixel)))
    number = np.arange(len(pixel)) - np.repeat(first, lengths) + 1
    known = (passages.band == band) & np.isfinite(passages.time_us)
    return Latencies(since, number, int(known.sum()))


def after_stop(events: Events, passages: Passages, band: int) -> After:
    """Return what an edge's last pixels fire after the stop."""
    mine = passages.last & (passages.band == band)
    lines = int(mine.any(axis=1).sum())
    ours = events[events["p"] == passages.polarity[band]]
    since = ours["t"][mine[ours["y"], ours["x"]]] - passages.stop_us
    rate = float((since > LATE_US).sum()) / (passages.end_us - passages.stop_us - LATE_US)
    after = since[(since > 0) & (since <= WINDOW_US)]
    count = len(after) - rate * WINDOW_US
    delays = float(after.sum()) - rate * WINDOW_US**2 / 2
    before = float((since <= 0).sum()) - rate * passages.stop_us
    sure = count > SURE * np.sqrt(max(1, len(after)))
    sure = sure and delays / count < WINDOW_US / 2  # evenly spread, they do not decay
    return After(
        share=count / (before + count) if before + count > 0 else np.nan,
        count=count / lines,
        decay_us=delays / count if sure else np.nan,
    )


def apart(a: Values, b: Values) -> float:
    r"""Return the Wasserstein-1 distance of two samples, in their unit: what a shift comes to.

    .. math:: \int |F_a(t) - F_b(t)|\,dt

    NaN where one is empty.
    """
    if not len(a) or not len(b):
        return np.nan
    a, b = np.sort(a), np.sort(b)
    every = np.sort(np.concatenate([a, b]))
    shares = [np.searchsorted(one, every[:-1], "right") / len(one) for one in (a, b)]
    return float(np.abs(shares[0] - shares[1]) @ np.diff(every))
