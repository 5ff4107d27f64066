"""Models with effects more, fitted to their end and judged on data that they were not fitted to."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fit import Fitted
from adv2e.diagnosis.hints.readouts import EXPOSURE
from adv2e.diagnosis.selection.acceptance import BORDER, BY_CHANCE, objections
from adv2e.diagnosis.selection.ranking import ranked
from adv2e.diagnosis.selection.reference import MANY, SOME, Bench, State, likely_of_a_fit, parted
from adv2e.diagnosis.selection.shortlist import Trial, finalists, likely_of_finalists
from adv2e.diagnosis.statistics import BOTH

_TRIED, _LIKELY_TRIED = 4, 2
CATCHES_UP = 60.0
"""Log likelihood that a fit may gain when it is brought to its end."""


@dataclass(frozen=True)
class Attempt:
    """A model with effects more, fitted to its end, and what speaks against it.

    Attributes
    ----------
    state : State
    objections : list of str
        None: it holds.
    judged : float
        Log likelihood of the data that it was not fitted to.
    """

    state: State
    objections: list[str]
    judged: float

    @property
    def physical(self) -> bool:
        """It gains, within the range of what is physical, though something may stand out."""
        return not {BORDER, BY_CHANCE} & set(self.objections)


def knobs_of(fits: Sequence[Fitted]) -> int:
    """Return the number of knobs that fits have together."""
    return sum(len(fit.candidate.knobs) for fit in fits)


def likely_of_a_round(candidates: Sequence[Candidate], fits: Sequence[Fitted]) -> int:
    """Return about how many simulations it takes to add an effect to others.

    Parameters
    ----------
    candidates : sequence of Candidate
        Those that compete.
    fits : sequence of Fitted
        Those of the model.
    """
    fit = likely_of_a_fit(knobs_of(fits) + 1)
    return likely_of_finalists(candidates) + _LIKELY_TRIED * (fit + SOME) + fit + MANY


def _exposed_as(trial: Trial, fit: Fitted) -> Fitted:
    """Return the fit of an exposure as a trial was tried with it, and any other as it is.

    It is held near that: where it ends elsewhere, there is nothing that would tell it so.
    """
    readouts, candidate = trial.fit.candidate.readouts, fit.candidate
    if readouts is None or [knob.key for knob in candidate.knobs] != [EXPOSURE]:
        return fit
    exposure_us = trial.fit.base.frames.exposure_us
    place = np.array(candidate.inner([exposure_us]))
    if np.allclose(place, fit.place, rtol=1e-9):
        return fit
    known = ((float(place[0]), readouts.exposure_sd_us / exposure_us),)
    return dataclasses.replace(
        fit, candidate=dataclasses.replace(candidate, known=known), place=place
    )


@dataclass(frozen=True)
class Attempts:
    """Tries effects on top of models.

    Attributes
    ----------
    bench : Bench
    candidates : list of Candidate
        Those that compete.
    """

    bench: Bench
    candidates: list[Candidate]

    def trials(self, state: State, besides: Sequence[str] = ()) -> list[Trial]:
        """Return the best form of each of the best effects on top of a model, the best first.

        Parameters
        ----------
        state : State
        besides : sequence of str
            Effects that are not tried, beside those that it has.
        """
        self.bench.laboratory.simulator.expect(likely_of_a_round(self.candidates, state.fits))
        best: dict[str, Trial] = {}
        competing = [one for one in self.candidates if one.name not in besides]
        for trial in finalists(self.bench, state, competing):
            best.setdefault(trial.name, trial)
        return list(best.values())

    def of_one(
        self, state: State, trials: Sequence[Trial], grounds: Sequence[State]
    ) -> list[Attempt]:
        """Return models with one effect more, judged against all `grounds`.

        Fits are brought to their end on the data for fitting and judged on other data.  Before its
        fit has ended, an effect may be behind another for that alone: all that are close are tried.
        Others are, one after another, where none of these holds.
        """
        made: list[Attempt] = []
        for trial in trials[:_TRIED]:
            close = trial.score > trials[0].score - CATCHES_UP
            if not close and any(not one.objections for one in made):
                break
            made.append(self.of(state, [trial], grounds))
        return made

    def of(self, state: State, added: Sequence[Trial], grounds: Sequence[State]) -> Attempt:
        """Return the model with effects more, fitted to its end and judged."""
        bench = self.bench
        before = state.fits
        for trial in added:
            before = tuple(_exposed_as(trial, fit) for fit in before)
        together = (*before, *(trial.fit for trial in added))
        joint = bench.fitted(together, added[0].models[parts.FIT].sd, parts.FIT)
        fits = parted(joint, together)
        grown = State(joint.config, fits, bench.tried(joint.config))
        against: list[str] = []
        for ground in grounds:
            against = objections(joint, grown, ground, bench)
            if against:
                break
        new = grown.beyond(state)
        told = [
            f"{fit.candidate.name} {fit.candidate.told(joint.config, fit.place)}" for fit in new
        ]
        bench.log(f"  {' and '.join(told)}: {'; '.join(against) or 'holds'}")
        if against and len(new) == 1:  # of two, nobody knows which it is
            bench.rejections.add(new[0], "; ".join(against), final=True)
        return Attempt(grown, against, bench.likelihood(grown, parts.JUDGE))

    def best(self, attempts: Sequence[Attempt], state: State) -> State | None:
        """Return the best of the models that hold, fitted to all data but those looked at last.

        Effects of others that do as well are noted as alternatives.
        """
        holding = [
            self.bench.settled(one.state.fits, one.state.models[BOTH].sd)
            for one in attempts
            if not one.objections
        ]
        if not holding:
            return None
        ranking = ranked(self.bench, holding, [knobs_of(one.beyond(state)) for one in holding])
        chosen = holding[ranking.best]
        alike: set[str] = set()
        for k, one in enumerate(holding):
            self.bench.log(
                f"  {' and '.join(one.names)}, on more data: score {ranking.scores[k]:.0f}"
            )
            why = "others explain more"
            others = [fit for fit in one.fits if fit.candidate.name not in chosen.names]
            if k in ranking.alike:
                alike.update(fit.candidate.name for fit in others)
                why = f"does as well as {chosen.names[-1]}, and cannot be told from it"
            for fit in others:
                self.bench.rejections.add(fit, why, final=True)
        if not alike:
            return dataclasses.replace(chosen, alternatives=state.alternatives)
        alternatives = {**state.alternatives, chosen.names[-1]: frozenset(alike)}
        return dataclasses.replace(chosen, alternatives=alternatives)
