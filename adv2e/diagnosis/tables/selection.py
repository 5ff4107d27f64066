"""Selection of effects for a table: models of increasing size, judged on held-out light levels.

Search and acceptance differ from those for recordings: a table is a handful of rows, too few for
training, validation and test, so that every set of effects is fitted with each light level left out
in turn.  Candidates, rejections and the result are the same.

The declared model is rejected where its misfit is larger than 95 in 100 of those of tables drawn
from it.  A model is taken as linear about its point for that, and for intervals, so that no drawn
table needs a fit of its own.

Only then are effects added, up to three, one after another to the best set so far: the one with the
least held-out error, if that is lower than before by more than the best of all n sets of that size
would be by chance if all were useless, sqrt(2 ln n) standard errors of the gain over the light
levels held out.  The gain of a level is what the mean square falls by, or that over the sum of both
and the floor: an effect that acts in bright light gains most there, and that is no chance.  Other
sets of that size that fit as well are look-alikes.

Of three light levels or fewer, one that is held out lies far beyond the others, and tells little of
effects that fit.  If nothing meets such a table within its errors, all effects are fitted together
to all rows, at least twice as many as there are parameters.  If they meet the table (a sum of
squares within three standard errors of chance), those are dropped, one after another, without which
the rest fits as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.tables.fit import fit, slopes_of
from adv2e.diagnosis.tables.problem import Array, Problem, Settings
from adv2e.reports.result import Rejected, Verdict

MOST_EFFECTS = 3
SIGNIFICANT = 0.05
LOOK_ALIKE = 9.0
"""Difference in the sum of squares, in units of its spread: three standard errors."""
SKILL = 0.5
"""Least share of the error of a constant that a model must be free of on held-out levels."""
FEW_LEVELS = 3
"""Light levels of which one that is held out lies beyond what the others tell."""
NEAR = 3.0
"""Held-out error, in floors, up to which a model that fits needs no such share."""
_OF_FOLDS = 1e-3
"""Tolerance of fits without a level, which begin where that to all ended."""


@dataclass(frozen=True)
class Draws:
    """Fits to tables drawn from a fitted model, which is taken as linear about its point.

    Attributes
    ----------
    logs : (draws, parameters)
        Logarithms of the parameters.
    predicted : (draws, rows)
        Logarithms of what is measured.
    p : float
        Share of the tables whose misfit is as large as that of the measured one.
    """

    logs: Array
    predicted: Array
    p: float


@dataclass(frozen=True)
class FittedSet:
    """The declared model with a set of effects, fitted.

    Attributes
    ----------
    joint : Candidate
        What was fitted: nuisances, then the effects.
    point : (parameters,)
        Fitted to all rows that are not kept for testing, on the scales of the parameters.
    misfit : float
        Sum of squares there.
    errors : (levels,)
        Mean square of ln(measured/predicted) on each level when it was held out, each row weighted
        by the inverse square of its standard error; on each row where all are of one level.
    """

    effects: tuple[Candidate, ...]
    joint: Candidate
    point: Array
    misfit: float
    errors: Array

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(effect.name for effect in self.effects)

    @property
    def settings(self) -> dict[str, float]:
        return self.joint.settings(self.point)

    @property
    def error(self) -> float:
        """Root mean square of ln(measured/predicted) on held-out levels."""
        return float(np.sqrt(self.errors.mean()))


@dataclass(frozen=True)
class Choice:
    """Result of a selection.

    `best` has the least held-out error of all, taken or not; `alternatives` are sets of the size of
    `after` that fit as well.  `together`: chosen for meeting all rows, not light held out.
    """

    before: FittedSet
    after: FittedSet
    best: FittedSet
    verdict: Verdict
    alternatives: list[FittedSet]
    rejected: list[Rejected]
    together: bool = False


class Selector:
    """Fits and compares sets of effects for one table."""

    def __init__(self, problem: Problem, settings: Settings) -> None:
        self.problem, self._settings = problem, settings
        self._drawn: dict[tuple[Candidate, ...], Draws] = {}
        self._train, held = ~problem.test, problem.held_out
        self._units = [held & (problem.level == k) for k in np.unique(problem.level[held])]
        if len(self._units) == 1:  # judged at one level: its rows
            self._units = [np.arange(held.size) == k for k in np.flatnonzero(held)]
        self._folds = [
            self._train if problem.test.any() else self._train & ~unit for unit in self._units
        ]

    @property
    def floors(self) -> Array:
        """Noise floor: :attr:`FittedSet.errors` of the true model, (levels,)."""
        return np.array([self._mean_square(self.problem.error, unit) for unit in self._units])

    def select(self) -> Choice:
        candidates, log = self.problem.candidates, self._settings.log
        before = self.fitted(())
        p = self.drawn(before).p
        log(f"declared model: held-out error {before.error:.3f}, p = {p:.3f}")
        if p >= SIGNIFICANT:
            return Choice(before, before, before, "consistent", [], [])
        after = best = before
        tried: list[list[FittedSet]] = []
        for size in range(1, min(MOST_EFFECTS, len(candidates)) + 1):
            sets = [(*best.effects, one) for one in candidates if one not in best.effects]
            found = [self.fitted(chosen) for chosen in sets if self._determined(chosen)]
            if not found:
                break
            tried.append(found)
            best = min(found, key=lambda one: one.error)
            log(f"{size}: {' + '.join(best.names)}, held-out error {best.error:.3f}")
            if self._lower(best, after, math.comb(len(candidates), size)):
                after = best
                if self.drawn(after).p >= SIGNIFICANT:
                    break
            elif size > 1:  # of one only, two may hide each other
                break
        best = min((one for models in tried for one in models), key=lambda one: one.error)
        if self.drawn(after).p < SIGNIFICANT and (met := self._together()):
            after, alternatives = met[0], [one for one in met[1:] if one.names != met[0].names]
            verdict: Verdict = "not_identifiable" if alternatives else "explained"
            reason = (
                f"leaves more than the errors of the table, which {' + '.join(after.names)} meet"
            )
            rejected = [
                Rejected(one.names[0], reason, one.settings, one.error / before.error)
                for one in tried[0]
            ]
            return Choice(before, after, best, verdict, alternatives, rejected, together=True)
        if after is before or not self._is_believed(after, before):
            rejected = self._rejected(tried, before, before, [])
            return Choice(before, before, best, "unexplained", [], rejected)
        alternatives = [
            rival
            for rival in tried[len(after.effects) - 1]
            if rival.names != after.names  # or a few keys more of the same
            and self._lower(rival, before, 1)
            and self._as_well(rival, after)
        ]
        verdict = "not_identifiable"
        if not alternatives:
            verdict = "explained" if self.drawn(after).p >= SIGNIFICANT else "partly_explained"
        rejected = self._rejected(tried, before, after, alternatives)
        return Choice(before, after, best, verdict, alternatives, rejected)

    def _together(self) -> list[FittedSet]:
        """Return the sets that meet all rows of a table of few lights, none of them with a part.

        All have as many effects; the first fits best.  None: all effects together do not meet it.
        """
        chosen = tuple({one.name: one for one in reversed(self.problem.candidates)}.values())[::-1]
        keys = len(self.problem.nuisances.parameters) + sum(len(one.parameters) for one in chosen)
        if len(self._units) > FEW_LEVELS or self._train.sum() < 2 * keys:
            return []
        whole = self._fitted_to_all(chosen, None)
        freedom = float(self._train.sum()) - keys
        if whole.misfit > freedom + math.sqrt(LOOK_ALIKE * 2.0 * freedom):
            return []
        met, found = [whole], [whole]
        while found := [one for one in found if self._as_well(one, whole)]:
            met = sorted(found, key=lambda one: one.misfit)
            self._settings.log(f"{' + '.join(met[0].names)} meet all rows: {met[0].misfit:.1f}")
            found = [
                self._fitted_to_all(tuple(e for e in met[0].effects if e is not left), met[0])
                for left in (met[0].effects if len(met[0].effects) > 1 else ())
            ]
        return [self.fitted(one.effects, one.point) for one in met]

    def _fitted_to_all(self, effects: tuple[Candidate, ...], model: FittedSet | None) -> FittedSet:
        """Fit `effects` to all rows, none held out; from the values of a larger model, if any."""
        joint = Candidate.joined([self.problem.nuisances, *effects])
        starts = [np.array(joint.scaled(start)) for start in joint.starts]
        if model is not None:
            values = [model.settings[one.key] for one in joint.parameters]
            starts = [np.array(joint.scaled(values))]
        point, misfit = self._fit(joint, self._train, starts, self.problem.tolerance)
        return FittedSet(effects, joint, point, misfit, np.full(len(self._units), np.nan))

    def _lower(self, model: FittedSet, than: FittedSet, best_of: int) -> bool:
        """Tell whether the held-out error is lower by more than chance makes it.

        `best_of`: number n of models of which this is the best; the best of n useless ones gains
        some sqrt(2 ln n) standard errors.
        """
        gain = than.errors - model.errors
        if gain.size < 2 or gain.mean() <= 0.0:
            return False
        gains = np.stack([gain, gain / (than.errors + model.errors + self.floors)])
        needed = max(1.0, math.sqrt(2.0 * math.log(best_of))) / math.sqrt(gain.size)
        return bool((gains.mean(axis=1) > needed * gains.std(axis=1, ddof=1)).any())

    def _determined(self, chosen: tuple[Candidate, ...]) -> bool:
        """Tell whether every fold has more rows than parameters."""
        keys = [one.key for effect in chosen for one in effect.parameters]
        count = len(self.problem.nuisances.parameters) + len(keys)
        return len(set(keys)) == len(keys) and all(fold.sum() > count for fold in self._folds)

    def _is_believed(self, after: FittedSet, before: FittedSet) -> bool:
        """Tell whether a model predicts held-out rows, not only the rows that it was fitted to."""
        if after.error**2 <= (1.0 - SKILL) * min(before.error, self.constant) ** 2:
            return True
        near = after.error**2 <= NEAR**2 * float(self.floors.mean())
        return near and self.drawn(after).p >= SIGNIFICANT

    def _as_well(self, rival: FittedSet, best: FittedSet) -> bool:
        """Tell whether a rival's misfit is within three standard errors of the best one.

        Misfits are in units of the spread that the best leaves, if that exceeds the stated errors.
        """
        freedom = max(int(self._train.sum()) - len(best.point), 1)
        spread = max(1.0, best.misfit / freedom)
        return (rival.misfit - best.misfit) / spread <= LOOK_ALIKE

    def fitted(self, effects: tuple[Candidate, ...], point: Array | None = None) -> FittedSet:
        """Fit the declared model with `effects`, to all rows and without each level.

        `point` : where that to all rows ends, if it is known.
        """
        joint = Candidate.joined([self.problem.nuisances, *effects])
        starts = [np.array(joint.scaled(start)) for start in joint.starts]
        starts = starts if point is None else [point]
        point, misfit = self._fit(joint, self._train, starts, self.problem.tolerance)
        errors = np.empty(len(self._units))
        for k, (fold, unit) in enumerate(zip(self._folds, self._units, strict=True)):
            part = point
            if not self.problem.test.any():
                part, _ = self._fit(joint, fold, [point], _OF_FOLDS)
            gap = self.problem.measured - self.predicted(joint, part)
            errors[k] = self._mean_square(gap, unit)
        return FittedSet(effects, joint, point, misfit, errors)

    def _mean_square(self, gap: Array, unit: NDArray[np.bool_]) -> float:
        """Return the mean square of rows, each weighted by the inverse square of its error."""
        return float(np.average(gap[unit] ** 2, weights=self.problem.error[unit] ** -2.0))

    def drawn(self, model: FittedSet) -> Draws:
        """Return fits of the model to tables drawn from it: normal errors about its logarithms."""
        if model.effects not in self._drawn:
            self._drawn[model.effects] = self._draw(model)
        return self._drawn[model.effects]

    def _draw(self, model: FittedSet) -> Draws:
        problem, train, point = self.problem, self._train, model.point
        ideal, borders = self.predicted(model.joint, point), _borders(model.joint)
        slopes = slopes_of(
            lambda at: self.predicted(model.joint, at), point, ideal, borders, problem.step
        )
        weighed = (slopes / problem.error[:, None])[train]
        rng = np.random.default_rng([self._settings.seed, len(model.effects)])
        drawn = rng.standard_normal((self._settings.draws, int(train.sum())))
        logs = np.clip(point + drawn @ np.linalg.pinv(weighed).T, *borders)
        moved = logs - point
        misfits = np.sum((drawn - moved @ weighed.T) ** 2, axis=1)
        above = np.count_nonzero(misfits >= model.misfit)
        return Draws(logs, ideal + moved @ slopes.T, (above + 1) / (len(drawn) + 1))

    def predicted(self, joint: Candidate, point: Array) -> Array:
        return self.problem.predict(joint.settings(point))

    def _fit(
        self, joint: Candidate, rows: NDArray[np.bool_], starts: Sequence[Array], tolerance: float
    ) -> tuple[Array, float]:
        def residuals(logs: Array) -> Array:
            gap = (self.problem.measured - self.predicted(joint, logs)) / self.problem.error
            chosen: Array = gap[rows]
            return chosen

        return fit(residuals, starts, _borders(joint), self.problem.step, tolerance)

    @cached_property
    def constant(self) -> float:
        """Held-out error of the mean of each group's fitted rows, or of all of them."""
        measured, errors = self.problem.measured, []
        for fold, unit in zip(self._folds, self._units, strict=True):
            gap = np.zeros_like(measured)
            for rows in self.problem.groups.values():
                own = rows[fold[rows]]
                gap[rows] = measured[rows] - measured[own if own.size else fold].mean()
            errors.append(self._mean_square(gap, unit))
        return float(np.sqrt(np.mean(errors)))

    def _rejected(
        self, tried: list[list[FittedSet]], before: FittedSet, after: FittedSet,
        alternatives: list[FittedSet],
    ) -> list[Rejected]:  # fmt: skip
        """Return the rejected sets with reasons; of two and more effects, the best of each size."""
        out = []
        for size, models in enumerate(tried, 1):
            for model in models if size == 1 else [min(models, key=lambda one: one.error)]:
                if model is after or model in alternatives:
                    continue
                ratio = f"held-out error {model.error:.3f}, declared {before.error:.3f}"
                if not self._lower(model, before, 1):
                    reason = f"does not lower it by more than chance: {ratio}"
                elif after is before:
                    reason = f"leaves too much, or predicts no better than a constant: {ratio}"
                elif size > len(after.effects):
                    reason = f"not lower by more than a standard error than with fewer: {ratio}"
                else:
                    reason = f"fits worse: {ratio}, that taken {after.error:.3f}"
                share = model.error / before.error
                out.append(Rejected(" + ".join(model.names), reason, model.settings, share))
        return out


def _borders(joint: Candidate) -> Array:
    """Return the logarithms of the least and the largest parameters, (2, parameters)."""
    return np.log([[one.low, one.high] for one in joint.parameters]).reshape(-1, 2).T
