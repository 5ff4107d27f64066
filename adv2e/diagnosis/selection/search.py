"""Attribution: which effects, added to the declared model, make it agree with the recording.

Forward: every effect of the library is fitted on one part of the data, the best are simulated many
times, and the best of those is added if it holds on another part.  Where none holds alone, two
strong effects may hide one another: a second is looked for on top of the best, on trial, and the
likeliest pairs are fitted together.
That goes on until chance can make what is left, or nothing holds.  What is small beside an effect
may be due to its fit: another is added for it only if it explains most of it.  Then backward: what
is no longer needed is dropped.  Where something is left beside two effects, others are tried in the
place of the first, which was added while more was missing, before a third is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.selection.acceptance import BY_FRAMES, CLOSE, gain, gain_held_out, stands_out
from adv2e.diagnosis.selection.joint_fits import (
    JointFit,
    best_of,
    count_parameters,
    likely_pairs,
    with_more,
    with_one_more,
)
from adv2e.diagnosis.selection.reference import CATCHES_UP, Reference, State
from adv2e.diagnosis.selection.shortlist import Trial, best_forms, scored, shortlisted
from adv2e.diagnosis.statistics.summary import BOTH
from adv2e.reports.result import Rejected

LEVEL = 0.01
"""Probability below which chance is not believed to make a residual."""

PER_LOOK = LEVEL / 2.0
"""The same of each look: at the data for training and validation, and at the test data."""

_BEYOND_CHANCE = 1e-7
"""Probability, by the tail of a curve, below which nobody need count."""

MOST_EFFECTS = 4
_MOST_WITH_TWO = 3
"""Effects of a model to which two were added that hold only together: beside two others, they would
take as long to look for as all before."""
_LEAST_OF_THE_LEFT = 0.5 / MOST_EFFECTS
"""Least share of what is left that an effect must take away for the search to go on."""
_OF_FITS = 1e-6
"""Probability of what is left below which it is looked into, though it may be the fit's."""
_MUCH_DOUBT = 0.5
"""Uncertainty by frames from which on it hides effects, in deviations of chance."""
_MOST_OF_THE_FIT = 0.5
"""Least share of that which an effect must take away."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a search: the last model, its probability, and rejected effects."""

    state: State
    probability: float
    """Of the residual left, where the search looked."""
    test_probability: float
    """The same in the test data."""
    explained: float
    """Share of the declared model's residual that is gone."""
    complete: bool
    """Nothing is left for another effect, in either: chance can make it, or it is the fit's."""
    rejected: dict[str, Rejected]
    """Last reason for each effect that was not added."""

    @property
    def alternatives(self) -> list[str]:
        return self.state.rivals


