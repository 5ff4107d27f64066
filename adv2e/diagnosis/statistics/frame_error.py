"""Error of statistics that is due to what the frames do not tell, and how well it is known.

Of the light between two frames, between two pixels (:mod:`adv2e.diagnosis.statistics.resampling`)
and between two levels of their numbers.  What frames that tell less change is known, and what that
is worth is told by :mod:`adv2e.diagnosis.statistics.interpolation` and
:mod:`adv2e.diagnosis.statistics.levels`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.statistics.metric import compressed, expanded
from adv2e.diagnosis.statistics.pilot import Pilot

Array = NDArray[np.float64]

_SPREAD = 0.45  # of the logarithm
_TAIL = 4.0


@dataclass(frozen=True)
class FrameError:
    """Error of each statistic, in every view.

    Attributes
    ----------
    bias : (views, statistics)
        By how much simulations exceed what they would be without it, as far as is known.
    sd : (views, statistics)
        Uncertainty of that.
    """

    bias: Array
    sd: Array

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> FrameError:
        """Return no error."""
        return cls(np.zeros(shape), np.zeros(shape))

    def __add__(self, other: FrameError) -> FrameError:
        """Return both errors, which know nothing of each other."""
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
        """Return the deviations of chance, of those of chance and of what is uncertain together.

        Parameters
        ----------
        total : (statistics,)
        view : int
        """
        return np.asarray(np.sqrt(np.maximum(total**2 - self.sd[view] ** 2, 0.01 * total**2)))

    def doubt(self, chance: Array, view: int) -> float:
        """Return what is uncertain in deviations of chance, (statistics,), root mean square."""
        return float(np.sqrt(np.mean((self.sd[view] / chance) ** 2)))


@dataclass(frozen=True)
class Change:
    """What frames that tell less change, in compressed deviations of chance.

    Attributes
    ----------
    own : (views, statistics)
        Of each statistic, less what chance makes of it.
    usual : (views, statistics)
        Root mean square of those of its group that feel the frames, times how much it does itself.
    deviation : (views, statistics)
        Of chance, in the units of the statistics.
    """

    own: Array
    usual: Array
    deviation: Array

    @classmethod
    def of(cls, plain: Array, less: Array, groups: Sequence[str], least: Array) -> Change:
        """Return the change from simulations to others of the same seeds.

        Parameters
        ----------
        plain, less : (seeds, views, statistics)
        groups : sequence of str
            Of each statistic, which go together.
        least : (statistics,)
            Deviation below which each statistic is not trusted to be known.
        """
        deviation = np.maximum(plain.std(axis=0, ddof=1), least)
        apart = (less - plain) / deviation
        own = compressed(beyond_chance(apart))
        return cls(own, np.sqrt(_usual_squares(apart, groups)), deviation)

    @classmethod
    def of_pilot(cls, pilot: Pilot, less: Array) -> Change:
        """Return the change from the pilot's simulations to those of other frames."""
        return cls.of(pilot.sample, less, pilot.markers.titles, pilot.markers.least)

    def error(self, known: float, uncertain: float) -> FrameError:
        """Return the error of which shares of the change are known, and uncertain.

        Where a statistic happens not to change in the mean, others of its kind tell what to expect.
        """
        doubt = uncertain * np.sqrt((self.own**2 + self.usual**2) / 2.0)
        return FrameError(
            self.deviation * expanded(known * self.own), self.deviation * expanded(doubt)
        )


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
