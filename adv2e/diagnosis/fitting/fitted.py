"""State of a fit: its place, how well that is known, its keys, and the slope of the misfit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate

Array = NDArray[np.float64]

WIDE = 0.8
"""Reach of the first derivative, on the scales of the parameters."""


@dataclass
class Fitted:
    """The state of one candidate's fit.

    Attributes
    ----------
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
        return self.at_point(self.point)

    def at_point(self, point: Array) -> Config:
        return self.candidate.applied(self.base, point)

    @property
    def settings(self) -> dict[str, Any]:
        """The keys that the effect sets, and their values in that model."""
        return self.candidate.settings_in(self.config, self.point)

    def inside(self, point: Array) -> Array:
        return self.candidate.inside(point)

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


# ---- Slope of the misfit (normal equations) at a point, and axes of its uncertainty.


_REACH = 10.0
"""Reach of the last derivatives, in deviations of the point: less, and chance is most of them."""
_REACHES = (0.02, 0.3)
"""Least and most, on the scales of the parameters."""
_CLIFF = 10.0
"""Square of the changes on one side over that on the other, from which one is no slope."""
_LEAST_SHARE = 0.1
"""Of the biased normal matrix, of an unbiased one that is used, in every direction."""


@dataclass(frozen=True)
class Axes:
    """Directions in which a point is known, each independently of the others.

    Keys that go together, such as two times of which the sum shows, are known far better in some
    directions (rows) than each by itself.  Along each, deviation of the point and reach of the last
    derivatives.
    """

    directions: NDArray[Any]
    deviation: Array
    reach: Array

    @classmethod
    def of(cls, normal: NDArray[Any]) -> Axes:
        squares, columns = np.linalg.eigh(normal)
        deviation = 1.0 / np.sqrt(np.maximum(squares, 1e-12))
        return cls(columns.T, deviation, np.clip(_REACH * deviation, *_REACHES))

    def along(self, move: Array) -> Array:
        return np.asarray(self.directions @ move)


@dataclass(frozen=True)
class Slope:
    """Slope of the misfit at a point: terms of the normal equations.

    Attributes
    ----------
    derivative : (parameters, statistics)
    normal : (parameters, parameters)
        Products of derivatives.
    downhill : (parameters,)
        Products of derivatives and what is left.
    left : float
        Square of what is left.
    """

    derivative: NDArray[Any]
    normal: NDArray[Any]
    downhill: Array
    left: float

    @classmethod
    def of(cls, derivative: NDArray[Any], residual: Array) -> Slope:
        """Return the slope by the products of different seeds.

        `derivative`: (parameters, seeds, statistics), `residual`: (seeds, statistics).
        """
        seeds = len(residual)
        total, left = derivative.sum(axis=1), residual.sum(axis=0)
        biased = total @ total.T / seeds**2
        own = np.einsum("ask,bsk->ab", derivative, derivative)
        pairs = seeds * (seeds - 1)
        normal = (total @ total.T - own) / pairs
        downhill = (total @ left - np.einsum("ask,sk->a", derivative, residual)) / pairs
        # with few seeds the unbiased matrix may be no matrix of squares at all
        if np.linalg.eigvalsh(normal - _LEAST_SHARE * biased).min() < 0.0:
            normal, downhill = biased, total @ left / seeds**2
        square = float(left @ left - np.sum(residual * residual)) / pairs
        return cls(total / seeds, normal, downhill, square)

    def with_known(self, certainty: Array, amiss: Array) -> Slope:
        """Return the slope with priors, which count as further measurements.

        `certainty`: their precision; `amiss`: difference of the point from them, (parameters,).
        """
        return Slope(
            self.derivative,
            self.normal + np.diag(certainty),
            self.downhill - certainty * amiss,
            self.left + float(np.sum(certainty * amiss**2)),
        )


def gentler(above: Array, below: Array) -> Array:
    """Return the change from one end to the other, by one side where the other is a cliff.

    A point is as uncertain as it is towards the side where little changes.  From the changes from
    the point to one end, and from the other to the point, (seeds, statistics).
    """
    squares = [float(np.sum(side.mean(axis=0) ** 2)) for side in (above, below)]
    if max(squares) < _CLIFF * min(squares):
        return above + below
    return 2.0 * (above if squares[0] < squares[1] else below)
