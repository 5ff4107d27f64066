r"""Fitting a candidate's keys by simulation: damped Gauss-Newton steps on the summary statistics.

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

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Axes, Fitted, Slope, gentler
from adv2e.diagnosis.statistics.metric import Scale
from adv2e.diagnosis.statistics.summary import Sampler
from adv2e.effects.pixel.thresholds import FLOOR

Array = NDArray[np.float64]

_NARROW = 0.1
"""Least reach of a derivative, on the scales of the parameters."""

_NEAR = 2.0
"""Deviations; what is known from before a longer step is not taken into the mean."""
_IN_THE_MEAN = 3
"""Last steps that are."""
_LEAP = 80.0
"""Of the sum of squares by so few simulations: by more, a step has made it worse."""

_LARGEST_MOVE = 1.2
_SHARES = (1.0, 0.4)


class Fitter:
    """Fits candidates to a recording's statistics, (statistics,), in one view of the data.

    `sd`: deviations to weigh by, (statistics,), in those of the scale; default: the scale's own.
    """

    def __init__(
        self, sampler: Sampler, scale: Scale, observed: Array, view: int, sd: Array | None = None
    ) -> None:
        self._sampler, self.scale, self._view = sampler, scale, view
        self._whitening = scale.whitening if sd is None else scale.whitening / sd
        self._observed = self._whitening @ scale.of_values(observed)

    def _white_of_seeds(
        self, configs: Sequence[Config], seeds: Sequence[int], names: Sequence[str] = ()
    ) -> Array:
        """Return the statistics of models, uncorrelated, (configs, seeds, statistics).

        `names` of their effects are told meanwhile.
        """
        self._sampler.trying = dict(zip(configs, names, strict=False))
        sample = self._sampler.samples(configs, seeds)[:, :, self._view]
        return np.asarray(self.scale.of_values(sample) @ self._whitening.T)

    def whites(
        self, configs: Sequence[Config], seeds: Sequence[int], names: Sequence[str] = ()
    ) -> Array:
        """Return the mean statistics of models, uncorrelated, (configs, statistics)."""
        return np.asarray(self._white_of_seeds(configs, seeds, names).mean(axis=1))

    def at_best_starts(
        self, candidates: Sequence[Candidate], base: Config, seeds: Sequence[int]
    ) -> list[Fitted]:
        """Return the fit of each candidate at its best start, which the first seed tells."""
        fits = [
            Fitted.at(start, candidate, base)
            for candidate in candidates
            for start in candidate.starts
        ]
        self._judge(fits, seeds[:1])
        best = [
            min((fit for fit in fits if fit.candidate is one), key=lambda fit: fit.misfit)
            for one in candidates
        ]
        self._judge(best, seeds)
        return best

    def _judge(self, fits: Sequence[Fitted], seeds: Sequence[int]) -> None:
        """Set the misfit of fits where they are."""
        names = [fit.candidate.name for fit in fits]
        means = self.whites([fit.config for fit in fits], seeds, names)
        for fit, mean in zip(fits, means, strict=True):
            fit.misfit = self._misfit(fit, fit.point, mean)

    def misfit(self, config: Config, seeds: Sequence[int]) -> float:
        return self._square(self.whites([config], seeds)[0])

    def _square(self, mean: Array) -> float:
        """Return the sum of squares of what mean statistics leave."""
        return float(np.sum((self._observed - mean) ** 2))

    def _misfit(self, fit: Fitted, point: Array, mean: Array) -> float:
        """Return the sum of squares of a fit elsewhere, from its mean statistics there."""
        return self._square(mean) + float(np.sum(fit.certainty * fit.amiss(point) ** 2))

    def improve(self, fits: Sequence[Fitted], seeds: Sequence[int]) -> None:
        """Move every fit by one step, all of them with one batch of simulations for each part.

        A shorter step is tried where the whole one makes it no better.  Two `seeds` at least.
        """
        fits = [fit for fit in fits if fit.candidate.parameters]
        if not fits:
            return
        nudged = [_nudged(fit) for fit in fits]
        configs = [
            fit.at_point(point)
            for fit, points in zip(fits, nudged, strict=True)
            for point in (fit.point, *points)
        ]
        names = [fit.candidate.name for fit in fits for _ in range(1 + len(fit.point))]
        whites = iter(self._white_of_seeds(configs, seeds, names))
        moves: list[Array] = []
        for fit, points in zip(fits, nudged, strict=True):
            here = next(whites)
            columns = [
                (next(whites) - here) / (point[k] - fit.point[k]) for k, point in enumerate(points)
            ]
            slope = fit.slope(np.array(columns), self._observed - here)
            fit.misfit = self._misfit(fit, fit.point, here.mean(axis=0))
            move = _damped(fit, slope)
            fit.normal, fit.derivative, fit.simulations = slope.normal, slope.derivative, len(seeds)
            fit.covariance = np.linalg.pinv(slope.normal) * _of_mean(len(seeds))
            moves.append(move)
            fit.reach = max(0.5 * fit.reach, _NARROW)
        failed = list(range(len(fits)))
        for share in _SHARES:
            points = [fits[k].inside(fits[k].point + share * moves[k]) for k in failed]
            tried = [fits[k].at_point(point) for k, point in zip(failed, points, strict=True)]
            names = [fits[k].candidate.name for k in failed]
            means = self.whites(tried, seeds, names) if tried else ()
            for k, point, mean in zip(tuple(failed), points, means, strict=True):
                fit, misfit = fits[k], self._misfit(fits[k], point, mean)
                if misfit < fit.misfit:
                    fit.moved = float(np.max(np.abs(point - fit.point) / fit.deviation))
                    fit.misfit, fit.point = misfit, point
                    fit.damping = max(0.25 * fit.damping, 1e-3)
                    failed.remove(k)
        for k in failed:
            fits[k].moved, fits[k].damping = 0.0, 4.0 * fits[k].damping

    def refine(self, fit: Fitted, rounds: Sequence[Sequence[int]]) -> None:
        """Bring a fit that is near its end, and was moved at least once, there.

        `rounds`: seeds of each step, two at least; not all are taken where it is near at once.
        """
        slopes: list[Slope] = []
        gentler: list[Slope] = []
        axes, trust = Axes.of(fit.normal), 1.0
        safe, least = fit.point, np.inf
        for seeds in rounds:
            slope, gentle = self._slopes(fit, axes, seeds)
            if slope.left > least + _LEAP:
                fit.point, trust = safe, 0.3 * trust
                slopes.clear()
                continue
            safe, least = fit.point, min(least, slope.left)
            slopes.append(slope)
            gentler = [*gentler, gentle][-len(slopes) :]
            normal = np.asarray(np.mean([slope.normal for slope in slopes], axis=0))
            move = np.linalg.pinv(normal) @ slope.downhill / len(slopes)
            far = float(np.max(np.abs(axes.along(move)) / axes.reach))
            axes = Axes.of(normal)
            fit.point = fit.inside(fit.point + move * min(1.0, trust / max(far, 1e-12)))
            fit.moved = float(np.max(np.abs(axes.along(fit.point - safe)) / axes.deviation))
            fit.simulations = len(seeds) * len(slopes)
            if far > trust or fit.moved > _NEAR:
                slopes.clear()
            elif len(slopes) == _IN_THE_MEAN:
                break
        if not slopes:
            fit.point = safe  # as far as it is known to be better
        fit.normal = np.asarray(np.mean([slope.normal for slope in gentler], axis=0))
        fit.derivative = np.asarray(np.mean([slope.derivative for slope in gentler], axis=0))
        fit.covariance = np.linalg.pinv(fit.normal)

    def _slopes(self, fit: Fitted, axes: Axes, seeds: Sequence[int]) -> tuple[Slope, Slope]:
        """Return the slope at a fit's point by both sides of it, and by the gentler ones."""
        steps = axes.reach[:, None] * axes.directions
        ends = [[fit.inside(fit.point + side * step) for step in steps] for side in (1, -1)]
        configs = [fit.at_point(point) for point in (fit.point, *ends[0], *ends[1])]
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
        """Set the covariance of a fit from simulations of the fitted model.

        `sample`: (simulations, statistics), in compressed deviations.
        """
        apart = (sample - sample.mean(axis=0)) @ self._whitening.T
        downhill = apart @ fit.derivative.T
        spread = downhill.T @ downhill / (len(sample) - 1) + np.diag(fit.certainty)
        inverse = np.linalg.pinv(fit.normal)
        fit.covariance = inverse @ spread @ inverse * _of_mean(fit.simulations)


