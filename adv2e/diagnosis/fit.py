"""Fitting a candidate's keys by simulation: damped Gauss-Newton steps on the marker statistics.

All simulations of one step share their seeds, so that most of chance falls out of the differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.candidates import Candidate
from adv2e.diagnosis.metric import Scale
from adv2e.diagnosis.simulations import Laboratory

Array = NDArray[np.float64]

_STEP = 0.12
_LARGEST_MOVE = 1.2


@dataclass
class Fit:
    """The state of one candidate's fit.

    Attributes
    ----------
    candidate : Candidate
    base : Config
        The model that the candidate is added to.
    place : (knobs,)
        Best place found, on the knobs' scales.
    misfit : float
        Sum of squares there.
    covariance : (knobs, knobs)
        Of the place, from the last derivative.
    """

    candidate: Candidate
    base: Config
    place: Array
    misfit: float = np.inf
    covariance: NDArray[Any] = field(default_factory=lambda: np.zeros((0, 0)))
    derivative: Array = field(default_factory=lambda: np.zeros((0, 0)))
    damping: float = 0.05
    moved: float = np.inf

    @property
    def config(self) -> Config:
        """The model with the effect as fitted."""
        return self.candidate.applied(self.base, self.place)

    def moved_to(self, place: Array) -> Config:
        """Return the model with the effect at another place."""
        return self.candidate.applied(self.base, place)

    def inside(self, place: Array) -> Array:
        """Return `place` within the physical ranges."""
        knobs = self.candidate.knobs
        return np.array([k.inner(k.outer(p)) for k, p in zip(knobs, place, strict=True)])

    @property
    def at_border(self) -> bool:
        """Whether a key has run to the end of its physical range."""
        return any(
            knob.at_border(p) for knob, p in zip(self.candidate.knobs, self.place, strict=True)
        )


class Fitter:
    """Fits candidates to a recording's statistics in one view of the data.

    Parameters
    ----------
    laboratory : Laboratory
    scale : Scale
    observed : (statistics,)
        Of the recording.
    view : int
    sd : (statistics,), optional
        Deviations to weigh by, in those of the scale; default: the scale's own.
    """

    def __init__(
        self,
        laboratory: Laboratory,
        scale: Scale,
        observed: Array,
        view: int,
        sd: Array | None = None,
    ) -> None:
        self._laboratory, self._scale, self._view = laboratory, scale, view
        self._whitening = scale.whitening if sd is None else scale.whitening / sd
        self._observed = self._whitening @ scale.of_values(observed)

    def _white(self, sample: Array) -> Array:
        """Return the mean over seeds of (configs, seeds, views, statistics), uncorrelated."""
        compressed = self._scale.of_values(sample[:, :, self._view])
        return np.asarray(compressed.mean(axis=1) @ self._whitening.T)

    def probe(
        self, candidates: Sequence[Candidate], base: Config, seeds: Sequence[int]
    ) -> list[Fit]:
        """Return each candidate at the best of its probes."""
        places = [
            (candidate, np.array(candidate.inner(probe)))
            for candidate in candidates
            for probe in candidate.probes
        ]
        configs = [candidate.applied(base, place) for candidate, place in places]
        means = self._white(self._laboratory.many(configs, seeds))
        best: dict[int, Fit] = {}
        for (candidate, place), mean in zip(places, means, strict=True):
            misfit = float(np.sum((self._observed - mean) ** 2))
            held = best.get(id(candidate))
            if held is None or misfit < held.misfit:
                best[id(candidate)] = Fit(candidate, base, place, misfit)
        return [best[id(candidate)] for candidate in candidates]

    def whites(self, configs: Sequence[Config], seeds: Sequence[int]) -> Array:
        """Return the mean statistics of models, uncorrelated, (configs, statistics)."""
        return self._white(self._laboratory.many(configs, seeds))

    def misfit(self, config: Config, seeds: Sequence[int]) -> float:
        """Return the sum of squares of a model as it is."""
        mean = self._white(self._laboratory.many([config], seeds))[0]
        return float(np.sum((self._observed - mean) ** 2))

    def improve(self, fits: Sequence[Fit], seeds: Sequence[int], step: float = _STEP) -> None:
        """Move every fit by one step, all of them with one batch of simulations for each half."""
        fits = [fit for fit in fits if fit.candidate.knobs]
        if not fits:
            return
        configs: list[Config] = []
        for fit in fits:
            nudged = (_nudged(fit, k, step) for k in range(len(fit.place)))
            configs += [fit.config, *map(fit.moved_to, nudged)]
        means = iter(self._white(self._laboratory.many(configs, seeds)))
        moves = []
        for fit in fits:
            here = next(means)
            residual = self._observed - here
            fit.misfit = float(residual @ residual)
            columns = []
            for k in range(len(fit.place)):
                width = _nudged(fit, k, step)[k] - fit.place[k]
                columns.append((next(means) - here) / width)
            fit.derivative = np.array(columns).T
            moves.append(_move(fit, residual, len(seeds)))
        shares = (1.0, 0.4)
        owners = [fit for fit in fits for _ in shares]
        trials = [
            fit.inside(fit.place + share * move)
            for fit, move in zip(fits, moves, strict=True)
            for share in shares
        ]
        configs = [fit.moved_to(place) for fit, place in zip(owners, trials, strict=True)]
        for fit in fits:
            fit.moved = 0.0
            fit.damping *= 4.0
        means = iter(self._white(self._laboratory.many(configs, seeds)))
        for fit, place, mean in zip(owners, trials, means, strict=True):
            misfit = float(np.sum((self._observed - mean) ** 2))
            if misfit < fit.misfit:
                fit.moved = float(np.abs(place - fit.place).max())
                fit.misfit, fit.place = misfit, place
                fit.damping = max(fit.damping / 16.0, 1e-3)


def _nudged(fit: Fit, k: int, step: float) -> Array:
    """Return the place with knob `k` moved a little, inwards at the end of its range."""
    place = fit.place.copy()
    place[k] += step
    if fit.inside(place)[k] < place[k] - 1e-12:
        place[k] = fit.place[k] - step
    return place


def _move(fit: Fit, residual: Array, seeds: int) -> Array:
    """Return the damped step, and note the covariance of the place."""
    j = fit.derivative
    normal = j.T @ j
    damped = normal + np.diag(fit.damping * np.diag(normal) + 1e-6)
    # the mean of the simulations varies, too
    fit.covariance = np.linalg.pinv(normal) * (1.0 + 1.0 / seeds)
    move = np.linalg.solve(damped, j.T @ residual)
    largest = float(np.abs(move).max())
    return np.asarray(move * min(1.0, _LARGEST_MOVE / max(largest, 1e-12)))
