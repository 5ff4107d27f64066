"""Which effects a table asks for: models of increasing size, judged on light held out.

The declared model is rejected where its misfit is larger than 95 in 100 of those of tables drawn
from it.  Only then are effects added: of all sets of one effect, then two, then three, the one
with the least held-out error, if that is lower than before by more than the best of as many useless
ones would be by chance, sqrt(2 ln n) standard errors of the difference over the light levels held
out.  Other sets of that size that fit as well are
look-alikes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.tables.fit import Solution, fit
from adv2e.diagnosis.tables.problem import Candidate, Free, Problem, held_rows

Array = NDArray[np.float64]

MOST_EFFECTS = 3
SIGNIFICANT = 0.05
LOOK_ALIKE = 9.0
"""Difference in the sum of squares, in units of its spread: three standard errors."""
SKILL = 0.5
"""Least share of the error of a constant that a model must be free of on held-out levels."""
NEAR = 3.0
"""Held-out error, in floors, up to which a model that fits needs no such share."""


@dataclass(frozen=True)
class Draws:
    """Fits to tables drawn from a fitted model.

    Attributes
    ----------
    logs : (draws, p)
        Logarithms of the parameters.
    p : float
        Share of the tables whose misfit is as large as that of the measured one.
    """

    logs: Array
    p: float


@dataclass(frozen=True)
class Model:
    """The declared model with some effects, fitted.

    Attributes
    ----------
    effects : tuple of Candidate
    free : tuple of Free
        What was fitted: nuisances, then the effects' parameters.
    fit : Solution
        To all rows that are not kept for judging.
    errors : (levels,)
        Mean square of ln(measured/predicted) on each level when it was held out, each row weighted
        by the inverse square of its standard error; on each row where all are of one level.
    p : float or None
        Probability of such a misfit; None where not asked for.
    """

    effects: tuple[Candidate, ...]
    free: tuple[Free, ...]
    fit: Solution
    errors: Array
    p: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by key."""
        return dict(zip((f.key for f in self.free), self.fit.values.tolist(), strict=True))

    @property
    def error(self) -> float:
        """Root mean square of ln(measured/predicted) on held-out levels."""
        return float(np.sqrt(self.errors.mean()))


@dataclass(frozen=True)
class Selection:
    """What came of it.

    Attributes
    ----------
    before, after : Model
    verdict : str
    alternatives : list of Model
        Sets of the same size that fit as well.
    tried : list of (Model, str)
        Every other set, and why it was not taken.
    constant : float
        Held-out error of a constant.
    floors : (levels,)
        What :attr:`Model.errors` would be of the true model.
    """

    before: Model
    after: Model
    verdict: str
    alternatives: list[Model]
    tried: list[tuple[Model, str]]
    constant: float
    floors: Array


