r"""Distance of a recording from simulations, in terms of chance: misfit and likelihood.

Statistics are first put in deviations of the declared model and compressed,

.. math:: c = 3\,\mathrm{asinh}\!\left(\frac{s - m_0}{3\,\sigma_0}\right),

so that one statistic that hardly varies cannot decide alone.  A model is then a mean and a
deviation for each, with the correlations of the declared model, shrunk towards none; what it says
of a recording is a Gaussian likelihood (synthetic likelihood [1]_), and whether chance can make a
misfit as large is told by simulations left out of the mean (leave-one-out).

References
----------
.. [1] S. N. Wood, "Statistical inference for noisy nonlinear ecological dynamic systems", Nature
   466, 2010, doi:10.1038/nature09319.
.. [2] P. H. Westfall, S. S. Young, "Resampling-Based Multiple Testing", Wiley 1993 (the largest of
   many statistics against the largest of each simulation).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SHRINK = 0.5
_LEAST_SD = 0.5
_KNEE = 3.0


@dataclass(frozen=True)
class Scale:
    """The declared model's mean and deviation of each statistic, (statistics,).

    And their correlations, shrunk, (statistics, statistics).
    """

    mean: Array
    sd: Array
    correlation: Array

    @classmethod
    def of(cls, sample: Array, least: Array) -> Scale:
        """Return the scale of simulations, (seeds, statistics).

        `least` deviation, (statistics,): what hardly varies is not known that well either.
        """
        mean, sd = sample.mean(axis=0), np.maximum(sample.std(axis=0, ddof=1), least)
        scaled = compressed((sample - mean) / sd)
        scaled /= np.maximum(scaled.std(axis=0, ddof=1), 1e-9)
        scaled -= scaled.mean(axis=0)
        return cls(mean, sd, shrunk_correlation(scaled))

    def of_values(self, values: Array) -> Array:
        """Return statistics (..., statistics) in compressed deviations."""
        return compressed((values - self.mean) / self.sd)

    def values_of(self, compressed: Array) -> Array:
        """Return the statistics (..., statistics) of compressed deviations."""
        return np.asarray(self.mean + self.sd * expanded(compressed))

    @cached_property
    def whitening(self) -> Array:
        """Matrix that takes compressed deviations to uncorrelated ones."""
        return whitening(self.correlation)


def shrunk_correlation(apart: Array) -> Array:
    """Return the correlations of statistics, shrunk towards none.

    From distances of simulations from their mean, in deviations, (seeds, statistics).
    """
    correlation = (1.0 - _SHRINK) * (apart.T @ apart) / (len(apart) - 1)
    np.fill_diagonal(correlation, 1.0)
    return np.asarray(correlation)


def whitening(correlation: Array) -> Array:
    """Return the matrix that takes deviations with these correlations to uncorrelated ones."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(correlation)))


def compressed(z: Array) -> Array:
    """Return deviations so that one that is large counts for little more."""
    return np.asarray(_KNEE * np.arcsinh(z / _KNEE))


def expanded(compressed: Array | float) -> Array:
    return np.asarray(_KNEE * np.sinh(np.asarray(compressed) / _KNEE))


