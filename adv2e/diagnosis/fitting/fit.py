r"""Fitting a candidate's keys by simulation: damped Gauss-Newton steps on the marker statistics.

All simulations of one step share their seeds, so that most of chance falls out of the differences.
What is left of it in a derivative :math:`J` does not cancel in :math:`J^T J`, where hundreds of
statistics add up their squares: a fit by that would hardly move, and be called precise.  So
products are formed between different seeds only, which is unbiased, and derivatives are taken over
wide differences that become narrower from step to step, down to what the data can tell apart.

Near the end, no misfit tells where it is: the events of few simulations leap as keys move, and the
least of what they make is a matter of chance.  So the last steps are whole ones, not checked, each
by other simulations, and their mean is taken (stochastic approximation [2]_).

How precise a fit is, is told by simulations of the fitted model: what each would have moved the fit
by.  That needs no assumption on how statistics go together (sandwich estimator [1]_).

References
----------
.. [1] P. J. Huber, "The behavior of maximum likelihood estimates under nonstandard conditions",
   Proc. 5th Berkeley Symposium, 1967.
.. [2] B. T. Polyak, A. B. Juditsky, "Acceleration of stochastic approximation by averaging", SIAM
   J. Control Optim. 30, 1992, doi:10.1137/0330046.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.simulations import Laboratory
from adv2e.diagnosis.fitting.slope import Axes, Slope, gentler
from adv2e.diagnosis.statistics.metric import Scale

Array = NDArray[np.float64]

WIDE, _NARROW = 0.8, 0.1
"""Reach of the first derivative, and least of any, on the knobs' scales."""

_NEAR = 2.0
"""Deviations; what is known from before a longer step is not taken into the mean."""
_IN_THE_MEAN = 3
"""Last steps that are."""
_LEAP = 80.0
"""Of the sum of squares by so few simulations: by more, a step has made it worse."""

_LARGEST_MOVE = 1.2
_SHARES = (1.0, 0.4)


