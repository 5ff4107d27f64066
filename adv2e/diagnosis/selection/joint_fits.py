"""Models with effects more, fitted to their end and validated on data not used for that."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.fitted import Fitted, parted
from adv2e.diagnosis.hints.readouts import EXPOSURE
from adv2e.diagnosis.selection.acceptance import BORDER, BY_CHANCE, objections, ranked
from adv2e.diagnosis.selection.reference import CATCHES_UP, Reference, State
from adv2e.diagnosis.selection.shortlist import Trial
from adv2e.diagnosis.statistics.summary import BOTH

Array = NDArray[np.float64]

_TRIED = 4
_PAIRS = 4
_MOST_LEFT = 0.5
"""Part of what the best effect alone would leave that two may, to be worth a fit."""
_FARTHEST = 3.0
"""Most by which what an effect changes is stretched, or it is not taken to go on in proportion."""


@dataclass(frozen=True)
class JointFit:
    """A model with effects more, fitted to its end, and what speaks against it; nothing: it holds.

    `validated`: log likelihood of the data that it was not fitted to.
    """

    state: State
    objections: list[str]
    validated: float

    @property
    def physical(self) -> bool:
        """It gains, within the range of what is physical, though something may stand out."""
        return not {BORDER, BY_CHANCE} & set(self.objections)


def count_parameters(fits: Sequence[Fitted]) -> int:
    return sum(len(fit.candidate.parameters) for fit in fits)


def _exposed_as(trial: Trial, fit: Fitted) -> Fitted:
    """Return the fit of an exposure as a trial was tried with it, and any other as it is.

    It is held near that: where it ends elsewhere, there is nothing that would tell it so.
    """
    readouts, candidate = trial.fit.candidate.readouts, fit.candidate
    if readouts is None or [one.key for one in candidate.parameters] != [EXPOSURE]:
        return fit
    exposure_us = trial.fit.base.frames.exposure_us
    point = np.array(candidate.scaled([exposure_us]))
    if np.allclose(point, fit.point, rtol=1e-9):
        return fit
    known = ((float(point[0]), readouts.exposure_sd_us / exposure_us),)
    return dataclasses.replace(
        fit, candidate=dataclasses.replace(candidate, known=known), point=point
    )


def with_one_more(
    reference: Reference, state: State, trials: Sequence[Trial], grounds: Sequence[State]
) -> list[JointFit]:
    """Return models with one effect more, validated against all `grounds`.

    Before its fit has ended, an effect may be behind another for that alone: all that are close
    are tried.  Others are, one after another, where none of these holds.
    """
    made: list[JointFit] = []
    for trial in trials[:_TRIED]:
        close = not trial.is_behind and trial.score > trials[0].score - CATCHES_UP
        if not close and any(not one.objections for one in made):
            break
        made.append(with_more(reference, state, [trial], grounds))
    return made


def with_more(
    reference: Reference, state: State, added: Sequence[Trial], grounds: Sequence[State]
) -> JointFit:
    """Return the model with effects more, fitted to its end and validated against all `grounds`."""
    reference.begin(f"searching: fitting {' and '.join(trial.name for trial in added)}")
    before = state.fits
    for trial in added:
        before = tuple(_exposed_as(trial, fit) for fit in before)
    together = (*before, *(trial.fit for trial in added))
    sd = reference.tried(added[0].fit.config)[splits.TRAIN].sd
    joint = reference.fitted(together, sd, splits.TRAIN)
    grown = State(joint.config, parted(joint, together), reference.tried(joint.config))
    each = (objections(joint, grown, ground, reference) for ground in grounds)
    against = next(filter(None, each), [])
    new = grown.beyond(state)
    told = [
        f"{fit.candidate.name} {fit.candidate.settings_in(joint.config, fit.point)}" for fit in new
    ]
    reference.log(f"  {' and '.join(told)}: {'; '.join(against) or 'holds'}")
    if against and len(new) == 1:  # of two, nobody knows which it is
        reference.rejections.add(new[0], "; ".join(against), final=True)
    return JointFit(grown, against, reference.likelihood(grown, splits.VALIDATION))


def best_of(reference: Reference, made: Sequence[JointFit], state: State) -> State | None:
    """Return the best of the models that hold, fitted to all data but those looked at once.

    Effects of others that do as well are noted as alternatives.
    """
    reference.begin("searching: comparing the best")
    holding = [
        reference.settled(one.state.fits, one.state.ensembles[BOTH].sd)
        for one in made
        if not one.objections
    ]
    if not holding:
        return None
    counts = [count_parameters(one.beyond(state)) for one in holding]
    ranking = ranked(reference, holding, counts)
    chosen = holding[ranking.best]
    alike: set[str] = set()
    for k, one in enumerate(holding):
        reference.log(f"  {' and '.join(one.names)}, on more data: score {ranking.scores[k]:.0f}")
        why = "others explain more"
        others = [fit for fit in one.fits if fit.candidate.name not in chosen.names]
        if k in ranking.alike:
            alike.update(fit.candidate.name for fit in others)
            why = f"does as well as {chosen.names[-1]}, and cannot be told from it"
        for fit in others:
            reference.rejections.add(fit, why, final=True)
    alternatives = dict(state.alternatives)
    if alike:
        alternatives[chosen.names[-1]] = frozenset(alike)
    return dataclasses.replace(chosen, alternatives=alternatives)


def likely_pairs(
    reference: Reference, state: State, trials: Sequence[Trial]
) -> list[tuple[Trial, Trial]]:
    """Return pairs of effects that together would leave the least, the best first.

    Each of two strong effects may leave so much of the other that its own fit goes astray, and
    nothing holds that could be built on.  As if each changed the statistics by itself, in
    proportion to its size, what it changes tells which two could explain most together.  Those that
    would not leave far less than the best effect alone are left out.  `trials`: effects alone on
    top of the model, each in one form.
    """
    ground, observed = state.ensembles[splits.TRAIN], reference.observed[splits.TRAIN]
    white = ground.scale.whitening / ground.sd
    missing = white @ (ground.scale.of_values(observed) - ground.mean)
    tried = [reference.tried(trial.fit.config)[splits.TRAIN] for trial in trials]
    changes = [white @ (one.mean - ground.mean) for one in tried]
    alone = min((_left(missing, [one]) for one in changes), default=0.0)
    found = []
    for a, b in combinations(range(len(trials)), 2):
        least = _left(missing, [changes[a], changes[b]])
        if least < _MOST_LEFT * alone:
            found.append((least, a, b))
    return [(trials[a], trials[b]) for _, a, b in sorted(found)[:_PAIRS]]


def _left(missing: Array, changes: Sequence[Array]) -> float:
    """Return the square of what is left when changes are stretched to fit what is missing.

    All of it where one would be turned round, or stretched too far.
    """
    columns = np.transpose(changes)
    stretch, *_ = np.linalg.lstsq(columns, missing, rcond=None)
    if stretch.min() < 0.0 or stretch.max() > _FARTHEST:
        return float(missing @ missing)
    rest = missing - columns @ stretch
    return float(rest @ rest)