class Selector:
    """Fits and compares models of one table.

    Parameters
    ----------
    problem : Problem
    seed : int
    draws : int
        Tables drawn for a probability or an interval.
    tick : callable
        Called with a line of progress.
    """

    def __init__(
        self,
        problem: Problem,
        seed: int,
        draws: int = 199,
        tick: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.problem = problem
        self._seed = seed
        self._draws = draws
        self._tick = tick
        self._drawn: dict[tuple[Candidate, ...], Draws] = {}
        fitted = ~problem.judged
        self._fitted = fitted
        held = held_rows(problem)
        self._units = [held & (problem.level == k) for k in np.unique(problem.level[held])]
        if len(self._units) == 1:  # judged at one level: its rows
            self._units = [np.arange(held.size) == k for k in np.flatnonzero(held)]
        self._folds = [
            fitted & ~unit if not problem.judged.any() else fitted for unit in self._units
        ]

    @property
    def floors(self) -> Array:
        """What :attr:`Model.errors` would be of the true model, (levels,)."""
        return np.array([self._mean_square(self.problem.error, unit) for unit in self._units])

    def select(self) -> Selection:
        """Return the verdict with all models tried."""
        problem = self.problem
        before = self.model(())
        before = replace(before, p=self.drawn(before).p)
        assert before.p is not None
        self._tick(f"declared model: held-out error {before.error:.3f}, p = {before.p:.3f}")
        if before.p >= SIGNIFICANT:
            return self._selection(before, before, "consistent", [], [])
        current, sets = before, {}
        for size in range(1, min(MOST_EFFECTS, len(problem.candidates)) + 1):
            found = [
                self.model(chosen)
                for chosen in itertools.combinations(problem.candidates, size)
                if self._determined(chosen)
            ]
            if not found:
                break
            sets[size] = found
            best = min(found, key=lambda model: model.error)
            self._tick(f"{size}: {' + '.join(best.names)}, held-out error {best.error:.3f}")
            if not lower(best, current, len(found)):
                if size > 1:
                    break
                continue  # two effects may hide each other
            current = replace(best, p=self.drawn(best).p)
            assert current.p is not None
            if current.p >= SIGNIFICANT:
                break
        return self._judge(before, current, sets)

    def _determined(self, chosen: tuple[Candidate, ...]) -> bool:
        """Whether every fold has more rows than parameters."""
        count = len(self.problem.nuisances) + sum(len(effect.free) for effect in chosen)
        keys = [free.key for effect in chosen for free in effect.free]
        return len(set(keys)) == len(keys) and all(fold.sum() > count for fold in self._folds)

    def _judge(self, before: Model, after: Model, sets: dict[int, list[Model]]) -> Selection:
        if after is before:
            refused = self._refused(before, sets, [], before)
            return self._selection(before, before, "unexplained", [], refused)
        assert after.p is not None
        explained = after.p >= SIGNIFICANT
        predicts = after.error**2 <= (1.0 - SKILL) * min(before.error, self._constant) ** 2
        # what fits the rows that it was fitted to need not predict others
        if not predicts and not (explained and self._is_near(after)):
            refused = self._refused(before, sets, [], before)
            return self._selection(before, before, "unexplained", [], refused)
        alternatives = [
            rival
            for rival in sets[len(after.effects)]
            if rival.effects != after.effects
            and lower(rival, before, 1)
            and self._as_well(rival, after)
        ]
        if alternatives:
            verdict = "not_identifiable"
        else:
            verdict = "explained" if explained else "partly_explained"
        refused = self._refused(before, sets, alternatives, after)
        return self._selection(before, after, verdict, alternatives, refused)

    def _is_near(self, model: Model) -> bool:
        """Whether the held-out error is near what the true model's would be."""
        return model.error**2 <= NEAR**2 * float(self.floors.mean())

    def _selection(
        self,
        before: Model,
        after: Model,
        verdict: str,
        alternatives: list[Model],
        tried: list[tuple[Model, str]],
    ) -> Selection:
        return Selection(before, after, verdict, alternatives, tried, self._constant, self.floors)

    def _as_well(self, rival: Model, best: Model) -> bool:
        """Whether a rival's misfit is larger by no more than chance makes, 997 times in 1000.

        Misfits are relative to that which the best leaves, should it be above the stated errors.
        """
        freedom = max(int(self._fitted.sum()) - len(best.free), 1)
        spread = max(1.0, best.fit.sum_of_squares / freedom)
        return (rival.fit.sum_of_squares - best.fit.sum_of_squares) / spread <= LOOK_ALIKE

    def _refused(
        self, before: Model, sets: dict[int, list[Model]], alternatives: list[Model], after: Model
    ) -> list[tuple[Model, str]]:
        """Return what was not taken, each with the reason; sets of two and more only where best."""
        out = []
        for size, models in sets.items():
            shown = models if size == 1 else [min(models, key=lambda model: model.error)]
            for model in shown:
                if model.effects == after.effects or model in alternatives:
                    continue
                ratio = f"held-out error {model.error:.3f}, declared {before.error:.3f}"
                if not lower(model, before, 1):
                    reason = f"does not lower it by more than its standard error: {ratio}"
                elif after is before:
                    reason = f"leaves too much, or predicts no better than a constant: {ratio}"
                elif size > len(after.effects):
                    reason = f"not lower by more than a standard error than with fewer: {ratio}"
                else:
                    reason = f"fits worse: {ratio}, that taken {after.error:.3f}"
                out.append((model, reason))
        return out

    def model(self, effects: tuple[Candidate, ...]) -> Model:
        """Fit the declared model with `effects`, to all rows and without each level."""
        free = (*self.problem.nuisances, *(f for effect in effects for f in effect.free))
        found = self._fit(free, self._fitted, _starts(free))
        errors = np.empty(len(self._units))
        for k, (fold, unit) in enumerate(zip(self._folds, self._units, strict=True)):
            part = found
            if not self.problem.judged.any():
                part = self._fit(free, fold, [found.logs, _starts(free)[0]])
            gap = self.problem.measured - self._predict(free, part.logs)
            errors[k] = self._mean_square(gap, unit)
        return Model(effects, free, found, errors)

    def _mean_square(self, gap: Array, unit: NDArray[np.bool_]) -> float:
        """Return the mean square of rows, each weighted by the inverse square of its error."""
        return float(np.average(gap[unit] ** 2, weights=self.problem.error[unit] ** -2.0))

    def drawn(self, model: Model) -> Draws:
        """Fit the model to tables drawn from it: normal errors about its logarithms."""
        if model.effects not in self._drawn:
            self._drawn[model.effects] = self._draw(model)
        return self._drawn[model.effects]

    def _draw(self, model: Model) -> Draws:
        rng = np.random.default_rng([self._seed, len(model.effects)])
        ideal = self._predict(model.free, model.fit.logs)
        logs = np.empty((self._draws, len(model.free)))
        above = 0
        for k in range(self._draws):
            table = ideal + self.problem.error * rng.standard_normal(ideal.size)
            found = self._fit(model.free, self._fitted, [model.fit.logs], table, 1e-4)
            logs[k] = found.logs
            above += found.sum_of_squares >= model.fit.sum_of_squares
        return Draws(logs, (above + 1) / (self._draws + 1))

    def _predict(self, free: tuple[Free, ...], logs: Array) -> Array:
        keys = (f.key for f in free)
        return self.problem.predict(dict(zip(keys, np.exp(logs).tolist(), strict=True)))

    def _fit(
        self,
        free: tuple[Free, ...],
        rows: NDArray[np.bool_],
        starts: list[Array],
        table: Array | None = None,
        tolerance: float = 1e-8,
    ) -> Solution:
        measured = self.problem.measured if table is None else table

        def residuals(logs: Array) -> Array:
            gap = (measured - self._predict(free, logs)) / self.problem.error
            chosen: Array = gap[rows]
            return chosen

        lower_, upper_ = (np.log([getattr(f, side) for f in free]) for side in ("lower", "upper"))
        return fit(residuals, starts, lower_, upper_, tolerance)

    @cached_property
    def _constant(self) -> float:
        """Return the held-out error of the mean of each group's fitted rows, or of all of them."""
        errors = []
        for fold, unit in zip(self._folds, self._units, strict=True):
            gap = np.zeros_like(self.problem.measured)
            for group in self.problem.groups:
                rows = np.zeros_like(fold)
                rows[group.rows] = True
                own = rows & fold
                mean = self.problem.measured[own if own.any() else fold].mean()
                gap[rows] = self.problem.measured[rows] - mean
            errors.append(self._mean_square(gap, unit))
        return float(np.sqrt(np.mean(errors)))


def lower(model: Model, than: Model, best_of: int) -> bool:
    """Whether the held-out error is lower by more than the standard error of the difference.

    `best_of`: how many useless ones there might be of which this is the luckiest, whose gain is
    some sqrt(2 ln n) standard errors.
    """
    gain = than.errors - model.errors
    if gain.size < 2:
        return False
    needed = max(1.0, math.sqrt(2.0 * math.log(best_of)))
    return bool(gain.mean() > needed * gain.std(ddof=1) / math.sqrt(gain.size))


def _starts(free: tuple[Free, ...]) -> list[Array]:
    """Return starts: all parameters at their first ones, at their second ones, and so on."""
    count = max((len(f.starts) for f in free), default=1)
    return [
        np.log(np.array([f.starts[min(k, len(f.starts) - 1)] for f in free])) for k in range(count)
    ]
