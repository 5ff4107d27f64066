"""Bursts of events of all pixels with a period of their own, which no frame of the recording has.

A camera may read out its frames at another rate than that of the film it is given, and each readout
disturbs the event pixels (:mod:`adv2e.effects.readout.frame_coupling`).  Two of the highest bursts
lead to all others, which tell the period ever better, and when in it the bursts begin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.hints.readouts import DELAY, RISE, Burst, burst_of, folded
from adv2e.diagnosis.hints.stamps import tick_of

Array = NDArray[np.float64]

PERIOD = "readout.frame_coupling.period_us"

_BIN_US = 200.0
_COARSEST_US = 50
"""Tick of stamps: of coarser ones all events come in bursts."""
_BESIDE = 25
"""Bins to both sides that tell how many events are usual."""
_HIGHEST, _APART = 16, 5
"""Bursts of which two may lead to the others, and how many bins they are apart at least."""
_PARTS = (1, 2, 3)
"""Of the time between two of them."""
_FEWEST = 4
_SHORTEST = 15
"""Bins of a period: what comes more often has no background to stand out of."""
_HIGH, _HIGHER = 4.0, 12.0
"""Deviations of a bin that count as a burst, and of which more do not count as more."""
_MOST = 0.5
"""Share of the times at which there must be one: small leaps make few events where little moves."""
_AROUND_US = (400.0, 200.0, 100.0)
"""Of a burst as known by then: events that tell its time better."""
_FINE_US = 10.0
_BEGIN_SD_US = 12.0
"""Standard deviation of when bursts begin: no one knows how fast a leap rises."""
_STAMP_SD_US = 0.3
_LEAST_RISE_US = 1.0
_EDGE, _BEFORE_EDGE = 0.02, 0.1
"""Shares of a burst's events that come before its edge is passed, and a while after it."""
_FEW = 3.0
"""A deviation told by few bursts may be larger, by this over their number."""


@dataclass(frozen=True)
class OwnPeriod:
    """Bursts that come again after the same time.

    Attributes
    ----------
    period_us, period_sd_us : float
        From one to the next, by the clock of the events, and its standard deviation.
    begin_sd_us : float
        Standard deviation of when they begin.
    on, off : Burst, optional
        Of each polarity, from zero of that clock on; of one there may be none.
    """

    period_us: float
    period_sd_us: float
    begin_sd_us: float
    on: Burst | None
    off: Burst | None

    @property
    def first(self) -> Burst:
        """The burst of the leap, from which it is shorter to the other than back."""
        one, other = self.on or self.off, self.off or self.on
        assert one is not None
        assert other is not None
        later = (other.begins_us - one.begins_us) % self.period_us
        return one if later <= 0.5 * self.period_us else other

    @property
    def keys(self) -> dict[str, float]:
        """The keys of leaps that only decay: while one rises, all pixels fire that it makes fire.

        Behind all poles, an event tells where its pixel's signal was in that time: a leap that
        rises three times as slowly parts them three times as far.
        """
        rise = max(self.first.lasts_us, _LEAST_RISE_US)
        return {PERIOD: self.period_us, DELAY: self.first.begins_us, RISE: rise}

    def keys_of_pulse(self, up: bool) -> dict[str, float] | None:
        """Return the keys of leaps upwards or downwards, and back.

        None: one burst is missing, or it is sooner from the other to this one.  Leaps the other
        way, and back after the rest of the period, are the same signal, with starts of its time
        constant that are far from those that pulses have.
        """
        first, second = (self.on, self.off) if up else (self.off, self.on)
        if first is None or second is None or first is not self.first:
            return None
        return {PERIOD: self.period_us, **first.until(second, self.period_us)}

    @property
    def read_off(self) -> tuple[tuple[str, float], ...]:
        return (PERIOD, self.period_sd_us), (DELAY, self.begin_sd_us)

    def text(self) -> str:
        """Return a sentence about the bursts: shares of the events, and their period."""
        shares = [
            f"{burst.share:.0%} of the {name} events"
            for burst, name in ((self.on, "ON"), (self.off, "OFF"))
            if burst is not None
        ]
        return (
            f"{' and '.join(shares)} come at once every {self.period_us / 1e3:.5g} ms, as if the"
            " readout of frames that are not those of the recording disturbed the pixels"
            " (frame_coupling)"
        )


