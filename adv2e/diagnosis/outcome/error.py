"""Distance between recording and simulations on the data that are looked at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.distances import SIGMAS_US, smoothed_norms
from adv2e.diagnosis.data.stream import Stream
from adv2e.reports.result import ErrorRow, Estimate

NAME = "distance of measured and simulated events (ON +1, OFF -1), smoothed in time"
OF_MEAN = "the same from the mean of simulations, without the chance of each"
PAIRS = 20
"""Pairs of independent draws that the floor is the mean of."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """Of the simulations of one model, as parts of the norm of what was measured.

    To that, (simulations, scales), and between independent ones, (pairs, scales).
    """

    to_measured: Array
    between: Array

    @classmethod
    def of(cls, measured: Stream, simulations: Sequence[Stream]) -> Errors:
        """Return the errors of simulations; NaN if nothing was measured."""
        unit = _norm(measured)
        return cls(
            np.array([_apart(measured, stream, unit) for stream in simulations]),
            np.array([_apart(a, b, unit) for a, b in _pairs(simulations)]),
        )

    @property
    def own(self) -> Array:
        """Square of what is each simulation's own chance, (scales,)."""
        return 0.5 * _mean_square(self.between)


def error_rows(before: Errors, after: Errors) -> list[ErrorRow]:
    """Return the error over all scales, at each scale, and of the mean of simulations.

    Random events cost, wherever they come: a model that makes them as the camera does is farther
    off by the first of these than one without.  The last is not moved by that: the distance d from
    one simulation and c from one to another are those from their mean by d^2 = m^2 + c^2/2.  The
    floor is that of the model found, `after`.
    """
    names = [NAME, *(f"{NAME} over {sigma / 1e3:g} ms" for sigma in SIGMAS_US)]
    first, second, floor = (
        [_estimate(column) for column in (apart.mean(axis=1), *apart.T)]
        for apart in (before.to_measured, after.to_measured, after.between)
    )
    rows = [ErrorRow(*row) for row in zip(names, first, second, floor, strict=True)]
    squares = (*(_mean_square(one.to_measured) - one.own for one in (before, after)), after.own)
    roots = [Estimate(float(np.sqrt(np.maximum(one, 0.0)).mean())) for one in squares]
    rows.append(ErrorRow(OF_MEAN, roots[0], roots[1], roots[2], without_chance=True))
    return rows


def of_interpolation(
    measured: Stream, full: Sequence[Stream], half: Sequence[Stream], floor: float
) -> float:
    """Return the part of the error that interpolation between frames makes; it adds in squares.

    About half of the error that leaving out every second frame adds, within a factor of two:
    between a third, where frames resolve the motion, and all of it
    (:mod:`adv2e.diagnosis.statistics.uncertainty`).  `full`: simulations with all frames, whose
    error has the noise floor `floor`; `half`: with every second frame, of other seeds.
    """
    unit = _norm(measured)
    apart = np.mean([_apart(a, b, unit).mean() for a, b in zip(full, half, strict=True)])
    square = float(apart) ** 2 - floor**2
    return 0.5 * math.sqrt(square) if square > 0.0 else 0.0  # not a number: nothing measured


def _norm(measured: Stream) -> Array:
    return smoothed_norms([(measured.events(), 1.0)], measured.width, SIGMAS_US)


def _apart(a: Stream, b: Stream, unit: Array) -> Array:
    apart = smoothed_norms([(a.events(), 1.0), (b.events(), -1.0)], a.width, SIGMAS_US)
    return np.asarray(apart / np.where(unit > 0.0, unit, np.nan))


def _pairs(streams: Sequence[Stream]) -> list[tuple[Stream, Stream]]:
    """Return pairs that use every stream about as often."""
    n = len(streams)
    pairs = [(k, (k + gap) % n) for gap in range(1, n) for k in range(n) if k < (k + gap) % n]
    return [(streams[a], streams[b]) for a, b in pairs[: max(PAIRS, n)]]


def _mean_square(apart: Array) -> Array:
    """Return the mean square of distances (n, scales), nothing for none."""
    if not apart.size:
        return np.zeros(len(SIGMAS_US))
    return np.asarray((apart * apart).mean(axis=0))


def _estimate(values: Array) -> Estimate:
    """Return the mean, and the range of the middle 95 % of the draws."""
    low, high = np.quantile(values, [0.025, 0.975])
    return Estimate(float(values.mean()), (float(low), float(high)))
