"""What the end of a search says of the recording: the verdict, and a sentence for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from adv2e.config import Config, to_dict
from adv2e.config.paths import get_key
from adv2e.diagnosis.fitting.candidates import Candidate, neutral_value
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.hints.readouts import DRIFT
from adv2e.diagnosis.selection.reference import State
from adv2e.diagnosis.selection.search import PER_LOOK, Outcome
from adv2e.reports.result import ErrorRow, Verdict

_PARTLY = 0.8
"""Share of the residual that effects must explain to be named when something is left."""

_ERROR_PARTLY, _ERROR_EXPLAINED = 0.9, 0.75
"""The same of what the error can fall by, on the test data, when something is left, and when all
statistics are explained."""


def verdict_of(outcome: Outcome, error: ErrorRow, interpolated: float = 0.0) -> Verdict:
    """Return the verdict.

    By the error of the declared model and of that where the search ended, and what interpolation
    between the frames adds to it, in squares.
    """
    if not outcome.state.fits:
        return "consistent" if outcome.complete else "unexplained"
    gone, at_most = _gone(error, interpolated)
    if not outcome.complete:
        partly = outcome.explained >= _PARTLY and gone >= _ERROR_PARTLY and not _too_near(error)
        return "partly_explained" if partly else "unexplained"
    if at_most < _ERROR_EXPLAINED:
        return "unexplained"
    return "not_identifiable" if outcome.alternatives else "explained"


def _gone(error: ErrorRow, interpolated: float) -> tuple[float, float]:
    """Return by how much of what it can the error fell, and by how much at most (97.5 %).

    One where the error tells nothing of the effect.  Statistics fall for any effect that does some
    of what is missing; events come where they are measured only for those that do it where and when
    it happens.
    """
    before, after, floor = error.before, error.after, error.floor
    if before.interval is None or floor.interval is None or after.interval is None:
        return 1.0, 1.0
    if not before.interval[0] > math.hypot(floor.interval[1], 2.0 * interpolated):
        return 1.0, 1.0  # nor where there is none
    # no model with these frames comes nearer; how far they leave it is known to a factor of two
    nearest, at_least = (math.hypot(floor.value, k * interpolated) for k in (1.0, 2.0))
    gone = (before.value - after.value) / (before.value - nearest)
    return gone, (before.value - after.interval[0]) / (before.value - at_least)


def _too_near(error: ErrorRow) -> bool:
    """Tell whether simulations are farther from one another than from the recording.

    They do by chance what happens there for a reason.
    """
    after, floor = error.after.interval, error.floor.interval
    return after is not None and floor is not None and after[1] < floor[0]


def sentence_of(verdict: Verdict, kept: State, outcome: Outcome, declared: Config) -> str:
    """Return the verdict on the model that is reported, the declared one if none, in a sentence."""
    if verdict == "consistent":
        return (
            "The recording is what the declared model makes: nothing is missing that can be seen."
        )
    only_test = outcome.probability >= PER_LOOK
    if verdict == "unexplained" and only_test and not outcome.state.fits:
        return (
            "Nothing is missing in the data for training and validation, but in the test data"
            f" something is, which chance makes {outcome.test_probability:.0e} times."
        )
    if verdict == "unexplained" and outcome.complete:
        return (
            "Something is missing in the declared model that no effect known explains:"
            f" {' and '.join(outcome.state.names)} would account for every statistic, but not for"
            " where and when events come."
        )
    if verdict == "unexplained":
        best = " and ".join(outcome.state.names)
        most = f" (at most {outcome.explained:.0%} of it: {best})" if best else ""
        return f"Something is missing in the declared model that no effect known explains{most}."
    wrong = f"The declared model {_wrong(kept.fits, declared)}"
    if verdict == "partly_explained":
        return (
            f"{wrong}; that explains {outcome.explained:.0%} of the"
            f" residual, and something is left{' in the test data' * only_test}."
        )
    if verdict == "not_identifiable":
        others = ", ".join(outcome.alternatives)
        return f"{wrong}, or as well {others}."
    if min(outcome.probability, outcome.test_probability) < PER_LOOK:
        share = f"{outcome.explained:.1%}"
        return f"{wrong}; that explains {share} of the residual."
    return f"{wrong}; with what was fitted, nothing is left that can be seen."


def _wrong(fits: Sequence[Fitted], declared: Config) -> str:
    """Return what the declared model lacks, and what it has, but otherwise."""
    told = []
    for there, what in ((False, "lacks"), (True, "is wrong in")):
        names = [fit.candidate.name for fit in fits if _has(declared, fit.candidate) is there]
        if names:
            told.append(f"{what} {' and '.join(names)}")
    return " and ".join(told)


def _has(declared: Config, candidate: Candidate) -> bool:
    """Tell whether a configuration has an effect already, of whatever size."""
    values = (neutral_value(declared, parameter) for parameter in candidate.parameters)
    held = to_dict(declared)
    # how fast the clock of the frames is, a pulse tells besides
    besides = (key for key, _ in candidate.extra if key != DRIFT)
    others = (get_key(held, key) for key in besides)
    return any(value != 0.0 and math.isfinite(value) for value in values) or any(
        value is not None and value != 0.0 for value in others
    )
