"""Attribution: which effects, added to the declared model, make it agree with the recording.

Forward: every effect of the library is fitted on one part of the data, the best are simulated many
times, and the best of those is added if it holds on another part.  Where none holds alone, two
strong effects may hide one another: a second is looked for on top of the best, on trial, and the
likeliest pairs are fitted together.
That goes on until chance can make what is left, or nothing holds.  What is small beside an effect
may be due to its fit: another is added for it only if it explains most of it.  Then backward: what
is no longer needed is dropped.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis import parts
from adv2e.diagnosis.bench import MANY, Bench, State, parted
from adv2e.diagnosis.candidates import FITTED, Candidate, Knob
from adv2e.diagnosis.finalists import Trial, finalists, likely_simulations, scored
from adv2e.diagnosis.frame_error import FrameError
from adv2e.diagnosis.judging import BORDER, BY_CHANCE, objections
from adv2e.diagnosis.markers import BOTH
from adv2e.diagnosis.pairs import likely_pairs
from adv2e.diagnosis.simulations import Laboratory
from adv2e.reports.result import Rejected

Array = NDArray[np.float64]

LEVEL = 0.01
"""Probability below which chance is not believed to make a residual."""

PER_LOOK = LEVEL / 2.0
"""The same of each look: at the data for fitting and judging, and at those looked at last."""

MOST_EFFECTS = 4
_LEAST_OF_THE_LEFT = 0.5 / MOST_EFFECTS
"""Least share of what is left that an effect must take away for the search to go on."""
_OF_FITS = 1e-6
"""Probability of what is left below which it is looked into, though it may be the fit's."""
_MOST_OF_THE_FIT = 0.5
"""Least share of that which an effect must take away."""

_TRIED = 4
_CATCHES_UP = 60.0  # log likelihood that a fit may gain when it is brought to its end
_CLOSE = 5.0  # log likelihood; simulations are too few for less to be known


@dataclass(frozen=True)
class Outcome:
    """Where the search ended.

    Attributes
    ----------
    state : State
    probability, last : float
        Of the residual left, where the search looked, and in the data looked at last.
    explained : float
        Share of the declared model's residual that is gone.
    complete : bool
        Nothing is left for another effect, in either: chance can make it, or it is put down to the
        fit.
    rejected : dict
        Last reason for each effect that was not added.
    """

    state: State
    probability: float
    last: float
    explained: float
    complete: bool
    rejected: dict[str, Rejected]

    @property
    def alternatives(self) -> list[str]:
        """Effects that cannot be told from one of those that were added."""
        alike = frozenset().union(*self.state.alternatives.values())
        return sorted(alike - set(self.state.names))


@dataclass(frozen=True)
class _Attempt:
    """A model with one effect more, fitted to its end, and what speaks against it."""

    state: State
    objections: list[str]


def _put_down_to_the_fit(state: State) -> float:
    """Return the share of the residual that is put down to the fit of a model's effects."""
    return max((fit.candidate.left for fit in state.fits), default=0.0)


