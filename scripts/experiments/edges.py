r"""Straight edges between two grey levels that move and stop suddenly, and what events tell.

The picture consists of bands of rows.  In each band one edge moves to the right,

.. math:: p(t) = p_0 + v \min(t, t_{stop}), \qquad
          I(x, t) = a + (b - a)\,\tfrac12 \left(1 + \tanh\frac{p(t) - x}{w}\right)

from light a [DN] before it to light b behind it: an ON edge where b is brighter.  Each line of a
band starts a part of a pixel further, so that pixels meet their edge at all phases of the frames.
The edge passes a pixel when p(t) = x: half of the change of its light is done then.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from experiments.clip import Clip

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


PAIRS = ((4.0, 12.0), (12.0, 36.0), (36.0, 108.0), (80.0, 240.0))
"""Dark and bright side of the edges [DN]: a change by 1.10 ln everywhere."""

START_PX = -6.0
"""Where edges are at first, outside of the picture [px]."""

CLEAR_PX = 3.0
"""An edge this far from a pixel has passed it wholly, or not begun to [px]."""

LAST_PX = 15.0
"""Pixels this near before the place of the stop are those that may go on firing [px]."""

_GOLDEN = 0.6180339887498949


class Band(NamedTuple):
    """Rows with the same edge: both levels [DN], and the polarity of its events (1 ON, 0 OFF)."""

    dark: float
    bright: float
    polarity: int


@dataclass(frozen=True)
class Edges:
    """The scene.

    Attributes
    ----------
    pairs : sequence of (float, float)
        Dark and bright light [DN]; each makes an ON and an OFF edge.
    lines : int
        Rows of a band.
    columns : int
        More than the edges go through.
    speed : float
        [px/s]
    stop_s, end_s : float
        When edges stop, and the end [s].
    half_width : float
        w: 10 to 90 % of the change is 2.2 of it [px].
    """

    pairs: tuple[tuple[float, float], ...] = PAIRS
    lines: int = 8
    columns: int = 50
    speed: float = 500.0
    stop_s: float = 0.1013
    end_s: float = 0.26
    half_width: float = 0.7

    @cached_property
    def bands(self) -> list[Band]:
        """An ON and an OFF edge of each pair."""
        return [Band(*pair, polarity) for pair in self.pairs for polarity in (1, 0)]

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.columns, self.lines * len(self.bands)

    def band_of(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the bands of rows."""
        return rows // self.lines

    def place(self, rows: NDArray[np.int64], times: Values) -> Values:
        """Return where the edges are [px] in rows at times [s], broadcast."""
        start = START_PX + np.mod(rows * _GOLDEN, 1.0)
        return start + self.speed * np.minimum(times, self.stop_s)

    def passage(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Values:
        """Return when the edge would pass pixels [s] if it did not stop."""
        return (columns - self.place(rows, np.zeros(()))) / self.speed

    def light(self, rows: NDArray[np.int64], columns: NDArray[np.int64], times: Values) -> Values:
        """Return the light [DN] of pixels at times [s]; the three are broadcast."""
        ahead, behind = np.array(
            [(one.dark, one.bright)[:: 1 if one.polarity else -1] for one in self.bands]
        )[self.band_of(rows)].transpose(-1, *range(rows.ndim))
        share = 0.5 + 0.5 * np.tanh((self.place(rows, times) - columns) / self.half_width)
        return np.asarray(ahead + (behind - ahead) * share)

    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return rows and columns of all pixels, row after row."""
        rows, columns = np.indices(self.size[::-1])
        return rows.ravel(), columns.ravel()

    def near(self) -> NDArray[np.bool_]:
        """Return which of the pixels an edge comes near to."""
        rows, columns = self.pixels()
        return columns <= self.place(rows, np.full((), self.stop_s)) + CLEAR_PX

    def clip(self, rate: float) -> Clip:
        """Return frames at a rate [Hz], each the light of one instant."""
        times_ns = np.arange(int(self.end_s * rate + 1e-6) + 1) * 10**9 // round(rate)
        rows, columns = self.pixels()
        light = self.light(rows, columns, 1e-9 * times_ns[:, None])
        return Clip(light.reshape(-1, *self.size[::-1]).astype(np.float32), times_ns)

    def passages(self) -> Passages:
        """Return when edges passed, and which pixels they came near to last."""
        rows, columns = self.pixels()
        shape = self.size[::-1]
        at, stop = self.passage(rows, columns), self.place(rows, np.full((), self.stop_s))
        whole = columns <= stop - CLEAR_PX
        return Passages(
            time_us=np.where(whole, 1e6 * at, np.nan).reshape(shape),
            last=(self.near() & (columns > stop - LAST_PX)).reshape(shape),
            band=self.band_of(rows).reshape(shape),
            polarity=tuple(one.polarity for one in self.bands),
            lead_us=1e6 * CLEAR_PX / self.speed,
            stop_us=1e6 * self.stop_s,
            end_us=1e6 * self.end_s,
        )