@dataclass
class Fitted:
    """The state of one candidate's fit.

    Attributes
    ----------
    candidate : Candidate
    base : Config
        The model that the candidate is added to.
    place : (knobs,)
        Best place found, on the knobs' scales.
    misfit : float
        Sum of squares there, as of the last step that was checked by it.
    derivative : (knobs, statistics)
        The last one, of uncorrelated statistics.
    normal : (knobs, knobs)
        Of the last step, with what is known of the place besides.
    covariance : (knobs, knobs)
        Of the place; from the last step, as if statistics were as uncorrelated as they are taken
        to be, until :meth:`Fitter.set_covariance` is called.
    reach : float
        Over which the next derivative is taken.
    damping : float
    moved : float
        By the last step, at most, in deviations of the place.
    simulations : int
        That the place is told by.
    """

    candidate: Candidate
    base: Config
    place: Array
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
        """Return a fit that starts at values of the knobs, or the nearest that are physical."""
        fit = cls(candidate, base, np.array(candidate.inner(values)))
        fit.place = fit.inside(fit.place)
        return fit

    @property
    def config(self) -> Config:
        """The model with the effect as fitted."""
        return self.candidate.applied(self.base, self.place)

    @property
    def parameters(self) -> dict[str, Any]:
        """The keys that the effect sets, and their values in that model."""
        return self.candidate.told(self.config, self.place)

    def moved_to(self, place: Array) -> Config:
        """Return the model with the effect at another place."""
        return self.candidate.applied(self.base, place)

    def inside(self, place: Array) -> Array:
        """Return `place` within the physical ranges."""
        knobs = self.candidate.knobs
        return np.array([k.inner(k.outer(p)) for k, p in zip(knobs, place, strict=True)])

    @property
    def certainty(self) -> Array:
        """Precision of what is known of each number of the place besides, (knobs,)."""
        return np.array([sd**-2.0 for _, sd in self.candidate.known_or_not])

    def amiss(self, place: Array) -> Array:
        """Return how far a place is from what is known of it besides, (knobs,)."""
        return place - [known for known, _ in self.candidate.known_or_not]

    def slope(self, derivative: NDArray[Any], residual: Array) -> Slope:
        """Return the slope at the place, with what is known of it besides; see :class:`Slope`."""
        return Slope.of(derivative, residual).with_known(self.certainty, self.amiss(self.place))

    @property
    def deviation(self) -> Array:
        """Standard deviation of each number of the place, above zero."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 1e-12)))

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
        self._laboratory, self.scale, self._view = laboratory, scale, view
        self._whitening = scale.whitening if sd is None else scale.whitening / sd
        self._observed = self._whitening @ scale.of_values(observed)

    def _white_of_seeds(self, configs: Sequence[Config], seeds: Sequence[int]) -> Array:
        """Return the statistics of models, uncorrelated, (configs, seeds, statistics)."""
        sample = self._laboratory.many(configs, seeds)[:, :, self._view]
        return np.asarray(self.scale.of_values(sample) @ self._whitening.T)

    def whites(self, configs: Sequence[Config], seeds: Sequence[int]) -> Array:
        """Return the mean statistics of models, uncorrelated, (configs, statistics)."""
        return np.asarray(self._white_of_seeds(configs, seeds).mean(axis=1))

    def probe(
        self, candidates: Sequence[Candidate], base: Config, seeds: Sequence[int]
    ) -> list[Fitted]:
        """Return each candidate at the best of its probes."""
        fits = [
            Fitted.at(probe, candidate, base)
            for candidate in candidates
            for probe in candidate.probes
        ]
        means = self.whites([fit.config for fit in fits], seeds)
        best: dict[int, Fitted] = {}
        for fit, mean in zip(fits, means, strict=True):
            fit.misfit = self._misfit(fit, fit.place, mean)
            held = best.get(id(fit.candidate))
            if held is None or fit.misfit < held.misfit:
                best[id(fit.candidate)] = fit
        return [best[id(candidate)] for candidate in candidates]

    def misfit(self, config: Config, seeds: Sequence[int]) -> float:
        """Return the sum of squares of a model as it is."""
        return self._square(self.whites([config], seeds)[0])

    def _square(self, mean: Array) -> float:
        """Return the sum of squares of what mean statistics leave."""
        return float(np.sum((self._observed - mean) ** 2))

    def _misfit(self, fit: Fitted, place: Array, mean: Array) -> float:
        """Return the sum of squares of a fit elsewhere, from its mean statistics there."""
        return self._square(mean) + float(np.sum(fit.certainty * fit.amiss(place) ** 2))

    def improve(self, fits: Sequence[Fitted], seeds: Sequence[int]) -> None:
        """Move every fit by one step, all of them with one batch of simulations for each half.

        Parameters
        ----------
        fits : sequence of Fitted
        seeds : sequence of int
            Two at least.
        """
        fits = [fit for fit in fits if fit.candidate.knobs]
        if not fits:
            return
        configs: list[Config] = []
        for fit in fits:
            configs += [fit.config, *(fit.moved_to(place) for place in _nudged(fit))]
        whites = iter(self._white_of_seeds(configs, seeds))
        trials: list[list[Array]] = []
        for fit in fits:
            here = next(whites)
            columns = []
            for k, place in enumerate(_nudged(fit)):
                columns.append((next(whites) - here) / (place[k] - fit.place[k]))
            slope = fit.slope(np.array(columns), self._observed - here)
            fit.misfit = self._misfit(fit, fit.place, here.mean(axis=0))
            move = _damped(fit, slope)
            fit.normal, fit.derivative, fit.simulations = slope.normal, slope.derivative, len(seeds)
            fit.covariance = np.linalg.pinv(slope.normal) * _of_mean(len(seeds))
            trials.append([fit.inside(fit.place + share * move) for share in _SHARES])
        tried = [
            fit.moved_to(place)
            for fit, places in zip(fits, trials, strict=True)
            for place in places
        ]
        means = iter(self.whites(tried, seeds))
        for fit, places in zip(fits, trials, strict=True):
            misfits = [self._misfit(fit, place, next(means)) for place in places]
            nearest = int(np.argmin(misfits))
            fit.reach = max(0.5 * fit.reach, _NARROW)
            if misfits[nearest] >= fit.misfit:
                fit.moved, fit.damping = 0.0, 4.0 * fit.damping
                continue
            fit.moved = float(np.max(np.abs(places[nearest] - fit.place) / fit.deviation))
            fit.misfit, fit.place = misfits[nearest], places[nearest]
            fit.damping = max(0.25 * fit.damping, 1e-3)

    def refine(self, fit: Fitted, rounds: Sequence[Sequence[int]]) -> None:
        """Bring a fit that is near its end there.

        Parameters
        ----------
        fit : Fitted
            Moved at least once.
        rounds : sequence of sequence of int
            Seeds of each step, two at least; not all are taken where it is near at once.
        """
        slopes: list[Slope] = []
        gentler: list[Slope] = []
        axes, trust = Axes.of(fit.normal), 1.0
        safe, least = fit.place, np.inf
        for seeds in rounds:
            slope, gentle = self._slopes(fit, axes, seeds)
            if slope.left > least + _LEAP:
                fit.place, trust = safe, 0.3 * trust
                slopes.clear()
                continue
            safe, least = fit.place, min(least, slope.left)
            slopes.append(slope)
            gentler = [*gentler, gentle][-len(slopes) :]
            normal = np.asarray(np.mean([slope.normal for slope in slopes], axis=0))
            move = np.linalg.pinv(normal) @ slope.downhill / len(slopes)
            far = float(np.max(np.abs(axes.along(move)) / axes.reach))
            axes = Axes.of(normal)
            fit.place = fit.inside(fit.place + move * min(1.0, trust / max(far, 1e-12)))
            fit.moved = float(np.max(np.abs(axes.along(fit.place - safe)) / axes.deviation))
            fit.simulations = len(seeds) * len(slopes)
            if far > trust or fit.moved > _NEAR:
                slopes.clear()
            elif len(slopes) == _IN_THE_MEAN:
                break
        if not slopes:
            fit.place = safe  # as far as it is known to be better
        fit.normal = np.asarray(np.mean([slope.normal for slope in gentler], axis=0))
        fit.derivative = np.asarray(np.mean([slope.derivative for slope in gentler], axis=0))
        fit.covariance = np.linalg.pinv(fit.normal)

    def _slopes(self, fit: Fitted, axes: Axes, seeds: Sequence[int]) -> tuple[Slope, Slope]:
        """Return the slope at a fit's place by both sides of it, and by the gentler ones."""
        steps = axes.reach[:, None] * axes.directions
        ends = [[fit.inside(fit.place + side * step) for step in steps] for side in (1, -1)]
        configs = [fit.moved_to(place) for place in (fit.place, *ends[0], *ends[1])]
        here, *others = self._white_of_seeds(configs, seeds)
        sides = list(zip(others[: len(steps)], others[len(steps) :], strict=True))
        # one end may lie at the border of what is physical, beside the axis
        inverse = np.linalg.pinv(np.array(ends[0]) - np.array(ends[1]))

        def of(differences: list[Array]) -> Slope:
            derivative = np.tensordot(inverse, np.array(differences), axes=1)
            return fit.slope(derivative, self._observed - here)

        return (
            of([above - below for above, below in sides]),
            of([gentler(above - here, here - below) for above, below in sides]),
        )

    def set_covariance(self, fit: Fitted, sample: Array) -> None:
        """Note the covariance of a fit's place, as simulations of the fitted model tell it.

        Parameters
        ----------
        fit : Fitted
            Moved at least once.
        sample : (simulations, statistics)
            Of the fitted model, in compressed deviations.
        """
        apart = (sample - sample.mean(axis=0)) @ self._whitening.T
        downhill = apart @ fit.derivative.T
        spread = downhill.T @ downhill / (len(sample) - 1) + np.diag(fit.certainty)
        inverse = np.linalg.pinv(fit.normal)
        fit.covariance = inverse @ spread @ inverse * _of_mean(fit.simulations)


def _of_mean(seeds: int) -> float:
    """Return by how much variances grow as the mean of so many simulations varies, too."""
    return 1.0 + 1.0 / seeds


def _nudged(fit: Fitted) -> list[Array]:
    """Return the place with each knob in turn moved, inwards at the end of its range."""
    places = []
    for k in range(len(fit.place)):
        place = fit.place.copy()
        place[k] += fit.reach
        if fit.inside(place)[k] < place[k] - 1e-12:
            place[k] = fit.place[k] - fit.reach
        places.append(place)
    return places


def _damped(fit: Fitted, slope: Slope) -> Array:
    """Return a step that is shorter where the last ones failed."""
    damped = slope.normal + np.diag(fit.damping * np.diag(slope.normal) + 1e-6)
    move = np.linalg.solve(damped, slope.downhill)
    largest = float(np.abs(move).max())
    return np.asarray(move * min(1.0, _LARGEST_MOVE / max(largest, 1e-12)))