class Search:
    """Looks for effects that a declared model lacks.

    Parameters
    ----------
    laboratory : Laboratory
    observed : (views, statistics)
        Of the recording.
    declared : Config
    candidates : sequence of Candidate
    error : FrameError, optional
        Of the statistics.
    log : callable
        Told of each step.
    free : tuple of Knob
        Keys that are not known: fitted with all effects, and no effect themselves.

    Attributes
    ----------
    candidates : list of Candidate
        Those that compete.
    """

    def __init__(
        self,
        laboratory: Laboratory,
        observed: Array,
        declared: Config,
        candidates: Sequence[Candidate],
        error: FrameError | None = None,
        log: Callable[[str], None] = lambda text: None,
        free: tuple[Knob, ...] = (),
    ) -> None:
        unknown = {knob.key for knob in free}
        self.candidates = [
            one for one in candidates if not unknown & {knob.key for knob in one.knobs}
        ]
        self._simulator = laboratory.simulator
        self._simulator.likely = self._simulator.done + 2 * MANY
        self.bench = Bench.of(laboratory, observed, declared, error, log, free)
        self.declared = self.bench.state(declared, ())

    def probability(self, state: State, view: int = BOTH) -> float:
        """Return how often chance makes a residual as large as the recording's."""
        return state.models[view].probability(self.bench.observed[view])

    def explained(self, state: State, view: int = BOTH) -> float:
        """Return the share of the declared model's residual that is gone."""
        before = self.bench.misfit(self.declared, view)
        after, floor = self.bench.misfit(state, view), state.models[view].floor
        return float((before - after) / max(before - floor, 1e-9))

    def run(self) -> Outcome:
        """Search forward and backward."""
        state = self.declared
        self.bench.log(f"declared model: probability of the residual {self.probability(state):.2g}")
        while self._is_open(state) and len(state.fits) < MOST_EFFECTS:
            grown = self._grown(state)
            if grown is None or not self._is_worth_it(state, grown):
                break
            state = grown
            self.bench.log(
                f"added {', '.join(state.names)}: probability {self.probability(state):.2g}"
            )
        state = self._backward(state)
        held = self.bench.rejections.held
        rejected = {name: why for name, why in held.items() if name not in state.names}
        return Outcome(
            state,
            self.probability(state),
            self.probability(state, parts.LAST),
            self.explained(state),
            not any(self._is_something_left(state, view) for view in (BOTH, parts.LAST)),
            rejected,
        )

    def _is_something_left(self, state: State, view: int = BOTH) -> bool:
        if self.probability(state, view) >= PER_LOOK:
            return False
        return self.explained(state, view) < 1.0 - _put_down_to_the_fit(state)

    def _is_open(self, state: State) -> bool:
        """Tell whether another effect is looked for.

        What is small beside an effect may be its fit's, or another effect, which chance makes far
        less often.  Of an effect that cannot be undone in full it is the former all the same.
        """
        if self._is_something_left(state):
            return True
        undone = _put_down_to_the_fit(state) <= FITTED
        return undone and self.probability(state) < _OF_FITS

    def _is_worth_it(self, state: State, grown: State) -> bool:
        """Tell whether an addition that holds takes away enough of what is left.

        Of what may be the fit's, it must be most.  Of more, the few effects that may be added must
        be able to explain it with others as large: it is no patch then.  Single statistics that
        stand out, and the last to be found, have no share to speak of.
        """
        model = state.models[BOTH]
        before, after = self.bench.misfit(state), self.bench.misfit(grown)
        if self._is_something_left(state):
            least = _LEAST_OF_THE_LEFT
            if before < model.limits(PER_LOOK)[0] or not self._is_something_left(grown):
                return True
        else:
            least = _MOST_OF_THE_FIT
        share = (before - after) / (before - model.floor)
        if share >= least:
            return True
        added = " and ".join(fit.candidate.name for fit in grown.beyond(state))
        self.bench.log(f"  {added} takes away {share:.0%} of what is left: too little")
        why = f"takes away no more than {max(share, 0.0):.0%} of what is left"
        for fit in grown.beyond(state):
            self.bench.rejections.add(fit, why, final=True)
        return False

    def _grown(self, state: State) -> State | None:
        """Return the model with one effect more, or two that hold only together.

        Where one holds but another that does not explains far more, the one is no name for what is
        missing: it stands in for a part of the other.
        """
        trials = self._trials(state)
        attempts = self._attempts(state, trials, [state])
        # with one of two effects, something still stands out; but the one gains, and is physical
        physical = [one for one in attempts if not {BORDER, BY_CHANCE} & set(one.objections)]
        most = max(map(self._judged, physical), default=-np.inf)
        holding = [self._judged(one) for one in physical if not one.objections]
        if holding and max(holding) > most - _CATCHES_UP:
            return self._best(attempts, state)
        grown = None
        if len(state.fits) + 2 <= MOST_EFFECTS:
            grown = self._best(self._attempts_of_two(state, trials, physical), state)
        if grown is None and holding:
            first = max(physical, key=self._judged)
            why = f"holds, but {first.state.names[-1]}, which does not, explains far more"
            for one in physical:
                if not one.objections:
                    self.bench.rejections.add(one.state.fits[-1], why, final=True)
        return grown

    def _attempts_of_two(
        self, state: State, trials: Sequence[Trial], physical: Sequence[_Attempt]
    ) -> list[_Attempt]:
        """Return models with two effects more, of which none need hold alone.

        Others on top of the best that is physical, and the likeliest pairs.
        """
        made: list[_Attempt] = []
        if physical:
            first = max(physical, key=self._judged).state
            self.bench.log(f"on trial: {', '.join(first.names)}")
            made += self._attempts(first, self._trials(first), [first, state])
        had = {frozenset(one.state.names) for one in made}
        for pair in likely_pairs(self.bench, state, trials):
            if frozenset((*state.names, *(one.name for one in pair))) not in had:
                made.append(self._attempt(state, pair, [state]))
        return made

    def _judged(self, attempt: _Attempt) -> float:
        """Return the log likelihood of the data that the attempt was not fitted to."""
        return self.bench.likelihood(attempt.state, parts.JUDGE)

    def _trials(self, state: State) -> list[Trial]:
        """Return the best form of each of the best effects on top of a model, the best first."""
        self._simulator.likely = self._simulator.done + likely_simulations(self.candidates)
        best: dict[str, Trial] = {}
        for trial in finalists(self.bench, state, self.candidates):
            best.setdefault(trial.name, trial)
        return list(best.values())

    def _attempts(
        self, state: State, trials: Sequence[Trial], grounds: Sequence[State]
    ) -> list[_Attempt]:
        """Return models with one effect more, judged against all `grounds`.

        Fits are brought to their end on the data for fitting and judged on other data.  Before its
        fit has ended, an effect may be behind another for that alone: all that are close are tried.
        Others are, one after another, where none of these holds.
        """
        made: list[_Attempt] = []
        for trial in trials[:_TRIED]:
            close = trial.score > trials[0].score - _CATCHES_UP
            if not close and any(not one.objections for one in made):
                break
            made.append(self._attempt(state, [trial], grounds))
        return made

    def _attempt(self, state: State, added: Sequence[Trial], grounds: Sequence[State]) -> _Attempt:
        """Return the model with effects more, fitted to its end and judged."""
        bench = self.bench
        together = (*state.fits, *(trial.fit for trial in added))
        joint = bench.fitted(together, added[0].models[parts.FIT].sd, parts.FIT)
        fits = parted(joint, together)
        grown = State(joint.config, fits, bench.tried(joint.config))
        against: list[str] = []
        for ground in grounds:
            against = objections(joint, grown, ground, bench)
            if against:
                break
        new = grown.beyond(state)
        told = [f"{fit.candidate.name} {fit.candidate.parameters(fit.place)}" for fit in new]
        bench.log(f"  {' and '.join(told)}: {'; '.join(against) or 'holds'}")
        if against and len(new) == 1:  # of two, nobody knows which it is
            bench.rejections.add(new[0], "; ".join(against), final=True)
        return _Attempt(grown, against)

    def _best(self, attempts: Sequence[_Attempt], state: State) -> State | None:
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
        knobs = [sum(len(fit.candidate.knobs) for fit in one.beyond(state)) for one in holding]
        scores = [
            scored(self.bench, one.models, free) for one, free in zip(holding, knobs, strict=True)
        ]
        best = max(scores)
        chosen = holding[scores.index(best)]
        alike: set[str] = set()
        for one, score in zip(holding, scores, strict=True):
            self.bench.log(f"  {' and '.join(one.names)}, on more data: score {score:.0f}")
            why = "others explain more"
            others = [fit for fit in one.fits if fit.candidate.name not in chosen.names]
            if score > best - _CLOSE:
                alike.update(fit.candidate.name for fit in others)
                why = f"does as well as {chosen.names[-1]}, and cannot be told from it"
            for fit in others:
                self.bench.rejections.add(fit, why, final=True)
        if not alike:
            return dataclasses.replace(chosen, alternatives=state.alternatives)
        alternatives = {**state.alternatives, chosen.names[-1]: frozenset(alike)}
        return dataclasses.replace(chosen, alternatives=alternatives)

    def _backward(self, state: State) -> State:
        """Drop effects without which the others, fitted again, do as well, one after another."""
        for fit in state.fits[:-1]:
            rest = tuple(other for other in state.fits if other is not fit)
            without = self.bench.settled(rest, state.models[BOTH].sd)
            loss = self.bench.likelihood(state) - self.bench.likelihood(without)
            if loss < _CLOSE:
                self.bench.log(f"dropped {fit.candidate.name}: the others do without it")
                self.bench.rejections.add(fit, "not needed beside the others", final=True)
                alike = {n: a for n, a in state.alternatives.items() if n in without.names}
                return self._backward(dataclasses.replace(without, alternatives=alike))
        return state
