"""Timestamp resolution, arbiter times and double reads, where fits of the readout start.

Fits do not find the times of an arbiter by steps from anywhere: timestamps of a busy channel form
a comb, and a comb of other times is as far from it as none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.splits import Stream
from adv2e.effects.readout.double_read import DoubleRead

_STAMPS = 20
_FEWEST_TWICE = 10
"""Fewest events that were read twice, below which it is an accident."""
_ON_TICK = 0.99

_LEAST_US = 3
"""Least time of a row that stands out from stamps of whole microseconds."""
_LONGEST_US = 20_000
_RARELY = 0.01
_STANDS_OUT = 2.0
_NOTHING_NS = 20.0
_ROUNDS = 10

_SD_NS = 50.0
"""Standard deviation of an event's time where gaps are spread as no single time makes them."""
_SD_OF_BOTH_NS, _SD_OF_CHANCE_NS = 5.0, 120.0
"""Of both times together beside their chance, and more by the share of what comes by chance."""


class Service(NamedTuple):
    """Times that an event and the selection of a row take [ns], and their standard deviations."""

    event_ns: float
    row_ns: float
    event_sd_ns: float
    row_sd_ns: float


def tick_of(times_us: NDArray[np.int64]) -> int:
    """Return the largest time of which nearly all stamps are multiples [us].

    Of the times themselves, not of differences: ticks count from zero.  Of few stamps at a time, so
    that one which is wrong does not decide.
    """
    if len(times_us) < _STAMPS:
        return max(1, int(np.gcd.reduce(times_us))) if len(times_us) else 1
    groups = times_us[: len(times_us) // _STAMPS * _STAMPS].reshape(_STAMPS, -1)
    steps, often = np.unique(np.gcd.reduce(groups, axis=0), return_counts=True)
    step = max(1, int(steps[np.argmax(often)]))
    return step if np.mean(times_us % step == 0) >= _ON_TICK else 1


def double_reads(stream: Stream) -> DoubleRead | None:
    """Return the shares of events that were read twice: two events of a pixel within 1 us.

    Where the polarities of the two differ as often as not, one of both is always ON.
    """
    if tick_of(stream.t) > 1:
        return None
    twice = (stream.since >= 0) & (stream.since <= 1)
    if np.count_nonzero(twice) < _FEWEST_TWICE:
        return None
    sums = (stream.on + stream.on_before)[twice]
    off, mixed, on = np.bincount(sums, minlength=3).tolist()
    ons = np.count_nonzero(stream.on)
    offs = len(stream) - ons - off  # the second readings are no events of their own
    if mixed > off:
        return DoubleRead(on=_share(on, ons - on - mixed), off=_share(mixed, offs), polarity="on")
    return DoubleRead(on=_share(on, ons - on), off=_share(off, offs))


def _share(part: int, whole: int) -> float:
    """Return a share, in three digits."""
    return float(f"{part / max(whole, 1):.3g}")


def service_times(stream: Stream) -> Service | None:
    """Return the times that an event and the selection of a row seem to take.

    An arbiter (:mod:`adv2e.effects.readout.arbiter`) lets no two events of different rows out in
    less than the time of both, and what waits for it leaves just that time later.  None where
    stamps do not look so.
    """
    row, column = np.divmod(stream.pixel.astype(np.int64), stream.width)
    gap, down, right = np.diff(stream.t), np.diff(row), np.diff(column)
    between_rows = gap[(down != 0) & (gap < _LONGEST_US)]
    often = np.bincount(between_rows, minlength=_LONGEST_US + 10)
    both_us = int(np.argmax(often))
    if both_us < _LEAST_US or often[both_us] < _STANDS_OUT * often[both_us + 2 : both_us + 6].max():
        return None
    if often[: both_us - 1].sum() > _RARELY * len(between_rows):
        return None
    both_ns, both_sd_ns = _of_both(often, both_us)
    latched = gap[(down == 0) & (right > 0) & (gap < both_us - 1)]
    event_ns, event_sd_ns = _of_an_event(latched, both_ns)
    row_sd_ns = float(np.hypot(event_sd_ns, both_sd_ns))
    return Service(event_ns, max(both_ns - event_ns, _NOTHING_NS), event_sd_ns, row_sd_ns)


def _of_an_event(latched: NDArray[np.int64], both_ns: float) -> tuple[float, float]:
    """Return the time that an event takes, and its standard deviation [ns].

    From the gaps between events that were latched together: each is that time, less or more what
    makes whole microseconds of it.
    """
    count = len(latched)
    if count == 0:
        return _NOTHING_NS, both_ns  # whatever it is
    mean = float(latched.mean())
    least = int(mean)
    if np.mean((latched == least) | (latched == least + 1)) < 1.0 - _RARELY:
        usual = int(np.argmax(np.bincount(latched)))
        near = latched[np.abs(latched - usual) <= 1]  # not beside what was lost
        return max(1e3 * float(near.mean()), _NOTHING_NS), _SD_NS
    # of those that are the longer ones; where none is seen, there may be one in as many again
    longer = ((mean - least) * count + 1.0) / (count + 2.0)
    return max(1e3 * mean, _NOTHING_NS), 1e3 * float(np.sqrt(longer * (1.0 - longer) / count))


def _of_both(often: NDArray[np.int64], about_us: int) -> tuple[float, float]:
    """Return the time that what had waited follows in, and its standard deviation [ns].

    Nothing follows sooner, and what comes by chance does so from there on, ever less often; both
    stamps have lost their parts of a microsecond, which spreads a gap over two of them.  `often`:
    how often each gap is [us], of which `about_us` is the most frequent one.
    """
    near = about_us + np.arange(-1, 2)
    soon, later = (float(often[about_us + k : about_us + k + 4].mean()) for k in (2, 6))
    fading = min(max(soon / max(later, 1.0), 1.0), _STANDS_OUT) ** 0.25
    chance = soon * fading ** (about_us + 3.5 - near)
    both = float(about_us)
    for _ in range(_ROUNDS):
        after = np.clip(near - both, -1.0, 1.0)
        whole = np.where(after < 0.0, 0.5 * (1.0 + after) ** 2, 1.0 - 0.5 * (1.0 - after) ** 2)
        waited = np.maximum(often[near] - chance * whole, 0.0)
        both = float(np.average(near, weights=waited))
    counted = float(often[near].sum())
    sd = np.hypot(500.0 / np.sqrt(counted), _SD_OF_BOTH_NS + _SD_OF_CHANCE_NS * soon / counted)
    return 1e3 * both, float(sd)
