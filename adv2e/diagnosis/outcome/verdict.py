"""Verdict on a recording from the end of a search, and its wording."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass

from adv2e.config import Config
from adv2e.diagnosis.configurations import without_coupling
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import Placed
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.outcome.error import Errors, error_rows, of_interpolation
from adv2e.diagnosis.outcome.picture import curves_of, maps_of, snapshot_of, totals_of
from adv2e.diagnosis.prepare import Prepared
from adv2e.diagnosis.selection.reference import State
from adv2e.diagnosis.selection.search import PER_LOOK, Outcome, Search
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.uncertainty import every
from adv2e.effects import label_of
from adv2e.reports.result import Curve, ErrorRow, ResidualMap, Snapshot, Total, Verdict

_PARTLY = 0.8
"""Share of the residual that effects must explain to be named when something is left."""

_ERROR_PARTLY, _ERROR_EXPLAINED = 0.9, 0.75
"""The same of what the error can fall by, on the test data, when something is left, and when all
statistics are explained."""

_MOST = 0.5
"""Both shares of effects that are certain, as the events themselves show when they act: in bursts
of all pixels, at each frame or with a period of their own.  No other effect makes those."""


def verdict_of(outcome: Outcome, error: ErrorRow, interpolated: float = 0.0) -> Verdict:
    """Return the verdict.

    By the error of the declared model and of that where the search ended, and what interpolation
    between the frames adds to it, in squares.
    """
    if not outcome.state.fits:
        return "consistent" if outcome.complete else "unexplained"
    gone, at_most = _gone(error, interpolated)
    if not outcome.complete:
        certain = all(fit.candidate.is_seen for fit in outcome.state.fits)
        least = (_MOST, _MOST) if certain else (_PARTLY, _ERROR_PARTLY)
        partly = outcome.explained >= least[0] and gone >= least[1] and not _too_near(error)
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

    Then a simulation makes by chance what a cause makes in the recording.
    """
    after, floor = error.after.interval, error.floor.interval
    return after is not None and floor is not None and after[1] < floor[0]


def remark_of(verdict: Verdict, outcome: Outcome) -> str:
    """Return the remark that goes with a verdict, besides the effects and their values.

    It ends in the consequence for the user of the recording.
    """
    if verdict == "consistent":
        return "The recording is what the declared model makes: keep that model as it is."
    only_test = outcome.probability >= PER_LOOK
    where = " in the test data" * only_test
    share = f"{outcome.explained:.0%} of the difference"
    if verdict == "unexplained" and only_test and not outcome.state.fits:
        return (
            "Nothing is missing in the data for training and validation, but in the test data"
            f" something is: chance makes such a difference {outcome.test_probability:.0e} times."
            " Look at what differs before you use this model."
        )
    if verdict == "unexplained" and not outcome.state.fits:
        return (
            "Every effect that was tried leaves too much, or makes something else wrong: what is"
            " missing is not in the library."
        )
    if verdict == "unexplained":
        best = " and ".join(map(label_of, outcome.state.names))
        if outcome.complete:
            near = f"The nearest is {best}: numbers of events are then right, their times are not."
        else:
            near = f"The nearest is {best}: it would explain {share}, too little to be named."
        return f"{near} Do not add it."
    if verdict == "partly_explained":
        left = f"something is left{where}"
        return f"This explains {share}; {left}: use the model found, but know what still differs."
    if verdict == "not_identifiable":
        return (
            "These data cannot tell these effects apart: either model makes these events, and only"
            " another recording tells which is right."
        )
    if min(outcome.probability, outcome.test_probability) < PER_LOOK:
        return (
            f"This explains {outcome.explained:.1%} of the difference; the rest may be due to its"
            " fit: use the model found."
        )
    return "With this change nothing is left that these data show: use the model found."


# ---- Verdict on the outcome of a search, by the test data, which are used only here.


DRAWS = 12
"""Simulations of each model that the errors are made of."""

_FIRST_DRAW = 20_000


@dataclass(frozen=True)
class Conclusion:
    """Verdict on a recording, with errors and pictures of the declared model and of `kept`.

    `kept` is the model that is reported: the declared one where no effect is named.
    """

    verdict: Verdict
    kept: State
    errors: list[ErrorRow]
    curves: list[Curve]
    maps: list[ResidualMap]
    totals: list[Total]
    snapshot: Snapshot


def conclude(prepared: Prepared, search: Search, outcome: Outcome) -> Conclusion:
    """Look at the test data, and decide."""
    scene, simulator = prepared.scene, prepared.reference.sampler.simulator
    simulator.begin("judging on data not used so far")

    def test(stream: Stream) -> Stream:
        return scene.split.chosen(stream, splits.TEST)

    def drawn(config: Config, of: Simulator = simulator, first: int = _FIRST_DRAW) -> list[Stream]:
        return of.streams(config, range(first, first + DRAWS))

    measured = test(prepared.evidence.stream)

    def distances(streams: list[Stream]) -> Errors:
        return Errors.of(measured, list(map(test, streams)))

    kept, declared = outcome.state, search.declared
    before = after = drawn(declared.config)
    of_before = of_after = distances(before)
    interpolated = 0.0
    if kept is not declared:
        after = drawn(kept.config)
        of_after = distances(after)
        if prepared.between_frames is not None:
            bare, whole, of_whole = without_coupling(kept.config), after, of_after
            if bare != kept.config:
                whole = drawn(bare)
                of_whole = distances(whole)
            with closing(simulator.of(every(prepared.evidence, 2))) as fewer:
                half = drawn(bare, fewer, _FIRST_DRAW + DRAWS)
            interpolated = of_interpolation(
                measured,
                list(map(test, whole)),
                list(map(test, half)),
                float(of_whole.between.mean()),
            )
    rows = error_rows(of_before, of_after)
    verdict = verdict_of(outcome, rows[0], interpolated)
    if verdict in ("consistent", "unexplained") and kept is not declared:
        kept, after = declared, before
        rows = error_rows(of_before, of_before)
    recorded = Placed.of(prepared.evidence.stream, scene)
    first, second = (
        [Placed.of(stream, scene) for stream in streams] for streams in (before, after)
    )
    seen = scene, recorded, first, second
    return Conclusion(
        verdict, kept, rows, curves_of(*seen), maps_of(*seen), totals_of(*seen), snapshot_of(*seen)
    )