class Search:
    """Looks for effects that a declared model lacks; keys not known are fitted with all.

    `changed` is told of the declared model, and of each that takes the place of the one before.
    """

    def __init__(
        self,
        reference: Reference,
        candidates: list[Candidate],
        changed: Callable[[Search, State], None] = lambda search, state: None,
    ) -> None:
        unknown = reference.nuisances.keys
        self.candidates = [one for one in candidates if not unknown & one.keys]
        self.reference, self._changed = reference, changed
        self.declared = reference.state(reference.declared)
        self._changed(self, self.declared)

    def probability(self, state: State, view: int = BOTH) -> float:
        """Return the probability of a residual as large as the recording's by chance."""
        return state.ensembles[view].probability(self.reference.observed[view])

    def judged(self, state: State, view: int) -> float:
        """Return the probability of the residual, to decide whether another effect is missing.

        Where it is so rare that the tail of a curve tells it, further simulations are counted.
        """
        found = self.probability(state, view)
        if not _BEYOND_CHANCE < found < PER_LOOK:
            return found
        further = self.reference.further(state.config)[view]
        counted = state.ensembles[view].rank(self.reference.observed[view], further)
        if counted >= PER_LOOK:
            told = f"probability {found:.2g} by a curve, but {counted:.2g} by counting"
            self.reference.log(f"  {told} {len(further):,} further simulations")
        return counted

    def overall(self, state: State) -> float:
        """Return the probability of the residual in all data: less than LEVEL, something is left.

        Of two looks, at the data for training and validation and at the test data, the smaller
        counts twice (Bonferroni).
        """
        return min(1.0, 2.0 * min(self.judged(state, view) for view in (BOTH, splits.TEST)))

    def explained(self, state: State, view: int = BOTH) -> float:
        """Return the share of the declared model's residual that is gone."""
        return self._taken_away(self.declared, state, state.ensembles[view].floor, view)

    def run(self) -> Outcome:
        chance = self.probability(self.declared)
        self.reference.log(f"declared model: probability of the residual {chance:.2g}")
        state = self._backward(self._forward(self.declared))
        if state is self.declared and not self._is_left(state):
            state = self._beneath_doubt()
        held = self.reference.rejections.held
        rejected = {name: why for name, why in held.items() if name not in state.names}
        return Outcome(
            state,
            self.probability(state),
            self.probability(state, splits.TEST),
            self.explained(state),
            not self._is_left(state),
            rejected,
        )

    def _is_left(self, state: State) -> bool:
        """Tell whether a residual is left for another effect, in either part of the data."""
        return any(self._is_something_left(state, view) for view in (BOTH, splits.TEST))

    def _beneath_doubt(self) -> State:
        """Return the declared model, or that with an effect that is likely beyond doubt.

        Where frames leave much uncertain, it may make all that is left.  How well one effect does
        what is left tells more than how much that is: in both parts of the data that it was not
        fitted to, that must be far more than what is made up between the frames could gain.
        """
        declared, reasons = self.declared, self.reference.rejections
        if self.reference.doubt < _MUCH_DOUBT:
            return declared
        self.reference.log("beneath what the frames leave uncertain:")
        likely = [trial for trial in self._trials(declared) if self._gains(trial)]
        made = with_one_more(self.reference, declared, likely, [declared])
        told = [
            one
            if stands_out(one.state, declared, self.reference, splits.VALIDATION)
            else dataclasses.replace(one, objections=[*one.objections, BY_FRAMES])
            for one in made
        ]
        found = best_of(self.reference, told, declared)
        if found is not None and stands_out(found, declared, self.reference, splits.TEST):
            return found
        reasons.held = {}  # none was needed
        return declared

    def _gains(self, trial: Trial) -> bool:
        """Tell whether a trial gains in log likelihood on the data for validation."""
        view, reference = splits.VALIDATION, self.reference
        before = reference.tried(self.declared.config, trial.fit.config)[view]
        after = reference.tried(trial.fit.config)[view]
        return gain(after, before, reference.observed[view]) > 0.0

    def _forward(self, state: State) -> State:
        """Return the model with effects more, until nothing is left or nothing holds.

        What explains more with as many effects goes before what does with one more.
        """
        while True:
            other = self._with_another(state) if self._may_be_wrong(state) else None
            if other is not None:
                state = other
                self._changed(self, state)
                continue
            if not self._is_open(state):
                break
            if len(state.fits) >= MOST_EFFECTS:
                left = f"something is left beside {MOST_EFFECTS} effects"
                self.reference.log(f"{left}: no more are tried")
                break
            grown = self._grown(state)
            if grown is None or not self._is_worth_it(state, grown):
                break
            state = grown
            probability = self.probability(state)
            self.reference.log(f"added {', '.join(state.names)}: probability {probability:.2g}")
            self._changed(self, state)
        return state

    def _is_something_left(self, state: State, view: int = BOTH) -> bool:
        if self.judged(state, view) >= PER_LOOK:
            return False
        return self.explained(state, view) < 1.0 - state.left

    def _is_open(self, state: State) -> bool:
        """Tell whether the search goes on for another effect.

        A small residual may be left by the fit of an effect, or by another effect; that one is far
        less likely by chance.  Where an effect cannot be undone in full, the residual is put down
        to its fit.
        """
        is_unlikely = state.is_undone and self.probability(state) < _OF_FITS
        return is_unlikely or self._is_something_left(state)

    def _may_be_wrong(self, state: State) -> bool:
        """Tell whether other effects are tried in place of the first of two.

        With more effects, each replacement takes as long as the search for a further effect.
        """
        if len(state.fits) != 2 or self.probability(state) >= PER_LOOK:
            return False
        return self._is_something_left(state) or state.is_undone

    def _is_worth_it(self, state: State, grown: State) -> bool:
        """Tell whether an accepted addition explains enough of the residual.

        Most of it, where the fit of another effect may have left it.  Otherwise a share at which
        as many effects as may be added explain half of it; but any share where only single
        statistics are off, or where nothing is left afterwards.
        """
        if self._is_something_left(state):
            least = _LEAST_OF_THE_LEFT
            stands_out = self.reference.misfit(state) < state.ensembles[BOTH].limits(PER_LOOK)[0]
            if stands_out or not self._is_something_left(grown):
                return True
        else:
            least = _MOST_OF_THE_FIT
        share = self._taken_away(state, grown)
        if share >= least:
            return True
        added = " and ".join(fit.candidate.name for fit in grown.beyond(state))
        self.reference.log(f"  {added} takes away {share:.0%} of what is left: too little")
        why = f"takes away no more than {max(share, 0.0):.0%} of what is left"
        for fit in grown.beyond(state):
            self.reference.rejections.add(fit, why, final=True)
        return False

    def _taken_away(
        self, state: State, other: State, floor: float | None = None, view: int = BOTH
    ) -> float:
        """Return the share of what a model leaves above a floor that another does not.

        The floor is the model's own unless it is given.  Below it, nothing is left to take away.
        """
        before, after = self.reference.misfit(state, view), self.reference.misfit(other, view)
        above = before - (state.ensembles[view].floor if floor is None else floor)
        return float((before - after) / above) if above > 0.0 else 0.0

    def _grown(self, state: State) -> State | None:
        """Return the model with one effect more, or two that hold only together.

        Where one holds but another that does not explains far more, the one is no name for what is
        missing: it stands in for a part of the other.
        """
        trials = self._trials(state)
        # with one of two effects, something still stands out; but the one gains, and is physical
        made = with_one_more(self.reference, state, trials, [state])
        physical = [one for one in made if one.physical]
        most = max((one.validated for one in physical), default=-np.inf)
        holding = [one for one in physical if not one.objections]
        if any(one.validated > most - CATCHES_UP for one in holding):
            return best_of(self.reference, made, state)
        grown = None
        if len(state.fits) + 2 <= _MOST_WITH_TWO:
            grown = best_of(self.reference, self._of_two(state, trials, physical), state)
        if grown is None and holding:
            first = max(physical, key=lambda one: one.validated)
            why = f"holds, but {first.state.names[-1]}, which does not, explains far more"
            for one in holding:
                self.reference.rejections.add(one.state.fits[-1], why, final=True)
        return grown

    def _trials(self, state: State, besides: Sequence[str] = ()) -> list[Trial]:
        """Return effects on top of a model, the best first, each in its best form.

        Those named `besides` are not tried, nor those that it has.
        """
        competing = [one for one in self.candidates if one.name not in besides]
        return best_forms(shortlisted(self.reference, state, competing))

    def _of_two(
        self, state: State, trials: Sequence[Trial], physical: Sequence[JointFit]
    ) -> list[JointFit]:
        """Return models with two effects more: others on top of the best, and the likeliest pairs.

        None need hold alone; the best is that of those which are physical.
        """
        made: list[JointFit] = []
        if physical:
            first = max(physical, key=lambda one: one.validated).state
            self.reference.log(f"on trial: {', '.join(first.names)}")
            made += with_one_more(self.reference, first, self._trials(first), [first, state])
        had = {frozenset(one.state.names) for one in made}
        for pair in likely_pairs(self.reference, state, trials):
            if frozenset((*state.names, *(one.name for one in pair))) not in had:
                made.append(with_more(self.reference, state, pair, [state]))
        return made

    def _backward(self, state: State) -> State:
        """Drop effects that do not earn their place, one after another."""
        if len(state.fits) < 2:
            return state
        for fit in state.fits:
            without = self._without(state, fit)
            why = self._why_spare(state, without)
            if why:
                self.reference.log(f"dropped {fit.candidate.name}: {why}")
                self.reference.rejections.add(fit, why, final=True)
                self._changed(self, without)
                return self._backward(without)
        return state

    def _why_spare(self, state: State, without: State) -> str:
        """Return the reason to drop an effect of `state`, or "".

        `without`: the model without it, the others fitted again.  The data for fitting do not
        decide: there, a model with more keys always fits better.
        """
        without = self.reference.compared(without, state)
        loss = self.reference.likelihood(state) - self.reference.likelihood(without)
        if loss < CLOSE:
            return "not needed beside the others"
        left = min(self.probability(without, view) for view in (BOTH, splits.TEST))
        held_out, by_chance = gain_held_out(state, without, self.reference)
        self.reference.log(
            f"  {', '.join(without.names)} alone: {loss:.0f} less likely, held-out data"
            f" {held_out:.0f} (chance makes {by_chance:.0f}), probability {left:.2g}"
        )
        if left >= PER_LOOK:
            return "without it, the others leave nothing that chance could not make"
        if held_out < by_chance:
            return "on data that nothing was fitted to, the others do as well without it"
        return ""

    def _with_another(self, state: State) -> State | None:
        """Return the model with another effect in the place of the one that was added first.

        That was chosen while others were missing, whose part it may have taken.  Another has to
        hold on top of the rest, and instead of the one.
        """
        reasons, first = self.reference.rejections, state.fits[0]
        held, name = dict(reasons.held), first.candidate.name
        rest = self._without(state, first)
        self.reference.log(f"in the place of {name}:")
        trials = self._trials(rest, besides=[name])
        other = best_of(
            self.reference, with_one_more(self.reference, rest, trials, [rest, state]), rest
        )
        if other is not None and self._is_better(other, state):
            reasons.add(first, f"does less than {other.names[-1]} in its place", final=True)
            self.reference.log(f"replaced {name} by {other.names[-1]}")
            return other
        reasons.held = held  # of what does not go on top of the model that is kept
        return None

    def _is_better(self, other: State, state: State) -> bool:
        """Tell whether the model `other` replaces `state`, which has as many effects.

        Where the fit of `state` may have left the residual, `other` must explain most of it.
        """
        better, worse = (
            scored(self.reference, one.ensembles, count_parameters(one.fits))
            for one in (other, state)
        )
        if better <= worse + CLOSE:
            return False
        most = self._taken_away(state, other) >= _MOST_OF_THE_FIT
        return most or self._is_something_left(state)

    def _without(self, state: State, fit: Fitted) -> State:
        self.reference.begin(f"searching: is {fit.candidate.name} needed")
        rest = tuple(other for other in state.fits if other is not fit)
        without = self.reference.settled(rest, state.ensembles[BOTH].sd)
        alike = {name: of for name, of in state.alternatives.items() if name in without.names}
        return dataclasses.replace(without, alternatives=alike)
