"""From where a search ended to what is reported of it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Placed
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fit import Fitted
from adv2e.diagnosis.fitting.simulations import Simulator
from adv2e.diagnosis.hints.readouts import without_coupling
from adv2e.diagnosis.outcome.error import Distances, error_rows, of_interpolation, of_part
from adv2e.diagnosis.outcome.picture import Gallery
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.prepare import Ready
from adv2e.diagnosis.selection.reference import State
from adv2e.diagnosis.selection.search import Outcome, Search
from adv2e.diagnosis.statistics import BOTH
from adv2e.diagnosis.statistics.interpolation import every
from adv2e.reports.result import ErrorRow, Finding, Rejected, Signature, Verdict

Array = NDArray[np.float64]

DRAWS = 12
"""Simulations of each model that the errors are made of."""

_FIRST_DRAW = 20_000


@dataclass(frozen=True)
class Conclusion:
    """What is said of a recording.

    Attributes
    ----------
    verdict : str
    kept : State
        The model that is reported: the declared one where nothing is named.
    errors : list of ErrorRow
        Of the declared model, and of the one that is reported.
    gallery : Gallery
        Pictures of both.
    """

    verdict: Verdict
    kept: State
    errors: list[ErrorRow]
    gallery: Gallery


def conclude(ready: Ready, search: Search, outcome: Outcome) -> Conclusion:
    """Look at the last part of the data, and decide."""
    scene, simulator = ready.laboratory.scene, ready.laboratory.simulator

    def last(placed: Placed) -> Stream:
        return of_part(placed.stream, scene.parts, parts.LAST)

    measured = last(ready.measured)

    def drawn(config: Config, of: Simulator = simulator, first: int = _FIRST_DRAW) -> list[Placed]:
        def draw(seed: int) -> Placed:
            return Placed.of(of.stream(config, seed), scene)

        return of.map(draw, range(first, first + DRAWS))

    kept, declared = outcome.state, search.declared
    before = after = drawn(declared.config)
    of_before = of_after = Distances.of(measured, list(map(last, before)))
    if kept is not declared:
        after = drawn(kept.config)
        of_after = Distances.of(measured, list(map(last, after)))
    rows, interpolated = error_rows(of_before, of_after), 0.0
    if kept is not declared and ready.between_frames is not None:
        bare, whole, of_whole = without_coupling(kept.config), list(map(last, after)), of_after
        if bare != kept.config:
            whole = list(map(last, drawn(bare)))
            of_whole = Distances.of(measured, whole)
        with closing(simulator.of(every(ready.evidence, 2))) as fewer:
            half = list(map(last, drawn(bare, fewer, _FIRST_DRAW + DRAWS)))
        floor = float(of_whole.between.mean())
        interpolated = of_interpolation(measured, whole, half, floor)
    verdict = verdict_of(outcome, rows[0], interpolated)
    if verdict in ("consistent", "unexplained") and kept is not declared:
        kept, after = declared, before
        rows = error_rows(of_before, of_before)
    return Conclusion(verdict, kept, rows, Gallery(scene, ready.measured, before, after))


def finding_of(fit: Fitted, pixels: int, config: Config) -> Finding:
    """Return an effect that was added, with 95 % intervals of what was fitted.

    Parameters
    ----------
    fit : Fitted
    pixels : int
        Of the recording: of a share of them, no more can be known than so many draws tell.
    config : Config
        The model, which tells what was set besides.
    """
    parameters = fit.candidate.told(config, fit.place)
    interval: dict[str, Any] = {}
    spread: Any = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)) if fit.covariance.size else []
    for knob, place, sd in zip(fit.candidate.knobs, fit.place, spread, strict=False):
        # on its logarithmic scale
        counted = (knob.outer(place) * pixels) ** -0.5 if knob.of_pixels else 0.0
        reach = 1.96 * max(sd, counted)
        low, high = knob.outer(place - reach), knob.outer(place + reach)
        if knob.part is None:
            interval[knob.key] = low, high
        else:  # parts of a list come in their order
            below, above = interval.get(knob.key, ((), ()))
            interval[knob.key] = (*below, low), (*above, high)
    return Finding(fit.candidate.name, parameters, interval)


def rejected_of(outcome: Outcome, kept: State, candidates: Sequence[Candidate]) -> list[Rejected]:
    """Return the effects that were not added, in the library's order."""
    names = list(dict.fromkeys(candidate.name for candidate in candidates))
    held = dict(outcome.rejected)
    if outcome.state is not kept:
        why = "explains a part, but too much is left to name it"
        if outcome.complete:
            why = "would account for every statistic, but not for where and when events come"
        for fit in outcome.state.fits:
            held[fit.candidate.name] = Rejected(
                fit.candidate.name,
                why,
                fit.candidate.told(outcome.state.config, fit.place),
            )
    return [held[name] for name in names if name in held and name not in kept.names]


def signatures_of(ready: Ready, search: Search, kept: State) -> list[Signature]:
    """Return every statistic of the last part: as measured, before and after."""
    observed, markers = ready.observed, ready.laboratory.markers
    view = parts.LAST
    before, after = search.declared.models[view], kept.models[view]
    scale = search.bench.scales[view]
    z_before, z_after = before.z(observed[view]), after.z(observed[view])

    means = scale.values_of(before.mean), scale.values_of(after.mean)
    return [
        Signature(
            entry.name,
            title,
            entry.meaning,
            entry.plain(float(observed[view][k])),
            entry.plain(float(means[0][k])),
            entry.plain(float(means[1][k])),
            float(z_before[k]),
            float(z_after[k]),
        )
        for k, (entry, title) in enumerate(zip(markers.entries, markers.titles, strict=True))
    ]


def about_frames(ready: Ready, search: Search) -> list[str]:
    """Say how uncertain statistics are for what the frames do not tell."""
    chance = ready.error.chance(search.bench.scales[BOTH].sd, BOTH)
    notes = []
    if ready.between_frames is None:
        notes.append(
            "too few frames to leave any out: what the interpolation between them does to the"
            " residual is not known, and may be all of it"
        )
    else:
        doubt = ready.between_frames.doubt(chance, BOTH)
        made_up = "what interpolation makes up between the frames"
        text = _uncertain(made_up, doubt, "frames left out")
        unresolved = ": the frames hardly resolve the motion" if doubt > 1.0 else ""
        notes.append(text + unresolved)
    if ready.between_levels is not None:
        doubt = ready.between_levels.doubt(chance, BOTH)
        untold = "what frames do not tell between the levels of their numbers"
        notes.append(_uncertain(untold, doubt, "frames of coarser levels"))
    return notes


def about_drifts(evidence: Evidence, model: Config) -> list[str]:
    """Say from when on drifts of a model count, where that is not when the recording begins."""
    drifting = {
        "clock_drift_ppm": model.frames.clock_drift_ppm,
        "drift_per_s": model.pixel.thresholds.drift_per_s,
    }
    names = " and ".join(name for name, value in drifting.items() if value)
    if not names or not evidence.run_in.frames:
        return []
    start_s = evidence.simulated.times_s[0]
    return [f"in model.yaml {names} counts from the first frame simulated, at {start_s:.3f} s"]


def _uncertain(what: str, doubt: float, told_by: str) -> str:
    return (
        f"{what} leaves statistics uncertain by {doubt:.2g} times what chance does (root mean"
        f" square), as simulations with {told_by} tell"
    )
