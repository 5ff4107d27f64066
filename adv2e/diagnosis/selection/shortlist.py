"""Shortlist of effects to add to a model: all are fitted, few are simulated often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from adv2e.config import Config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.hints.readouts import EXPOSURE
from adv2e.diagnosis.selection.reference import CATCHES_UP, SOME, Reference, State
from adv2e.diagnosis.statistics.metric import Ensemble
from adv2e.diagnosis.statistics.summary import BOTH

_LONGEST = 6
_FORMS = 2
"""Of them, forms of one effect: a third kept others out that are missing together with it."""
_FAR = 2.0
FEW, _CERTAIN = 8, 4.0
"""Simulations of every trial, and deviations of chance by which it is then too far behind the first
to be simulated more often: whoever needs it later, does that."""


@dataclass(frozen=True)
class Trial:
    """A candidate that was simulated often enough to compare it with others, in every view."""

    fit: Fitted
    ensembles: tuple[Ensemble, ...]
    score: float
    is_behind: bool = False
    """Whether it is far behind others: simulated less often, so that scores do not compare."""

    @property
    def name(self) -> str:
        return self.fit.candidate.name


def shortlisted(reference: Reference, state: State, candidates: Sequence[Candidate]) -> list[Trial]:
    """Return the best of the candidates on top of a model, the best first.

    The others are noted as rejected.
    """
    left = [one for one in candidates if one.name not in state.names]
    if not left:
        return []
    reference.begin(f"searching: trying {len({one.name for one in left})} effects")
    fitter = reference.fitter(splits.TRAIN, state.config, rough=True)
    fits = fitter.at_best_starts(left, state.config, (1, 2))
    for one in left:
        exposed = _exposed(state, one)
        if exposed != state.config:
            fits += fitter.at_best_starts([one], exposed, (1, 2))
    nothing = fitter.misfit(state.config, (1, 2))
    of_chance = [fit for fit in fits if fit.candidate.of_chance]
    fits = [fit for fit in fits if not fit.candidate.of_chance]
    dropped: list[Fitted] = []
    for _ in range(2):
        fitter.improve(fits, (1, 2))
        fits.sort(key=lambda fit: fit.misfit)
        dropped = fits[2 * _LONGEST :] + dropped
        fits = fits[: 2 * _LONGEST]
    # whoever is far behind the first is not worth the simulations
    least = min((fit.misfit for fit in fits), default=nothing)
    far = _FAR * least + _FAR * len(reference.observed[BOTH])
    names = [fit.candidate.name for fit in fits]
    chosen = [fit for k, fit in enumerate(fits) if names[:k].count(names[k]) < _FORMS]
    chosen = [fit for fit in chosen[:_LONGEST] if fit.misfit <= far]
    dropped = [fit for fit in fits if not any(fit is one for one in chosen)] + dropped
    fits = chosen + of_chance
    reference.fitter(splits.TRAIN, state.config).improve(fits, (3, 4, 5))
    near, others = _halved(reference, _simulated(reference, fits, FEW))
    trials = _simulated(reference, [trial.fit for trial in near], SOME) + others
    reference.rejections.new_round()
    for trial in trials:
        behind = ", far behind" if trial.is_behind else ""
        reference.log(f"  {trial.name} {trial.fit.settings}: score {trial.score:.0f}{behind}")
        reference.rejections.add(trial.fit, "others explain more")
    for fit in dropped:
        share = 1.0 - fit.misfit / nothing
        why = f"explains {share:.0%} of the difference, others explain more"
        reference.rejections.add(fit, why if share >= 0.005 else "explains nothing")
    return trials


def _simulated(reference: Reference, fits: Sequence[Fitted], seeds: int) -> list[Trial]:
    """Return fits simulated so many times, the best first."""
    configs = [fit.config for fit in fits]
    reference.sampler.samples(configs, range(1, seeds + 1))  # all at once, then held
    trials = []
    for fit, config in zip(fits, configs, strict=True):
        ensembles = reference.ensembles(config, range(1, seeds + 1))
        score = scored(reference, ensembles, len(fit.candidate.parameters))
        trials.append(Trial(fit, ensembles, score))
    return sorted(trials, key=lambda trial: -trial.score)


def _halved(reference: Reference, trials: Sequence[Trial]) -> tuple[list[Trial], list[Trial]]:
    """Return the trials that more simulations may put first, and those that they cannot."""
    observed = reference.observed[BOTH]

    def is_behind(trial: Trial) -> bool:
        chance = trial.ensembles[BOTH].parted_by_chance(trials[0].ensembles[BOTH], observed)
        far = trials[0].score - trial.score > CATCHES_UP + _CERTAIN * chance
        return far and not trial.fit.candidate.of_chance

    told = [replace(trial, is_behind=is_behind(trial)) for trial in trials]
    return [one for one in told if not one.is_behind], [one for one in told if one.is_behind]


def best_forms(trials: Sequence[Trial]) -> list[Trial]:
    best: dict[str, Trial] = {}
    for trial in trials:
        best.setdefault(trial.name, trial)
    return list(best.values())


def _exposed(state: State, candidate: Candidate) -> Config:
    """Return a model with its exposure as a candidate needs it, if that is fitted and not held."""
    fitted = any(one.key == EXPOSURE for fit in state.fits for one in fit.candidate.parameters)
    if candidate.readouts is None or not fitted:
        return state.config
    return candidate.readouts.exposed(state.config)


def scored(reference: Reference, ensembles: Sequence[Ensemble], parameters: int) -> float:
    """Return a model's log likelihood of training and validation data together.

    Less the number of `parameters` that it adds; `ensembles`: one a view.
    """
    return ensembles[BOTH].log_likelihood(reference.observed[BOTH]) - parameters