def _of_mean(seeds: int) -> float:
    """Return the factor on variances for the variance of a mean over `seeds` simulations."""
    return 1.0 + 1.0 / seeds


def _nudged(fit: Fitted) -> list[Array]:
    """Return the point with each number in turn moved, inwards at the end of its range."""
    points = []
    for k in range(len(fit.point)):
        point = fit.point.copy()
        point[k] += fit.reach
        if fit.inside(point)[k] < point[k] - 1e-12:
            point[k] = fit.point[k] - fit.reach
        points.append(point)
    return points


def _damped(fit: Fitted, slope: Slope) -> Array:
    """Return a step that is shorter where the last ones failed."""
    damped = slope.normal + np.diag(fit.damping * np.diag(slope.normal) + 1e-6)
    move = np.linalg.solve(damped, slope.downhill)
    largest = float(np.abs(move).max())
    return np.asarray(move * min(1.0, _LARGEST_MOVE / max(largest, 1e-12)))


# ---- Keys that nobody declared: fitted before the search, so that effects are not blamed for
# them.
#
# The contrast thresholds come first. Bias settings move them by factors, they are hardly ever
# known, and as long as they are wrong every other statistic is, too. They are set so that the
# simulation has as many ON and as many OFF events as were measured.


TOLERANCE = 0.01
"""Totals match to this, relative: the search ends there."""
_ROUNDS = 15
"""Simulations at most."""
LARGEST = 5.0
"""Largest threshold tried [ln]; grey levels of 8 bits span 5.5."""
_SIGNS = ("on", "off")


