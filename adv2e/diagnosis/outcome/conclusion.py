"""Verdict on the outcome of a search, by the test data, which are used only here."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

from adv2e.config import Config
from adv2e.diagnosis.configurations import without_coupling
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import Placed
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.outcome.error import Errors, error_rows, of_interpolation
from adv2e.diagnosis.outcome.picture import curves_of, maps_of, snapshot_of, totals_of
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.prepare import Prepared
from adv2e.diagnosis.selection.reference import State
from adv2e.diagnosis.selection.search import Outcome, Search
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.uncertainty import every
from adv2e.reports.result import Curve, ErrorRow, ResidualMap, Snapshot, Total, Verdict

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