@dataclass(frozen=True)
class Ensemble:
    """Simulations of one model on the scale of the declared one.

    `sample`: (seeds, statistics), in compressed deviations.
    """

    scale: Scale
    sample: Array

    @classmethod
    def of(cls, scale: Scale, sample: Array) -> Ensemble:
        """Return the ensemble of simulations, (seeds, statistics) as measured."""
        return cls(scale, scale.of_values(sample))

    @cached_property
    def mean(self) -> Array:
        return np.asarray(self.sample.mean(axis=0))

    @cached_property
    def sd(self) -> Array:
        """Deviation in compressed deviations, not taken for less than half."""
        return np.asarray(np.maximum(self.sample.std(axis=0, ddof=1), _LEAST_SD))

    def z(self, values: Array) -> Array:
        """Return z-scores: measured statistics less the mean of this model, in its deviations."""
        return self._deviations(self.scale.of_values(values))

    def _deviations(self, compressed: Array) -> Array:
        return np.asarray((compressed - self.mean) / (self.sd * self._inflation))

    @property
    def _inflation(self) -> float:
        return math.sqrt(1.0 + 1.0 / len(self.sample))  # a mean of few is not known well

    def misfit(self, values: Array) -> float:
        """Return the mean square of the uncorrelated deviations of measured statistics."""
        white = self.scale.whitening @ self.z(values)
        return float(np.mean(white * white))

    def log_likelihood(self, values: Array) -> float:
        white = self.scale.whitening @ self.z(values)
        return float(-0.5 * white @ white - np.log(self.sd).sum())

    def pull(self, values: Array) -> Array:
        """Return the influence of each simulation on the log likelihood, (seeds,).

        By its part in mean and deviation, to first order (influence function), scaled such that the
        mean over simulations counts.
        """
        z, white = self.z(values), self.scale.whitening
        downhill = white.T @ (white @ z)
        apart = (self.sample - self.mean) / self.sd
        of_mean = apart @ (downhill / self._inflation)
        free = self.sd > _LEAST_SD
        of_sd = 0.5 * (apart**2 - 1.0) @ np.where(free, downhill * z - 1.0, 0.0)
        return np.asarray(of_mean + of_sd)

    def parted_by_chance(self, other: Ensemble, values: Array) -> float:
        """Return the standard deviation of the difference in log likelihood of two models.

        That by the choice of simulations; both models have the same seeds.
        """
        own = self.pull(values) - other.pull(values)
        return float(own.std(ddof=1) / math.sqrt(len(own)))

    def against_others(self, recordings: Array) -> tuple[Array, Array]:
        """Return recordings as seen by the model without the simulation of the same place.

        In deviations, and what they were divided by but for how well the mean is known; all
        (seeds, statistics), the recordings in compressed deviations.
        """
        n = len(self.sample)
        total, square = self.sample.sum(axis=0), (self.sample**2).sum(axis=0)
        mean = (total - self.sample) / (n - 1)
        variance = (square - self.sample**2 - (n - 1) * mean**2) / (n - 2)
        sd = np.maximum(np.sqrt(np.maximum(variance, 0.0)), _LEAST_SD)
        return (recordings - mean) / (sd * math.sqrt(1.0 + 1.0 / (n - 1))), sd

    def likelihood_of_others(self, recordings: Array) -> Array:
        """Return the log likelihood of each row of :meth:`against_others`, but for a constant."""
        z, sd = self.against_others(recordings)
        white = z @ self.scale.whitening.T
        return np.asarray(-0.5 * np.sum(white * white, axis=1) - np.log(sd).sum(axis=1))

    @cached_property
    def _left_out(self) -> tuple[Array, Array]:
        """Misfit and largest deviation of each simulation against all others."""
        z, _ = self.against_others(self.sample)
        white = z @ self.scale.whitening.T
        return np.mean(white * white, axis=1), np.abs(z).max(axis=1)

    @cached_property
    def floor(self) -> float:
        """Mean misfit of simulations of this very model."""
        return float(self._left_out[0].mean())

    def probability(self, values: Array) -> float:
        """Return the probability of a misfit, or a largest deviation, as large under this model.

        Twice the smaller of the two probabilities, each by rank among the simulations and, beyond
        them, by the tail of a distribution fitted to them: log-normal for misfits, which are means
        of many squares, and Gumbel's for the largest of many.
        """
        misfits, largest = self._left_out
        misfit, loudest = self.misfit(values), float(np.abs(self.z(values)).max())
        found = (_tail(misfits, misfit, _log_normal), _tail(largest, loudest, _gumbel))
        return min(1.0, 2.0 * min(found))

    def rank(self, values: Array, further: Array) -> float:
        """Return the share of further simulations with a misfit, or a largest deviation, as large.

        As :meth:`probability`, by rank alone: statistics that are small counts of rare events have
        no tail that a curve would fit.  `further`, (seeds, statistics), in compressed deviations.
        """
        z = self._deviations(further)
        white = z @ self.scale.whitening.T
        found = (
            (np.mean(white * white, axis=1), self.misfit(values)),
            (np.abs(z).max(axis=1), np.abs(self.z(values)).max()),
        )
        ranks = [(1.0 + np.count_nonzero(some >= one)) / (len(some) + 1.0) for some, one in found]
        return float(min(1.0, 2.0 * min(ranks)))

    @cached_property
    def typical_largest(self) -> float:
        """Mean of the largest deviation of simulations of this very model."""
        return float(self._left_out[1].mean())

    def limits(self, probability: float) -> tuple[float, float]:
        """Return the misfit, and the largest deviation, that have this probability or less."""
        misfits, largest = self._left_out
        share = 0.5 * probability  # the smaller of two decides
        return (_value(misfits, share, _log_normal_value), _value(largest, share, _gumbel_value))


def _value(sample: Array, share: float, beyond: Callable[[Array, float], float]) -> float:
    rank = np.sort(sample)[::-1]
    within = int(share * (len(sample) + 1.0))
    return float(rank[within - 1] if within else max(rank[0], beyond(sample, share)))


def _tail(sample: Array, value: float, beyond: Callable[[Array, float], float]) -> float:
    rank = (1.0 + np.count_nonzero(sample >= value)) / (len(sample) + 1.0)
    return float(rank if value <= sample.max() else min(rank, beyond(sample, value)))


def _log_normal(sample: Array, value: float) -> float:
    # without chance in the model, nothing is left over in its simulations
    log = np.log(np.maximum(sample, 1e-9))
    z = (math.log(value) - log.mean()) / max(float(log.std(ddof=1)), 1e-6)
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def _log_normal_value(sample: Array, share: float) -> float:
    log = np.log(np.maximum(sample, 1e-9))
    z = NormalDist().inv_cdf(1.0 - share)
    return math.exp(log.mean() + z * max(float(log.std(ddof=1)), 1e-6))


def _gumbel_value(sample: Array, share: float) -> float:
    width = max(float(sample.std(ddof=1)), 1e-6) * math.sqrt(6.0) / math.pi
    return float(sample.mean()) + width * (-math.log(-math.log1p(-share)) - np.euler_gamma)


def _gumbel(sample: Array, value: float) -> float:
    width = max(float(sample.std(ddof=1)), 1e-6) * math.sqrt(6.0) / math.pi
    z = (value - float(sample.mean())) / width + np.euler_gamma
    return -math.expm1(-math.exp(-z))
