"""The state of a fit: where it is, how well that is known, and with which keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.slope import Slope

Array = NDArray[np.float64]

WIDE = 0.8
"""Reach of the first derivative, on the scales of the parameters."""


@dataclass
class Fitted:
    """The state of one candidate's fit.

    Attributes
    ----------
    candidate : Candidate
    base : Config
        The model that the candidate is added to.
    point : (parameters,)
        Best point found, on the scales of the parameters.
    misfit : float
        Sum of squares there, as of the last step that was checked by it.
    derivative : (parameters, statistics)
        The last one, of uncorrelated statistics.
    normal : (parameters, parameters)
        Of the last step, with what is known of the point besides.
    covariance : (parameters, parameters)
        Of the point; from the last step, as if statistics were as uncorrelated as they are taken
        to be, until :meth:`Fitter.set_covariance` is called.
    reach : float
        Over which the next derivative is taken.
    damping : float
    moved : float
        By the last step, at most, in deviations of the point.
    simulations : int
        That the point is told by.
    """

    candidate: Candidate
    base: Config
    point: Array
    misfit: float = np.inf
    derivative: NDArray[Any] = field(default_factory=lambda: np.zeros((0, 0)))
    normal: NDArray[Any] = field(default_factory=lambda: np.zeros((0, 0)))
    covariance: NDArray[Any] = field(default_factory=lambda: np.zeros((0, 0)))
    reach: float = WIDE
    damping: float = 0.05
    moved: float = np.inf
    simulations: int = 1

    @classmethod
    def at(cls, values: Sequence[float], candidate: Candidate, base: Config) -> Fitted:
        """Return a fit that starts at values of the keys, or the nearest that are physical."""
        fit = cls(candidate, base, np.array(candidate.scaled(values)))
        fit.point = fit.inside(fit.point)
        return fit

    @property
    def config(self) -> Config:
        """The model with the effect as fitted."""
        return self.at_point(self.point)

    def at_point(self, point: Array) -> Config:
        """Return the model with the effect at another point."""
        return self.candidate.applied(self.base, point)

    @property
    def settings(self) -> dict[str, Any]:
        """The keys that the effect sets, and their values in that model."""
        return self.candidate.settings_in(self.config, self.point)

    def inside(self, point: Array) -> Array:
        """Return `point` within the physical ranges."""
        parameters = self.candidate.parameters
        return np.array(
            [one.scaled(one.value_at(at)) for one, at in zip(parameters, point, strict=True)]
        )

    @property
    def certainty(self) -> Array:
        """Precision of the prior of each parameter, (parameters,)."""
        return np.array([sd**-2.0 for _, sd in self.candidate.known_or_not])

    def amiss(self, point: Array) -> Array:
        """Return the difference of a point from the means of the priors, (parameters,)."""
        return point - [known for known, _ in self.candidate.known_or_not]

    def slope(self, derivative: NDArray[Any], residual: Array) -> Slope:
        """Return the slope of the misfit at the point, with the priors; see :class:`Slope`."""
        return Slope.of(derivative, residual).with_known(self.certainty, self.amiss(self.point))

    @property
    def deviation(self) -> Array:
        """Standard deviation of each number of the point, above zero."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 1e-12)))

    @property
    def at_border(self) -> bool:
        """True if a fitted parameter is at the end of its physical range."""
        pairs = zip(self.candidate.parameters, self.point, strict=True)
        return any(one.at_border(at) for one, at in pairs)


def parted(joint: Fitted, fits: tuple[Fitted, ...]) -> tuple[Fitted, ...]:
    """Return the effects of a joined fit, each with its own point and covariance."""
    result, start = [], 0
    for fit in fits:
        stop = start + len(fit.candidate.parameters)
        own = slice(start, stop)
        point, covariance = joint.point[own], joint.covariance[own, own]
        result.append(Fitted(fit.candidate, fit.base, point, joint.misfit, covariance=covariance))
        start = stop
    return tuple(result)
