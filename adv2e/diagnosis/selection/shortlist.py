"""Which effects are worth trying on top of a model: all are fitted, few are simulated often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from adv2e.config import Config
from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fit import Fitted
from adv2e.diagnosis.hints.readouts import EXPOSURE
from adv2e.diagnosis.selection.reference import SOME, Bench, State
from adv2e.diagnosis.statistics import BOTH
from adv2e.diagnosis.statistics.metric import Model

_FINALISTS = 6
_FORMS = 2
"""Of them, forms of one effect: a third kept others out that are missing together with it."""
_FAR = 2.0


@dataclass(frozen=True)
class Trial:
    """A candidate that was simulated often enough to compare it with others.

    Attributes
    ----------
    fit : Fitted
    models : tuple of Model
        One a view.
    score : float
        Log likelihood of fitting and judging data together, less the number of its knobs.
    """

    fit: Fitted
    models: tuple[Model, ...]
    score: float

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.fit.candidate.name


def finalists(bench: Bench, state: State, candidates: Sequence[Candidate]) -> list[Trial]:
    """Return the best of the candidates on top of a model, the best first.

    The others are noted as rejected.
    """
    left = [one for one in candidates if one.name not in state.names]
    if not left:
        return []
    fitter = bench.fitter(parts.FIT, state.config, first_look=True)
    fits = fitter.probe(left, state.config, (1, 2))
    for one in left:
        exposed = _exposed(state, one)
        if exposed != state.config:
            fits += fitter.probe([one], exposed, (1, 2))
    nothing = fitter.misfit(state.config, (1, 2))
    of_chance = [fit for fit in fits if fit.candidate.of_chance]
    fits = [fit for fit in fits if not fit.candidate.of_chance]
    dropped: list[Fitted] = []
    for _ in range(2):
        fitter.improve(fits, (1, 2))
        fits.sort(key=lambda fit: fit.misfit)
        dropped = fits[2 * _FINALISTS :] + dropped
        fits = fits[: 2 * _FINALISTS]
    # whoever is far behind the first is not worth the simulations
    least = min((fit.misfit for fit in fits), default=nothing)
    far = _FAR * least + _FAR * len(bench.observed[BOTH])
    chosen = [fit for fit in _without_third_forms(fits)[:_FINALISTS] if fit.misfit <= far]
    dropped = [fit for fit in fits if not any(fit is one for one in chosen)] + dropped
    fits = chosen + of_chance
    bench.fitter(parts.FIT, state.config).improve(fits, (3, 4, 5))
    configs = [fit.config for fit in fits]
    sample = bench.laboratory.many(configs, range(1, SOME + 1))
    trials = [
        Trial(fit, models, scored(bench, models, len(fit.candidate.knobs)))
        for fit, models in zip(fits, map(bench.models, configs, sample), strict=True)
    ]
    trials.sort(key=lambda trial: -trial.score)
    bench.rejections.new_round()
    for trial in trials:
        bench.log(f"  {trial.name} {trial.fit.parameters}: score {trial.score:.0f}")
        bench.rejections.add(trial.fit, "others explain more")
    for fit in dropped:
        bench.rejections.add(fit, _behind(fit, nothing))
    return trials


def _exposed(state: State, candidate: Candidate) -> Config:
    """Return a model with its exposure as a candidate needs it, if that is fitted and not held."""
    fitted = any(knob.key == EXPOSURE for fit in state.fits for knob in fit.candidate.knobs)
    if candidate.readouts is None or not fitted:
        return state.config
    return candidate.readouts.exposed(state.config)


def _without_third_forms(fits: Sequence[Fitted]) -> list[Fitted]:
    """Return the best forms of each effect; only one of them is tried in the end."""
    names = [fit.candidate.name for fit in fits]
    return [fit for k, fit in enumerate(fits) if names[:k].count(names[k]) < _FORMS]


def _behind(fit: Fitted, nothing: float) -> str:
    share = 1.0 - fit.misfit / nothing
    what = f"takes away {share:.0%} of the misfit" if share > 0 else "makes nothing better"
    return f"{what} where others do more"


def scored(bench: Bench, models: Sequence[Model], knobs: int) -> float:
    """Return a model's log likelihood of fitting and judging data, less the knobs that it adds.

    Parameters
    ----------
    bench : Bench
    models : sequence of Model
        One a view.
    knobs : int
    """
    return models[BOTH].log_likelihood(bench.observed[BOTH]) - knobs


def likely_of_finalists(candidates: Sequence[Candidate]) -> int:
    """Return about how many simulations it takes to find the finalists."""
    probes = 2 * sum(len(one.probes) for one in candidates)
    steps = 2 * sum(2 + len(one.knobs) for one in candidates)
    return probes + steps + steps // 2 + _FINALISTS * (3 * 4 + SOME)