def own_period_of(stream: Stream, times_s: Array) -> OwnPeriod | None:
    """Return the bursts of all pixels with a period that is not that of frames at `times_s`.

    None: there are none, or others as well, or they are too few.
    """
    start_us, stop_us = 1e6 * float(times_s[0]), 1e6 * float(times_s[-1])
    bins = int((stop_us - start_us) // _BIN_US)
    if bins < _FEWEST * _SHORTEST or tick_of(stream.t) > _COARSEST_US:
        return None
    parts = [stream.t[stream.on == on] - start_us for on in (1, 0)]
    steps, at = _likeliest(np.max([_heights(part, bins) for part in parts], axis=0))
    if len(steps) < _FEWEST:
        return None
    period, first = np.polyfit(steps, (at + 0.5) * _BIN_US, 1).tolist()
    period, first, period_sd = _refined(stream.t - start_us, steps, period, first)
    interval = 1e6 * float(np.median(np.diff(times_s)))
    if period <= 0.0 or abs(period - interval) * len(times_s) < _BIN_US:
        return None
    # bursts away from the border of what is laid over itself
    border = first - 0.5 * period
    bin_us = period / round(period / _FINE_US)
    found = [burst_of(folded(part - border, period, bin_us), bin_us) for part in parts]
    if not any(found):
        return None
    # as far as bursts in the middle of the recording tell when those about zero were
    turns = (start_us + first) / period + float(np.mean(steps))
    begin_sd = float(np.hypot(_BEGIN_SD_US, turns * period_sd))

    def placed(burst: Burst | None, part: Array) -> Burst | None:
        if burst is None:
            return None
        begins, ends = _edges((part - border) % period, burst, bin_us)
        return replace(
            burst, begins_us=(start_us + border + begins) % period, lasts_us=ends - begins
        )

    return OwnPeriod(period, period_sd, begin_sd, *map(placed, found, parts))


def _edges(late_us: Array, burst: Burst, bin_us: float) -> tuple[float, float]:
    """Return the begin and end of a burst of one polarity, finer than its bins [us].

    `late_us`: of all events of the polarity.  The usual number of events is subtracted, and each
    edge is extrapolated by a line through two quantiles of the first, or last, events.
    """
    middle = burst.begins_us + 0.5 * burst.lasts_us
    reach = 0.5 * burst.lasts_us + 2.0 * bin_us
    since = late_us - middle
    usual = np.count_nonzero((np.abs(since) > reach) & (np.abs(since) <= 3.0 * reach)) / 4.0 / reach
    inside = np.sort(since[np.abs(since) <= reach])

    def edge(since: Array) -> float:
        above = np.arange(1, len(since) + 1) - usual * (since + reach)
        few, some = (
            float(since[np.argmax(above >= share * above[-1])]) for share in (_EDGE, _BEFORE_EDGE)
        )
        return few - (some - few) * _EDGE / (_BEFORE_EDGE - _EDGE)

    return middle + edge(inside), middle - edge(-inside[::-1])


def _heights(t_us: NDArray[Any], bins: int) -> Array:
    """Return the excess of events in each bin over its surroundings [deviations of chance]."""
    inside = t_us[(t_us >= 0.0) & (t_us < bins * _BIN_US)]
    count = np.bincount((inside / _BIN_US).astype(np.int64), minlength=bins)
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(count, _BESIDE, mode="reflect"), 2 * _BESIDE + 1
    )
    usual = np.median(around, axis=1)
    return np.asarray((count - usual) / np.sqrt(usual + 1.0))


def _likeliest(height: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of periods and the bins of the bursts that keep time best; or none."""
    most, best = 0.0, (np.zeros(0, np.int64), np.zeros(0, np.int64))
    highest = _highest(height)
    for anchor in highest:
        for other in highest:
            for part in _PARTS:
                step = (other - anchor) / part
                if step < _SHORTEST or (_FEWEST - 1) * step > len(height):
                    continue
                steps, at = _followed(height, anchor, step)
                worth = float(np.sum(np.minimum(height[at], _HIGHER) - _HIGH))
                seen = height[at] >= _HIGH
                if worth > most and np.mean(seen) >= _MOST:
                    most, best = worth, (steps[seen], at[seen])
    return best


def _highest(height: Array) -> list[int]:
    left, found = height.copy(), []
    for _ in range(_HIGHEST):
        top = int(np.argmax(left))
        if left[top] < _HIGH:
            break
        found.append(top)
        left[max(top - _APART, 0) : top + _APART + 1] = -np.inf
    return found


def _followed(
    height: Array, anchor: int, step: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the bins of bursts a number of steps from an anchor, and those numbers.

    Each tells the step better, by which the next is found.
    """
    steps, at = [0], [anchor]
    for way in (1, -1):
        k, last, last_k = 0, anchor, 0
        while True:
            k += way
            middle = round(last + (k - last_k) * step)
            if not 1 <= middle < len(height) - 1:
                break
            bin_of = middle - 1 + int(np.argmax(height[middle - 1 : middle + 2]))
            steps.append(k)
            at.append(bin_of)
            if height[bin_of] >= _HIGH:
                last, last_k = bin_of, k
                step = (last - anchor) / k
    return np.array(steps), np.array(at)


def _refined(
    t_us: NDArray[Any], steps: NDArray[np.int64], period: float, first: float
) -> tuple[float, float, float]:
    """Return the period, the time of burst 0, and the standard deviation of the period [us].

    By the mean time of the events in each burst.
    """
    sd = np.inf
    for around_us in _AROUND_US:
        expected = first + period * steps
        ends = np.searchsorted(t_us, [expected - around_us, expected + around_us])
        there = ends[1] > ends[0]
        if np.count_nonzero(there) < _FEWEST:
            break
        k = steps[there].astype(np.float64)
        total = np.concatenate([[0.0], np.cumsum(t_us)])
        number = (ends[1] - ends[0])[there]
        middle = (total[ends[1]] - total[ends[0]])[there] / number
        period, first = np.polyfit(k, middle, 1).tolist()
        apart = middle - (first + period * k)
        spread = np.sqrt(np.sum(apart**2) / (len(k) - 2) + _STAMP_SD_US**2)
        few = 1.0 + _FEW / (len(k) - 2)
        sd = float(few * spread / np.sqrt(np.sum((k - k.mean()) ** 2)))
    return period, first, sd
