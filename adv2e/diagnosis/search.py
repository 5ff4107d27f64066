"""Attribution: which effects, added to the declared model, make it agree with the recording.

Forward: every effect of the library is fitted on one part of the data, the best are simulated many
times, and the best of those is added if it holds on another part.  That goes on until chance can
make what is left, or nothing holds.  Then backward: what is no longer needed is dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis import parts
from adv2e.diagnosis.candidates import Candidate, about_key, neutral_value
from adv2e.diagnosis.fit import Fit, Fitter
from adv2e.diagnosis.markers import BOTH, VIEWS
from adv2e.diagnosis.metric import Model, Scale
from adv2e.diagnosis.result import Detectable, Rejected
from adv2e.diagnosis.simulations import Laboratory

Array = NDArray[np.float64]

LEVEL = 0.01
"""Probability below which chance is not believed to make a residual."""

MOST_EFFECTS = 4
PARTLY = 0.8
"""Share of the residual that effects must explain to be named when something is left."""

NEARLY = 0.98
"""Share of the residual beyond which what is left is put down to the fit, not to another effect."""

_MANY, _SOME = 100, 32
_FINALISTS = 6
_FAR = 2.0
_TRIED = 3
_SEEDS = 6
_ROUNDS = 3
_CLOSE = 3.0
_QUIET = 2.5
_SIGNATURE = 12
_POWER = 3.2  # deviations: 99 % below without the effect, 80 % above with it


@dataclass(frozen=True)
class State:
    """A model: configuration, the fits that made it, and its simulations in every view."""

    config: Config
    fits: tuple[Fit, ...]
    models: tuple[Model, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects that were added."""
        return tuple(fit.candidate.name for fit in self.fits)


@dataclass
class Trial:
    """A candidate that was simulated often enough to judge it."""

    fit: Fit
    models: tuple[Model, ...]
    score: float


@dataclass
class Outcome:
    """Where the search ended.

    Attributes
    ----------
    state : State
    probability : float
        Of the residual left, where the search looked.
    explained : float
        Share of the declared model's residual that is gone.
    alternatives : list of str
    rejected : dict
        Last reason for each effect that was not added.
    """

    state: State
    probability: float
    explained: float
    alternatives: list[str]
    rejected: dict[str, Rejected]


