"""A recording made ready for the search: its scene and statistics, and the effects that compete."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.input_checks import check_inputs, check_known_light
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.fitting.candidates import NOTHING, Candidate
from adv2e.diagnosis.fitting.fitter import (
    TOLERANCE,
    fit_thresholds,
    threshold_nuisance,
    thresholds_of,
)
from adv2e.diagnosis.fitting.library import library, of_known_light
from adv2e.diagnosis.hints.collect import hints_of, train_and_validation_events
from adv2e.diagnosis.hints.own_period import own_period_of
from adv2e.diagnosis.hints.readouts import has_pulse
from adv2e.diagnosis.selection.reference import Reference
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.rates import since_burst
from adv2e.diagnosis.statistics.summary import Sampler, SummaryStatistics
from adv2e.diagnosis.statistics.uncertainty import (
    PILOT_SEEDS,
    FrameError,
    Pilot,
    between_frames,
    between_levels,
)

DECLARED = "simulating the declared model"
"""The first stage."""

_MATCHING_SEED = 9_999


@dataclass(frozen=True)
class Prepared:
    """Inputs of a search: recording, scene, declared model, candidates.

    Attributes
    ----------
    reference : Reference
        Of the declared model, with thresholds that match the totals where they were not known.
    between_frames, between_levels : FrameError, optional
        Of the statistics; None: too few frames to tell, and levels too fine to matter.
    """

    evidence: Evidence
    scene: Scene
    reference: Reference
    candidates: list[Candidate]
    between_frames: FrameError | None
    between_levels: FrameError | None


def prepare(
    evidence: Evidence,
    declared: Config,
    simulator: Simulator,
    without: Sequence[str],
    free_thresholds: bool,
    log: Callable[[str], None],
    tell: Callable[[Evidence, Config, Scene, Sequence[Stream]], None] = lambda *_: None,
) -> Prepared:
    """Simulate the declared model, so that the recording can be compared with it.

    Parameters as of :func:`adv2e.diagnosis.diagnose.diagnose`; the `simulator` is of the recording.
    `tell` is called when thresholds match, and when the declared model was simulated.
    """
    scene = Scene.of_evidence(evidence, declared)
    notes = [*evidence.notes]
    known = evidence.stimulus is not None
    check = check_known_light if known else check_inputs
    notes += check(Placed.of(evidence.stream, scene), scene, evidence.light(declared))
    if free_thresholds:
        simulator.begin("matching the thresholds to the numbers of events")

        def counts(stream: Stream) -> tuple[int, int]:
            train = scene.split.chosen(stream, splits.TRAIN)
            on = int(np.count_nonzero(train.on))
            return on, len(train) - on

        declared, miss = fit_thresholds(
            lambda config: counts(simulator.stream(config, _MATCHING_SEED)),
            declared,
            counts(evidence.stream),
        )
        log(f"thresholds that match the totals: {thresholds_of(declared)}")
        if miss > TOLERANCE:
            notes.append(
                f"no thresholds match the totals of ON and OFF events: off by {miss:.0%}, so"
                " something else than the thresholds makes too many or too few"
            )
        tell(replace(evidence, notes=[*notes]), declared, scene, [])
        simulator.begin(DECLARED)
    streams = simulator.streams(declared, PILOT_SEEDS)
    tell(replace(evidence, notes=[*notes]), declared, scene, streams)
    own_period = (
        None
        if known
        else own_period_of(train_and_validation_events(evidence, scene), evidence.times_s)
    )
    bursts = [since_burst(own_period.period_us, own_period.first.begins_us)] if own_period else []
    statistics = SummaryStatistics(scene, streams, bursts)
    by_seed = dict(zip(PILOT_SEEDS, streams, strict=True))
    pilot = Pilot(evidence, declared, statistics, by_seed, simulator)
    frames, levels = (None, None) if known else (between_frames(pilot), between_levels(pilot))
    hints = hints_of(evidence, declared, scene, streams, simulator, own_period)
    if hints.pulse and not has_pulse(declared):
        notes.append(hints.pulse.text())
    if own_period is not None:
        notes.append(own_period.text())
    observed = statistics.measure(evidence.stream)
    none = FrameError.none(observed.shape)
    reference = Reference(
        Sampler(simulator, statistics, frames.bias if frames else 0.0),
        observed,
        declared,
        (frames or none) + (levels or none),
        log,
        threshold_nuisance(declared) if free_thresholds else NOTHING,
        simulator.begin,
    )
    every = of_known_light(declared, hints) if known else library(declared, hints)
    candidates = [one for one in every if one.name not in without]
    evidence = replace(evidence, notes=notes)
    return Prepared(evidence, scene, reference, candidates, frames, levels)
