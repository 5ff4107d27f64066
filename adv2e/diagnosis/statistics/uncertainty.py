r"""Error of the statistics by light that the frames do not show: bias and uncertainty.

Between frames, between pixels and between the levels of the frames' numbers a simulation knows
nothing of the light.  What it makes up changes each statistic by an error e, of which the change d
tells that frames which tell less make, in deviations of chance, compressed
(:mod:`adv2e.diagnosis.statistics.metric`):

.. math:: e = k d \pm f \sqrt{\tfrac{1}{2} (d^2 + \overline{d^2})},

with the mean over those statistics of a group that feel the frames, and for these.  The first part
is taken off all simulations.

**Between frames**, d is what leaving out every second frame changes, and k = 1/4.  How much is
uncertain, f, depends on whether the frames resolve the motion.  Where they do, frames that are
blended are wrong by what the light bends, to leading order by the square of the time between them:
e = d/3 (Richardson extrapolation [1]_), and leaving out three of four frames changes five times as
much as every second; where they do not, the two changes are about as large, as is e.  So the ratio
r of the two tells what to expect, :math:`f = (1.2 / r)^{1.8}`, from 0.2 to 1.  Frames that are
moved along their optical flow are wrong where that is, whatever the time between them: e hardly
goes with d, nor f with r, and f = 0.7, as where frames are too few to tell r.
``scripts/studies/interpolation_error.py`` as of commit b916649 measured e, and what is left of it
beside its doubt, on scenes seen at 2000 frames a second of which a 4th to 64th is taken; numbers
here were chosen on others like them.

**Between levels**, d is what rounding to every third level changes.  It has hardly the direction of
e, but is two to five times as large (of four scenes of 60 to 250 frames a second in 8 bits and 16:
.2 to .5 of it), so nothing is taken off, and f = 0.4.

**Between pixels**, frames cannot be shifted by parts of a pixel without error, most of all where
edges are sharp.  Moving them there and back adds nothing but that error, twice, though less the
second time, when what is finest is gone already: 3/4 of the change is taken off simulations with
that shift, and counted as uncertain.  Recordings by a camera that sees its scene where it is depart
from plain simulations with their shift by 0.6 to 1.1 of that change (the six of eight recordings
that it changes most), and single statistics from that by some 0.6 of it.

References
----------
.. [1] L. F. Richardson, "The approximate arithmetical solution by finite differences of physical
   problems", Philosophical Transactions of the Royal Society A 210, 1911,
   doi:10.1098/rsta.1911.0009.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.configurations import with_keys, without_coupling
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.metric import compressed, expanded
from adv2e.diagnosis.statistics.summary import Sampler, SummaryStatistics

Array = NDArray[np.float64]

PILOT_SEEDS = range(10_000, 10_016)

_FRAMES_TAKEN_OFF = 0.25
_MOVED, _BLENDED = 0.7, (0.2, 1.0)
_FEWEST = 5
"""Frames that must be left for a simulation to say anything."""

_LEVELS_DOUBT = 0.4
_FINE_DN = 0.05
"""Steps, of 255, that leave nothing to be seen: those of 12 bits are a little larger."""

_SHIFT_TAKEN_OFF = 0.75
_SHIFT_SEEDS = range(1, 17)
_STEP_PX = 0.05
"""Shifts that differ by less are given the same error, as it hardly changes."""

_SPREAD = 0.45  # of the logarithm
_TAIL = 4.0


@dataclass(frozen=True)
class FrameError:
    """Error of each statistic that is due to what the frames do not tell, (views, statistics).

    By how much simulations exceed what they would be without it, as far as is known, and the
    uncertainty of that.
    """

    bias: Array
    sd: Array

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> FrameError:
        return cls(np.zeros(shape), np.zeros(shape))

    def __add__(self, other: FrameError) -> FrameError:
        """Return the sum of two independent errors: biases add, deviations in quadrature."""
        return FrameError(self.bias + other.bias, np.hypot(self.sd, other.sd))

    def blurred(self, sample: Array, view: int, stream: int) -> Array:
        """Return simulations, (seeds, statistics), spread by what is uncertain.

        How far one recording is off in all is uncertain, too, and single statistics are off by more
        than the others.  The draws have a mean of zero, are the same for every model, and differ
        between streams.
        """
        random = np.random.default_rng([stream, view, len(sample)])
        single = random.standard_t(_TAIL, sample.shape) / np.sqrt(_TAIL / (_TAIL - 2.0))
        in_all = np.exp(_SPREAD * random.normal(size=(len(sample), 1)) - _SPREAD**2)
        draws = single * in_all
        return np.asarray(sample + (draws - draws.mean(axis=0)) * self.sd[view])

    def chance(self, total: Array, view: int) -> Array:
        """Return the deviations of chance, of those of chance and of what is uncertain together."""
        return np.asarray(np.sqrt(np.maximum(total**2 - self.sd[view] ** 2, 0.01 * total**2)))

    def doubt(self, chance: Array, view: int) -> float:
        """Return the RMS uncertainty in deviations of chance; `chance`: (statistics,)."""
        return float(np.sqrt(np.mean((self.sd[view] / chance) ** 2)))


@dataclass(frozen=True)
class Change:
    """Change of statistics with fewer or coarser frames, compressed, (views, statistics)."""

    own: Array
    """Of each statistic, less what chance makes of it."""
    usual: Array
    """Root mean square of those of its group that feel the frames, times how much it does."""
    deviation: Array
    """Of chance, in the units of the statistics."""

    @classmethod
    def of(cls, plain: Array, less: Array, groups: Sequence[str], least: Array) -> Change:
        """Return the change from simulations to others of the same seeds.

        Both (seeds, views, statistics); `groups`: which statistics go together; `least`: deviation
        below which each does not count as known, (statistics,).
        """
        deviation = np.maximum(plain.std(axis=0, ddof=1), least)
        apart = (less - plain) / deviation
        own = compressed(beyond_chance(apart))
        return cls(own, np.sqrt(_usual_squares(apart, groups)), deviation)

    def error(self, known: float, uncertain: float) -> FrameError:
        """Return the error of which shares of the change are known, and uncertain.

        Where a statistic happens not to change in the mean, others of its kind tell what to expect.
        """
        doubt = uncertain * np.sqrt((self.own**2 + self.usual**2) / 2.0)
        bias, sd = (self.deviation * expanded(part) for part in (known * self.own, doubt))
        return FrameError(bias, sd)


def beyond_chance(differences: Array) -> Array:
    """Return the mean over seeds, less what chance puts into it."""
    mean = differences.mean(axis=0)
    error = differences.std(axis=0, ddof=1) / np.sqrt(len(differences))
    return np.asarray(np.sign(mean) * np.sqrt(np.maximum(mean**2 - error**2, 0.0)))


def _usual_squares(differences: Array, groups: Sequence[str]) -> Array:
    """Return the squared change to expect of each statistic, less what chance puts into it.

    Simulations of the same seed that differ as two of different seeds do feel the frames in full;
    noise of pixels that rest is the same in both.
    """
    felt = np.minimum(np.mean(differences**2, axis=0) / 2.0, 1.0)
    chance = np.minimum(differences.var(axis=0, ddof=1) / len(differences), 1.0)
    squares = compressed(differences.mean(axis=0)) ** 2 - chance
    usual = np.empty_like(squares)
    for group in dict.fromkeys(groups):
        own = np.array([one == group for one in groups])
        all_felt = np.maximum(felt[:, own].sum(axis=1, keepdims=True), 1e-9)
        usual[:, own] = squares[:, own].sum(axis=1, keepdims=True) / all_felt
    return np.asarray(felt * np.maximum(usual, 0.0))


@dataclass(frozen=True)
class Pilot:
    """Simulations of the declared model, by seed, that tell what to expect, also of other frames.

    `simulator` is of the recording.
    """

    evidence: Evidence
    declared: Config
    statistics: SummaryStatistics
    streams: dict[int, Stream]
    simulator: Simulator

    @cached_property
    def sample(self) -> Array:
        return np.array(self.simulator.map(self.statistics.measure, self.streams.values()))

    @cached_property
    def undisturbed(self) -> Pilot:
        """The same of a model without frame coupling, for frames that are to be left out."""
        bare = without_coupling(self.declared)
        if bare == self.declared:
            return self
        streams = self.simulator.aside().streams(bare, self.streams)
        return replace(self, declared=bare, streams=dict(zip(self.streams, streams, strict=True)))

    def change(self, evidence: Evidence) -> Change:
        """Return the change of the statistics with the frames of `evidence`, by the same seeds."""
        measure, declared = self.statistics.measure, self.declared
        with closing(self.simulator.of(evidence)) as made:
            less = made.map(lambda seed: measure(made.stream(declared, seed)), self.streams)
        return Change.of(self.sample, np.array(less), self.statistics.titles, self.statistics.least)


def between_frames(pilot: Pilot) -> FrameError | None:
    """Return the error of interpolation; None: too few frames to leave any out."""
    half, quarter = (every(pilot.evidence, step) for step in (2, 4))
    if len(half.frames) < _FEWEST:
        return None
    pilot = pilot.undisturbed
    change, uncertain = pilot.change(half), _MOVED
    if pilot.declared.sampling.interpolation == "linear" and len(quarter.frames) >= _FEWEST:
        uncertain = of_blended(pilot.change(quarter).own, change.own)
    return change.error(_FRAMES_TAKEN_OFF, uncertain)


def of_blended(of_quarter: Array, of_half: Array) -> float:
    """Return the share of the change that is uncertain where frames are blended.

    From the changes that leaving out three of four frames makes, and every second.
    """
    square = float(np.mean(of_half**2))
    ratio = np.sqrt(np.mean(of_quarter**2) / square) if square > 0.0 else np.inf
    return float(np.clip((1.2 / ratio) ** 1.8, *_BLENDED))


def every(evidence: Evidence, step: int) -> Evidence:
    """Return the recording with every `step`-th frame, and the last."""
    keep = sorted({*range(0, len(evidence.frames), step), len(evidence.frames) - 1})
    return replace(
        evidence, frames=[evidence.frames[k] for k in keep], times_s=evidence.times_s[keep]
    )


def between_levels(pilot: Pilot) -> FrameError | None:
    """Return the error of the levels of the frames; None where they are fine."""
    if pilot.evidence.quantum_dn(pilot.declared) < _FINE_DN:
        return None
    return pilot.change(coarser(pilot.evidence)).error(0.0, _LEVELS_DOUBT)


def coarser(evidence: Evidence) -> Evidence:
    """Return the recording with its frames, of whole numbers, rounded to every third level.

    An odd number of levels has one in the middle, so that the light stays what it is on average.
    """

    def rounded(image: NDArray[Any]) -> NDArray[Any]:
        # the largest number of 2, 4, 8, ... bits is a multiple of three; others stay below it
        levels = (image.astype(np.int64) + 1) // 3 * 3
        return np.minimum(levels, np.iinfo(image.dtype).max).astype(image.dtype)

    return evidence.with_frames(rounded)


class Resampling:
    """Errors of simulations with shifted frames, each found when it is asked for first."""

    def __init__(self, sampler: Sampler, declared: Config) -> None:
        self._sampler = sampler
        self._unmoved = with_keys(declared, {"frames.shift_px": [0.0, 0.0]})
        self._held: dict[tuple[float, float], FrameError] = {}

    def error(self, config: Config) -> FrameError | None:
        """Return the error of a model's statistics; None where no part of a pixel is shifted."""
        x, y = (_STEP_PX * round(part / _STEP_PX) for part in config.frames.shift_px)
        if x == round(x) and y == round(y):
            return None
        if (x, y) not in self._held:
            plain = self._sampler.sample(self._unmoved, _SHIFT_SEEDS)
            back = self._sampler.there_and_back(self._unmoved, (x, y), _SHIFT_SEEDS)
            bias = _SHIFT_TAKEN_OFF * beyond_chance(back - plain)
            self._held[x, y] = FrameError(bias, abs(bias))
        return self._held[x, y]