def thresholds_of(config: Config) -> dict[str, float]:
    return {f"pixel.thresholds.{sign}": getattr(config.pixel.thresholds, sign) for sign in _SIGNS}


def threshold_nuisance(fitted: Config) -> Candidate:
    """Return the keys that :func:`fit_thresholds` fitted, for a search to refine."""
    levels = thresholds_of(fitted)
    parameters = (FitParameter(key, FLOOR, LARGEST) for key in levels)
    return Candidate("", tuple(parameters), (tuple(levels.values()),))


def fit_thresholds(
    simulate: Callable[[Config], tuple[int, int]],
    declared: Config,
    measured: tuple[int, int],
) -> tuple[Config, float]:
    """Return the declared model with thresholds that match the totals, and what they miss by.

    Parameters
    ----------
    simulate : callable
        Returns the counts of ON and OFF events of a simulation, over the same pixels and times as
        those measured.
    measured : (int, int)
        Counts wanted.

    Returns
    -------
    config : Config
        With the best thresholds met.
    miss : float
        By how much the worse of the two totals misses, relative; above :data:`TOLERANCE` where no
        thresholds match.
    """
    pixel = declared.pixel

    def with_levels(on: float, off: float) -> Config:
        levels = replace(pixel.thresholds, on=on, off=off)
        return replace(declared, pixel=replace(pixel, thresholds=levels))

    levels, miss = match_totals(
        lambda on, off: simulate(with_levels(on, off)),
        (pixel.thresholds.on, pixel.thresholds.off),
        measured,
        within=(FLOOR, LARGEST),
    )
    return with_levels(*levels), miss


def match_totals(
    simulate: Callable[[float, float], tuple[int, int]],
    start: tuple[float, float],
    measured: tuple[int, int],
    *,
    within: tuple[float, float],
) -> tuple[tuple[float, float], float]:
    """Return the pair of thresholds that matches the totals, and what it misses by.

    By the secant method on logarithms.

    Parameters
    ----------
    simulate : callable
        Returns the counts of ON and OFF events for thresholds of ON and OFF, in any unit.
    start : (float, float)
        Thresholds tried first.
    measured : (int, int)
        Counts wanted.
    within : (float, float)
        Smallest and largest threshold tried.
    """
    wanted = np.log(np.maximum(measured, 0.5))
    levels, slope = np.log(start), np.full(2, -1.0)
    best = np.inf, levels
    before: tuple[NDArray[Any], NDArray[Any]] | None = None
    for _ in range(_ROUNDS):
        miss = np.log(np.maximum(simulate(*np.exp(levels).tolist()), 0.5)) - wanted
        if np.abs(miss).max() < best[0]:
            best = float(np.abs(miss).max()), levels
        if best[0] <= np.log1p(TOLERANCE):
            break
        if before is not None:
            moved, gained = levels - before[0], miss - before[1]
            # each total depends on both thresholds: a secant may come out with the wrong sign
            secant = np.divide(gained, moved, out=slope.copy(), where=np.abs(moved) > 1e-6)
            slope = np.clip(secant, -6.0, -0.7)
        before = levels, miss
        step = np.clip(-miss / slope, -1.0, 1.0)
        levels = np.clip(levels + step, *np.log(within))
    on, off = np.exp(best[1]).tolist()
    return (on, off), float(np.expm1(best[0]))