class Search:
    """Looks for effects that a declared model lacks.

    Parameters
    ----------
    laboratory : Laboratory
    observed : (views, statistics)
        Of the recording.
    declared : Config
    candidates : sequence of Candidate
    log : callable
        Told of each step.
    """

    def __init__(
        self,
        laboratory: Laboratory,
        observed: Array,
        declared: Config,
        candidates: Sequence[Candidate],
        log: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._laboratory, self._observed = laboratory, observed
        self._candidates, self._log = list(candidates), log
        simulator = laboratory.simulator
        simulator.likely = simulator.done + _likely(candidates, 1)
        # not the simulations that misfits are compared with: those would fit too well
        sample = laboratory.ensemble(declared, range(_MANY + 1, 2 * _MANY + 1))
        least = laboratory.markers.least
        self.scales = tuple(Scale.of(sample[:, view], least) for view in range(VIEWS))
        self.declared = self._state(declared, ())
        self.rejected: dict[str, Rejected] = {}

    def _state(self, config: Config, fits: tuple[Fit, ...]) -> State:
        sample = self._laboratory.ensemble(config, range(1, _MANY + 1))
        return State(config, fits, self._models(sample))

    def _models(self, sample: Array) -> tuple[Model, ...]:
        return tuple(Model.of(self.scales[view], sample[:, view]) for view in range(VIEWS))

    def probability(self, state: State, view: int = BOTH) -> float:
        """Return how often chance makes a residual as large as the recording's."""
        return state.models[view].probability(self._observed[view])

    def run(self) -> Outcome:
        """Search forward and backward."""
        state = self.declared
        alternatives: list[str] = []
        probability = self.probability(state)
        self._log(f"declared model: probability of the residual {probability:.2g}")
        while (
            probability < LEVEL
            and self.explained(state) < NEARLY
            and len(state.fits) < MOST_EFFECTS
        ):
            if state.fits:
                self._laboratory.simulator.likely += _likely(self._candidates, 0)
            trials = self._trials(state)
            grown = self._first_that_holds(state, trials)
            if grown is None:
                break
            state, alternatives = grown
            probability = self.probability(state)
            self._log(f"added {', '.join(state.names)}: probability {probability:.2g}")
        if len(state.fits) > 1:
            state = self._backward(state)
            probability = self.probability(state)
        for name in state.names:
            self.rejected.pop(name, None)
        return Outcome(state, probability, self.explained(state), alternatives, dict(self.rejected))

    def explained(self, state: State, view: int = BOTH) -> float:
        """Return the share of the declared model's residual that is gone."""
        before = self.declared.models[view].misfit(self._observed[view])
        after, floor = state.models[view].misfit(self._observed[view]), state.models[view].floor
        return float((before - after) / max(before - floor, 1e-9))

    def detectable(self, candidates: Sequence[Candidate]) -> list[Detectable]:
        """Return the size of each effect that would have been seen 8 times in 10.

        From the mildest probe, as if what an effect changes grew in proportion to it.
        """
        fitter = Fitter(self._laboratory, self.scales[BOTH], self.scales[BOTH].mean, BOTH)
        mildest: dict[str, Candidate] = {}
        for candidate in candidates:
            if candidate.knobs:
                mildest.setdefault(candidate.name, candidate)
        if not mildest:
            return []
        declared = self.declared.config
        configs = [one.applied(declared, one.inner(one.probes[0])) for one in mildest.values()]
        idle, *means = fitter.whites([declared, *configs], (1, 2))
        seen = _POWER * self.declared.models[BOTH].spread * len(idle)
        result = []
        for candidate, mean in zip(mildest.values(), means, strict=True):
            knob, value = candidate.knobs[0], candidate.probes[0][0]
            strength = max(float(np.sum((mean - idle) ** 2)), 1e-9)
            factor = float(np.sqrt(seen / strength))
            neutral = neutral_value(declared, knob)
            size = value / factor if np.isinf(neutral) else neutral + factor * (value - neutral)
            result.append(
                Detectable(candidate.name, knob.key, size, about_key(declared, knob.key).unit)
            )
        return result

    def _trials(self, state: State) -> list[Trial]:
        """Return the finalists among the candidates, the best first."""
        fitter = Fitter(
            self._laboratory, self.scales[parts.FIT], self._observed[parts.FIT], parts.FIT
        )
        left = [one for one in self._candidates if one.name not in state.names]
        if not left:
            return []
        fits = fitter.probe(left, state.config, (1, 2))
        nothing = fitter.misfit(state.config, (1, 2))
        fitter.improve(fits, (1, 2))
        fits.sort(key=lambda fit: fit.misfit)
        self._dismiss(fits[2 * _FINALISTS :], nothing)
        fits = fits[: 2 * _FINALISTS]
        fitter.improve(fits, (1, 2))
        fits.sort(key=lambda fit: fit.misfit)
        self._dismiss(fits[_FINALISTS:], nothing)
        # whoever is far behind the first is not worth the simulations
        far = _FAR * fits[0].misfit + _FAR * len(self._observed[BOTH])
        self._dismiss([fit for fit in fits[:_FINALISTS] if fit.misfit > far], nothing)
        fits = [fit for fit in fits[:_FINALISTS] if fit.misfit <= far]
        fitter.improve(fits, (3, 4, 5))
        sample = self._laboratory.many([fit.config for fit in fits], range(1, _SOME + 1))
        trials = [self._trial(fit, rows) for fit, rows in zip(fits, sample, strict=True)]
        trials.sort(key=lambda trial: -trial.score)
        for trial in trials:
            name = trial.fit.candidate.name
            parameters = trial.fit.candidate.parameters(trial.fit.place)
            self._log(f"  {name} {parameters}: score {trial.score:.0f}")
            self.rejected[name] = Rejected(name, "others explain more", parameters)
        return trials

    def _dismiss(self, fits: Sequence[Fit], nothing: float) -> None:
        for fit in fits:
            share = 1.0 - fit.misfit / nothing
            what = f"takes away {share:.0%} of the misfit" if share > 0 else "makes nothing better"
            name = fit.candidate.name
            self.rejected[name] = Rejected(
                name, f"{what} where others do more", fit.candidate.parameters(fit.place)
            )

    def _trial(self, fit: Fit, sample: Array) -> Trial:
        models = self._models(sample)
        score = models[BOTH].log_likelihood(self._observed[BOTH]) - len(fit.candidate.knobs)
        return Trial(fit, models, score)

    def _first_that_holds(
        self, state: State, trials: Sequence[Trial]
    ) -> tuple[State, list[str]] | None:
        """Return the model with the best candidate that holds, and what cannot be told from it.

        The fit is brought to its end on the data for fitting, then judged on other data, and only
        then fitted to both.
        """
        tried: set[str] = set()
        for trial in trials[:_TRIED]:
            name = trial.fit.candidate.name
            if name in tried:
                continue
            tried.add(name)
            fits = (*state.fits, trial.fit)
            fitted, fits = self._fitted(fits, trial.models[parts.FIT].sd, parts.FIT)
            sample = self._laboratory.ensemble(fitted.config, range(1, _SOME + 1))
            models = self._models(sample)
            objections = self._objections(fitted, models[parts.JUDGE], state.models[parts.JUDGE])
            parameters = fits[-1].candidate.parameters(fits[-1].place)
            self._log(f"  {name} {parameters}: {'; '.join(objections) or 'holds'}")
            if objections:
                self.rejected[name] = Rejected(name, "; ".join(objections), parameters)
                continue
            fitted, fits = self._fitted(fits, models[BOTH].sd, BOTH)
            return self._state(fitted.config, fits), self._alike(trial, trials)
        return None

    def _objections(self, fit: Fit, after: Model, before: Model) -> list[str]:
        """Return why a model is not to be taken for the one before it."""
        observed = self._observed[parts.JUDGE]
        gain = after.log_likelihood(observed) - before.log_likelihood(observed)
        found = []
        if gain < self._chance_gain(before, after):
            found.append("what it gains on data it was not fitted to, chance could gain")
        if fit.at_border:
            found.append("its fit runs to the end of the physical range")
        change = np.abs(self.scales[parts.JUDGE].whitening @ (after.mean - before.mean))
        own = np.argsort(-change)[:_SIGNATURE]
        z = after.z(observed)[own]
        loud = float(np.sqrt(np.mean(z * z)))
        if loud > _QUIET:
            found.append(f"what it changes most still stands out by {loud:.1f} deviations")
        return found

    def _chance_gain(self, before: Model, after: Model) -> float:
        """Return what a candidate gains on recordings of the model without it, at most."""
        rows = before.sample
        mean_b, mean_a = before.mean, after.mean
        white = self.scales[parts.JUDGE].whitening
        zb = ((rows - mean_b) / before.sd) @ white.T
        za = ((rows - mean_a) / after.sd) @ white.T
        gain = 0.5 * np.sum(zb * zb - za * za, axis=1)
        gain += np.log(before.sd).sum() - np.log(after.sd).sum()
        return float(max(gain.mean() + 3.0 * gain.std(), 3.0))

    def _fitted(self, fits: tuple[Fit, ...], sd: Array, view: int) -> tuple[Fit, tuple[Fit, ...]]:
        """Return all effects fitted together in a view of the data, joined and one by one."""
        joint = _joined(fits, self.declared.config)
        fitter = Fitter(self._laboratory, self.scales[view], self._observed[view], view, sd)
        for _ in range(_ROUNDS):
            fitter.improve([joint], range(11, 11 + _SEEDS), 0.08)
            if joint.moved < 0.015:
                break
        return joint, _parted(joint, fits)

    def _alike(self, chosen: Trial, trials: Sequence[Trial]) -> list[str]:
        """Return the effects that cannot be told from the chosen one."""
        names = {
            trial.fit.candidate.name for trial in trials if trial.score > chosen.score - _CLOSE
        }
        return sorted(names - {chosen.fit.candidate.name})

    def _backward(self, state: State) -> State:
        """Drop effects without which the others, fitted again, do as well."""
        for fit in state.fits[:-1]:
            rest = tuple(other for other in state.fits if other is not fit)
            fitted, rest = self._fitted(rest, state.models[BOTH].sd, BOTH)
            without = self._state(fitted.config, rest)
            loss = state.models[BOTH].log_likelihood(self._observed[BOTH]) - without.models[
                BOTH
            ].log_likelihood(self._observed[BOTH])
            if loss < _CLOSE:
                name = fit.candidate.name
                self._log(f"dropped {name}: the others do without it")
                self.rejected[name] = Rejected(name, "not needed beside the others")
                return without
        return state


def _likely(candidates: Sequence[Candidate], ensembles: int) -> int:
    """Return about how many simulations one round of the search takes."""
    probes = 2 * sum(len(one.probes) for one in candidates)
    steps = 2 * sum(3 + len(one.knobs) for one in candidates)
    finals = _FINALISTS * (2 * 4 * 4 + _SOME) + 3 * 10 * 4 + _MANY
    return 2 * _MANY * ensembles + probes + steps + steps // 2 + finals


def _joined(fits: tuple[Fit, ...], declared: Config) -> Fit:
    """Return one fit of all effects together."""
    knobs = tuple(knob for fit in fits for knob in fit.candidate.knobs)
    extra = tuple(pair for fit in fits for pair in fit.candidate.extra)
    name = " and ".join(fit.candidate.name for fit in fits)
    place = np.concatenate([fit.place for fit in fits])
    return Fit(Candidate(name, knobs, (), extra), declared, place)


def _parted(joint: Fit, fits: tuple[Fit, ...]) -> tuple[Fit, ...]:
    """Return the effects of a joined fit, each with its own place and covariance."""
    result, start = [], 0
    for fit in fits:
        stop = start + len(fit.candidate.knobs)
        covariance = joint.covariance[start:stop, start:stop]
        result.append(
            Fit(fit.candidate, fit.base, joint.place[start:stop], joint.misfit, covariance)
        )
        start = stop
    return tuple(result)
