"""When frames are read out, as far as the events of a recording tell.

Where the readout of a frame disturbs the event pixels
(:mod:`adv2e.effects.readout.frame_coupling`), all of them fire at once, equally long after every
frame.  That is when its exposure ends: half of it after the frame's own time, or that and whole
intervals between frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.keys import with_keys
from adv2e.effects.readout.frame_coupling import FrameCoupling

EXPOSURE = "frames.exposure_us"

_BINS = 100
_SD_BINS = 1.5
"""Of an exposure, twice what is not known of the delay: part of a bin, and how a leap rises."""
_REGULAR = 0.01
"""Most by which intervals between frames may differ, as a share of them."""
_STANDS_OUT, _OVER_OTHERS = 10.0, 3.0
"""Deviations of a rise from bin to bin that is no chance, and how often it is any other."""


@dataclass(frozen=True)
class Readouts:
    """Times of readouts, or some whole intervals later.

    Attributes
    ----------
    delay_us : float
        After the stamp of each frame, less than an interval.
    interval_us : float
        Between frames.
    """

    delay_us: float
    interval_us: float

    @property
    def exposure_sd_us(self) -> float:
        """Standard deviation of the exposures that end there."""
        return _SD_BINS * self.interval_us / _BINS

    def exposed(self, config: Config) -> Config:
        """Return `config` with the exposure next to its own that ends at a readout."""
        whole = 2.0 * self.interval_us
        least = 2.0 * (self.delay_us - config.frames.clock_offset_us) % whole
        count = max(round((config.frames.exposure_us - least) / whole), 0 if least > 0.0 else 1)
        return with_keys(config, {EXPOSURE: least + count * whole})


def coupling_of(config: Config) -> FrameCoupling | None:
    """Return what the readout of frames does to the pixels, if anything."""
    return None if config.readout is None else config.readout.frame_coupling


def without_coupling(config: Config) -> Config:
    """Return `config` without what the readout of frames does to the pixels.

    Frames that are left out of a simulation, to see what is made up between others, were read out
    all the same: with it both were to be compared without.
    """
    readout = config.readout
    if readout is None or coupling_of(config) is None:
        return config
    return replace(config, readout=replace(readout, frame_coupling=None))


def regular_interval(times_us: NDArray[np.float64]) -> float | None:
    """Return the interval between frames [us]; None: there is none, or they differ.

    Parameters
    ----------
    times_us : (frames,)
    """
    intervals = np.diff(times_us)
    interval = float(np.median(intervals)) if len(intervals) else 0.0
    if interval <= 0.0 or np.abs(intervals - interval).max() > _REGULAR * interval:
        return None
    return interval


def readouts_of(stream: Stream, times_s: NDArray[np.float64]) -> Readouts | None:
    """Return when frames are read out; None: nothing happens to all pixels at once.

    Parameters
    ----------
    stream : Stream
    times_s : (frames,)
        Stamps of the frames [s].
    """
    times_us = 1e6 * times_s
    interval = regular_interval(times_us)
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
