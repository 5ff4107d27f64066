"""Frame readout times, and the bursts of events that frame readouts cause, from the events.

Where the readout of a frame disturbs the event pixels
(:mod:`adv2e.effects.readout.frame_coupling`), all of them fire at once, equally long after every
frame: when its exposure ends, half of it after the frame's own time, or that and whole intervals
between frames.  Where the signal leaps back a while later, events of one polarity come first, of
the other then.  Such bursts stand out of the rate of each polarity against the time since a frame.
They also tell how far apart the frames are by the clock of the events, to some ten parts in a
million.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.configurations import coupling_of, with_keys
from adv2e.diagnosis.data.splits import Stream

Array = NDArray[np.float64]

EXPOSURE = "frames.exposure_us"
DELAY, WIDTH, RISE = (f"readout.frame_coupling.{name}_us" for name in ("delay", "width", "rise"))
DRIFT = "frames.clock_drift_ppm"

_REGULAR = 0.01
"""Most by which intervals between frames may differ, as a share of them."""
_STANDS_OUT = 10.0
"""Deviations of a rise from bin to bin, or of a burst, that is no chance."""

_BINS = 100
_SD_BINS = 1.5
"""Standard deviation of an exposure [bins]: twice that of the delay."""
_OVER_OTHERS = 3.0
"""Least ratio of the largest rise to any other."""

_PULSE_BINS, _SHORTEST_US, _LONGEST_US = 400, 20.0, 100.0
"""Of an interval between frames, and how long each is."""
_FEWEST = 3
"""Frames: bursts come again."""
_FARTHEST = 0.02
"""Most by which the clock of the frames may be slow or fast."""
_BEGINNING_US, _MORE = 2e6, 4
"""Length that is searched first [us]; trial intervals to both sides at each doubling of it."""
_SHARPER = 1.5
"""Factor by which bursts must be sharper for another frame interval to be believed; the border of a
bin that parts a burst makes a third."""
_ENOUGH = 100_000
"""Events of a polarity that tell the interval."""
_TIMES_AS_MANY = 3.0
"""Least ratio of the event rate in a burst to the median rate."""
_FOOT = 0.25
"""Share of its height at which a burst begins."""
_LONGEST = 0.04
"""Share of an interval that a burst takes at most: lamps at multiples of the frame rate make ON and
OFF events in turn, too, but for milliseconds, and again and again."""
_OTHERS = 0.5
"""Of its height that any other may have."""
_LEAST_SHARE = 0.01
"""Of the events of a polarity that come in the burst."""


def _regular_interval(times_us: Array) -> float | None:
    """Return the interval between frames [us]; None: there is none, or they differ."""
    intervals = np.diff(times_us)
    interval = float(np.median(intervals)) if len(intervals) else 0.0
    if interval <= 0.0 or np.abs(intervals - interval).max() > _REGULAR * interval:
        return None
    return interval


@dataclass(frozen=True)
class Readouts:
    """Times of readouts after the stamp of each frame, or some whole intervals later."""

    delay_us: float
    interval_us: float

    @property
    def exposure_sd_us(self) -> float:
        return _SD_BINS * self.interval_us / _BINS

    def exposed(self, config: Config) -> Config:
        """Return `config` with the exposure next to its own that ends at a readout."""
        whole = 2.0 * self.interval_us
        least = 2.0 * (self.delay_us - config.frames.clock_offset_us) % whole
        count = max(round((config.frames.exposure_us - least) / whole), 0 if least > 0.0 else 1)
        return with_keys(config, {EXPOSURE: least + count * whole})


def readouts_of(stream: Stream, times_s: Array) -> Readouts | None:
    """Return the readout times of frames; None: pixels do not fire at once after each frame."""
    times_us = 1e6 * times_s
    interval = _regular_interval(times_us)
    if interval is None:
        return None
    frame = np.clip(np.searchsorted(times_us, stream.t, "right") - 1, 0, len(times_us) - 2)
    phase = (stream.t - times_us[frame]) / interval % 1.0
    bin_of = np.minimum((phase * _BINS).astype(np.int64), _BINS - 1)
    rises = []
    for on in (0, 1):
        often = np.bincount(bin_of[stream.on == on], minlength=_BINS).astype(np.float64)
        before = np.roll(often, 1)
        rises.append((often - before) / np.sqrt(often + before + 1.0))
    rise = np.max(rises, axis=0)
    first = int(np.argmax(rise))
    others = np.delete(rise, [first, (first + 1) % _BINS])
    if rise[first] < max(_STANDS_OUT, _OVER_OTHERS * others.max()):
        return None
    return Readouts((first + 0.5) / _BINS * interval, interval)


@dataclass(frozen=True)
class Burst:
    """Events of one polarity that come at once after each frame.

    Attributes
    ----------
    begins_us : float
        After the time of each frame, or whole intervals later or earlier.
    share : float
        Of the polarity's events that are in such bursts.
    """

    begins_us: float
    lasts_us: float
    share: float

    def until(self, second: Burst, interval_us: float) -> dict[str, float]:
        """Return the keys of a pulse from this leap to that back, which come every interval."""
        # the shorter one: the other's events may have waited to be due
        rise = min(self.lasts_us, second.lasts_us)
        width = (second.begins_us - self.begins_us) % interval_us
        return {DELAY: self.begins_us, WIDTH: width, RISE: rise}


@dataclass(frozen=True)
class Pulse:
    """Two leaps of the signal after each frame.

    Attributes
    ----------
    on, off : Burst
        Of ON and of OFF events.
    interval_us : float
        Between frames, by the clock of the events.
    drift_ppm : float
        By how much the clock of the frames is slow; 0 where it cannot be told from the declared.
    before_s : float
        From the first frame that is simulated, which a drift of its clock leaves in place, to the
        first that is looked at.
    """

    on: Burst
    off: Burst
    interval_us: float
    drift_ppm: float
    before_s: float = 0.0

    def keys(self, up: bool) -> dict[str, float]:
        """Return the keys of a pulse that begins with a leap upwards or downwards.

        With the leap as long after the stamps; see :meth:`placed`.
        """
        first, second = (self.on, self.off) if up else (self.off, self.on)
        found = {**first.until(second, self.interval_us), DELAY: self._nearest(first.begins_us)}
        return {**found, DRIFT: self.drift_ppm} if self.drift_ppm else found

    def placed(self, config: Config) -> Config:
        """Return `config` with a pulse, if it has one, where the bursts are.

        Wherever its clocks and exposure put the frames.
        """
        coupling = coupling_of(config)
        if coupling is None or not coupling.width_us:
            return config
        first = self.on if coupling.amplitude > 0.0 else self.off
        frames = config.frames
        drifted_us = frames.clock_drift_ppm * self.before_s  # ppm of seconds are us
        ends = frames.clock_offset_us + drifted_us + 0.5 * frames.exposure_us
        return with_keys(config, {DELAY: self._nearest(first.begins_us - ends)})

    def text(self) -> str:
        """Return a sentence about the bursts: shares of the events, and their times."""
        on, off = (
            f"{burst.share:.0%} of the {name} events come at once"
            f" {self._nearest(burst.begins_us) / 1e3:+.2f} ms from each frame"
            for burst, name in ((self.on, "ON"), (self.off, "OFF"))
        )
        apart = f", and these are {self.interval_us / 1e3:.2f} ms apart" if self.drift_ppm else ""
        return f"{on}, {off}{apart}, as if their readout disturbed the pixels (frame_coupling)"

    def _nearest(self, time_us: float) -> float:
        half = 0.5 * self.interval_us
        return (time_us + half) % self.interval_us - half


def pulse_of(stream: Stream, times_s: Array, before_s: float = 0.0) -> Pulse | None:
    """Return the pulse that follows each frame with these stamps; None: there are not two bursts.

    `before_s`: see :class:`Pulse`.
    """
    times_us = 1e6 * (times_s - times_s[0])
    if _regular_interval(times_us) is None or len(times_us) < _FEWEST:
        return None
    # of stamps that are rounded the usual interval need not be the mean one
    declared, first_us = np.polyfit(np.arange(len(times_us)), times_us, 1).tolist()
    since = stream.t - 1e6 * times_s[0] - first_us
    parts = [since[stream.on == on] for on in (1, 0)]
    interval = _interval(parts, declared, float(times_us[-1]))
    bin_us = _bin_us(interval)
    on, off = (burst_of(folded(part, interval, bin_us), bin_us) for part in parts)
    if on is None or off is None:
        return None
    apart = (off.begins_us - on.begins_us) % interval
    if apart < on.lasts_us or interval - apart < off.lasts_us:  # as of stamps in whole intervals
        return None
    return Pulse(on, off, interval, 1e6 * (interval / declared - 1.0), before_s)


def has_pulse(config: Config) -> bool:
    """Tell whether the frame coupling of a configuration is a pulse: a leap and a leap back."""
    coupling = coupling_of(config)
    return coupling is not None and coupling.width_us > 0.0


def _bin_us(interval: float) -> float:
    longest = min(max(interval / _PULSE_BINS, _SHORTEST_US), _LONGEST_US)
    return float(interval / np.ceil(interval / longest))


def folded(since: Array, interval: float, bin_us: float) -> NDArray[np.int64]:
    """Return the histogram of event times folded at the frame interval, (bins,)."""
    bins = round(interval / bin_us)
    turns = since / interval  # a remainder takes several times as long
    place = ((turns - np.floor(turns)) * bins).astype(np.int64)
    return np.bincount(np.minimum(place, bins - 1), minlength=bins)


def _interval(parts: list[Array], declared: float, span_us: float) -> float:
    """Return the interval at which bursts are sharpest: the declared one unless others are more.

    It is sought in the beginning of a long recording, and told ever better from more of it.
    """
    bin_us = _bin_us(declared)

    def sharpness(interval: float, until_us: float) -> float:
        total = 0.0
        for part in parts:
            some = part[: np.searchsorted(part, until_us)]
            some = some[:: 1 + len(some) // _ENOUGH]
            count = folded(some, interval, bin_us * interval / declared)
            above = count - np.median(count)
            total += float(np.square(above + np.roll(above, 1)).sum())
        return total

    def best(middle: float, reach: int, until_us: float) -> float:
        tried = middle + 0.5 * bin_us * declared / until_us * np.arange(-reach, reach + 1)
        return float(max(tried, key=lambda one: sharpness(one, until_us)))

    until_us = min(span_us, _BEGINNING_US)
    interval = best(declared, round(_FARTHEST * 2.0 * until_us / bin_us), until_us)
    while until_us < span_us:
        until_us = min(2.0 * until_us, span_us)
        interval = best(interval, _MORE, until_us)
    is_sharper = sharpness(interval, span_us) > _SHARPER * sharpness(declared, span_us)
    return interval if is_sharper else declared


def burst_of(count: NDArray[np.int64], bin_us: float) -> Burst | None:
    """Return the burst that stands out of how many events come when; None: there is none."""
    level = float(np.median(count))
    top = int(np.argmax(count))
    above = count[top] - level
    if above < _STANDS_OUT * np.sqrt(level + 1.0) or count[top] < _TIMES_AS_MANY * level:
        return None
    middle = len(count) // 2
    around = np.roll(count, middle - top) - level
    (low,) = np.nonzero(around <= _FOOT * above)
    first = int(low[low < middle].max(initial=-1)) + 1
    last = int(low[low > middle].min(initial=len(count))) - 1
    burst = around[first : last + 1]
    others = max(around[:first].max(initial=0.0), around[last + 1 :].max(initial=0.0))
    if len(burst) > max(_LONGEST * len(count), 1.0) or others > _OTHERS * above:
        return None
    share = float(burst.sum() / count.sum())
    if share < _LEAST_SHARE:
        return None
    return Burst((top + first - middle) % len(count) * bin_us, len(burst) * bin_us, share)
