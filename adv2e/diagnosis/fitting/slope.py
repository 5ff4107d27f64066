"""Slope of the misfit (normal equations) at a point, and axes of its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
        """Return the axes of a normal matrix."""
        squares, columns = np.linalg.eigh(normal)
        deviation = 1.0 / np.sqrt(np.maximum(squares, 1e-12))
        return cls(columns.T, deviation, np.clip(_REACH * deviation, *_REACHES))

    def along(self, move: Array) -> Array:
        """Return the parts of a move along each direction."""
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
