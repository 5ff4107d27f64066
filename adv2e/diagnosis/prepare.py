"""A recording made ready for the search: its scene and statistics, and the effects that compete."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.input_checks import doubts_of
from adv2e.diagnosis.data.light import light_of, scene_of
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.candidates import Candidate, Knob
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.fitting.nuisances import THRESHOLDS, TOLERANCE, fit_thresholds, thresholds_of
from adv2e.diagnosis.fitting.simulations import Laboratory, Simulator
from adv2e.diagnosis.hints.collect import hints_of
from adv2e.diagnosis.hints.lamps import Lamp, lamps_of
from adv2e.diagnosis.hints.lines import strongest_lines
from adv2e.diagnosis.hints.pulses import has_pulse
from adv2e.diagnosis.outcome.error import of_part
from adv2e.diagnosis.statistics.frame_error import FrameError
from adv2e.diagnosis.statistics.interpolation import between_frames
from adv2e.diagnosis.statistics.levels import between_levels
from adv2e.diagnosis.statistics.pilot import Pilot

_MATCHING_SEED = 9_999
_LAMP_SEED = 9_998


@dataclass(frozen=True)
class Ready:
    """What a search begins with.

    Attributes
    ----------
    evidence : Evidence
    declared : Config
        With thresholds that match the totals, where they were not known.
    laboratory : Laboratory
    between_frames, between_levels : FrameError, optional
        Of the statistics; None: too few frames to tell, and levels too fine to matter.
    measured : Placed
        The recording's events.
    observed : (views, statistics)
    candidates : list of Candidate
    free : tuple of Knob
        Keys that are not known.
    """

    evidence: Evidence
    declared: Config
    laboratory: Laboratory
    between_frames: FrameError | None
    between_levels: FrameError | None
    measured: Placed
    observed: NDArray[np.float64]
    candidates: list[Candidate]
    free: tuple[Knob, ...]

    @property
    def error(self) -> FrameError:
        """What the frames do not tell in all."""
        none = FrameError.none(self.observed.shape)
        return (self.between_frames or none) + (self.between_levels or none)


def make_ready(
    evidence: Evidence,
    declared: Config,
    simulator: Simulator,
    without: Sequence[str],
    free_thresholds: bool,
    log: Callable[[str], None],
) -> Ready:
    """Simulate the declared model, so that the recording can be compared with it.

    Parameters
    ----------
    evidence : Evidence
    declared : Config
    simulator : Simulator
        Of the recording.
    without : sequence of str
        Effects that do not compete.
    free_thresholds : bool
        Whether thresholds are not known.
    log : callable
        Takes lines for people.
    """
    scene = scene_of(evidence, declared)
    measured = Placed.of(evidence.stream, scene)
    doubts = doubts_of(measured, scene, light_of(evidence, declared))
    evidence = replace(evidence, notes=[*evidence.notes, *doubts])
    if free_thresholds:
        declared, miss = _with_fitted_thresholds(evidence, declared, simulator, scene)
        log(f"thresholds that match the totals: {thresholds_of(declared)}")
        if miss > TOLERANCE:
            missed = f"no thresholds match the totals of ON and OFF events: off by {miss:.0%}"
            evidence = replace(evidence, notes=[*evidence.notes, missed])
    pilot = Pilot.of(evidence, declared, scene, simulator)
    frames, levels = between_frames(pilot), between_levels(pilot)
    laboratory = Laboratory(simulator, scene, pilot.markers, frames.bias if frames else None)
    lamps = _lamps(pilot, simulator)
    looked_at = of_part(evidence.stream, scene.parts, parts.FIT, parts.JUDGE)
    hints = hints_of(evidence, looked_at, lamps, list(pilot.streams.values()))
    if hints.pulse and not has_pulse(declared):
        evidence = replace(evidence, notes=[*evidence.notes, hints.pulse.text()])
    return Ready(
        evidence,
        declared,
        laboratory,
        frames,
        levels,
        measured,
        pilot.markers.measure(measured),
        [one for one in library(declared, hints) if one.name not in without],
        THRESHOLDS if free_thresholds else (),
    )


def _lamps(pilot: Pilot, simulator: Simulator) -> list[Lamp]:
    """Return the lamps that may have lit the scene, by the data that effects are fitted to."""
    scene, declared = pilot.scene, pilot.declared

    def to_fit(stream: Stream) -> Stream:
        return of_part(stream, scene.parts, parts.FIT)

    measured = to_fit(pilot.evidence.stream)
    lines = strongest_lines(measured, list(map(to_fit, pilot.streams.values())), scene)
    return lamps_of(
        lines, measured, declared, lambda lit: to_fit(simulator.stream(lit, _LAMP_SEED))
    )


def _with_fitted_thresholds(
    evidence: Evidence, declared: Config, simulator: Simulator, scene: Scene
) -> tuple[Config, float]:
    def counts(stream: Stream) -> tuple[int, int]:
        fitted_to = of_part(stream, scene.parts, parts.FIT)
        on = int(np.count_nonzero(fitted_to.on))
        return on, len(fitted_to) - on

    return fit_thresholds(
        lambda config: counts(simulator.stream(config, _MATCHING_SEED)),
        declared,
        counts(evidence.stream),
    )
