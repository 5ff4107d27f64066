"""What statistics owe to the interpolation: found from frames left out, taken off, and doubted."""

import numpy as np
import pytest
from made_up.cameras import Apart, Recorded
from made_up.streams import wandering_light

from adv2e import load_config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.summary import BOTH, SummaryStatistics
from adv2e.diagnosis.statistics.uncertainty import (
    PILOT_SEEDS,
    Pilot,
    between_frames,
    every,
    of_blended,
)
from adv2e.events import empty_events

DECLARED = load_config([], ["frames.encoding=linear"])


@pytest.mark.parametrize(
    ("more", "share"), [(1.0, 1.0), (1.5, 0.67), (2.0, 0.4), (5.0, 0.2), (50.0, 0.2)]
)
def test_less_is_uncertain_where_blended_frames_resolve_the_motion(more, share):
    """Fewer frames change more then: the error goes with the square of the time between them."""
    change = np.random.default_rng(1).normal(size=(4, 50))
    assert of_blended(more * change, change) == pytest.approx(share, abs=0.01)


def test_what_nothing_changes_is_hardly_uncertain():
    nothing = np.zeros((4, 50))
    assert of_blended(nothing, nothing) == of_blended(nothing + 1.0, nothing) == 0.2


def evidence_of(light, times):
    return Evidence("made up", list(light), times, Stream.of(empty_events(), 16, 12), 16, 12)


@pytest.mark.thorough
def test_simulations_without_the_bias_are_nearer_to_a_camera(tmp_path):
    """The camera sees the scene itself, whose edges move a pixel between two of its frames."""
    recorded = Recorded(tmp_path, 3, duration_s=0.6, fps=200.0)
    declared, scene, evidence = recorded.declared, recorded.scene, recorded.evidence
    simulator = Simulator(evidence, 2)
    streams = {seed: simulator.stream(declared, seed) for seed in range(24)}
    statistics = SummaryStatistics(scene, list(streams.values()))
    error = between_frames(Pilot(evidence, declared, statistics, streams, simulator))
    simulator.close()
    sample = np.array([statistics.measure(stream) for stream in streams.values()])[:, BOTH]
    apart = Apart.of(recorded.measured(statistics), sample, error, statistics.least)
    before, after = apart.squares()
    assert before > 0.5
    assert after < 0.75 * before
    # the doubt covers what is left
    assert np.mean(np.abs(apart.corrected) < 2.0 * apart.doubt) > 0.9


def test_too_few_frames_tell_nothing():
    evidence = evidence_of(wandering_light(frames=7), 0.01 * np.arange(7))
    nothing_to_simulate = None
    assert between_frames(Pilot(evidence, DECLARED, None, {}, nothing_to_simulate)) is None


@pytest.mark.thorough
def test_frames_that_are_left_out_were_read_out_all_the_same():
    """Of a scene at rest nothing hangs on what is between the frames, leaps at each or not."""
    light = np.repeat(wandering_light(frames=1).astype(np.float32), 41, axis=0)
    evidence = evidence_of(light, 0.02 * np.arange(41))
    scene = Scene.of(light, evidence.times_s, 0.0)
    coupling = "readout.frame_coupling={amplitude: 0.45, tau_us: 5000, width_us: 1000}"
    sets = ["sampling.L=1", "pixel.initial_reference=random", coupling]
    declared = load_config(["ideal"], ["frames.encoding=linear", *sets])
    simulator = Simulator(evidence, 2)
    streams = simulator.streams(declared, PILOT_SEEDS)
    assert np.mean([len(stream) for stream in streams]) > 1000
    by_seed = dict(zip(PILOT_SEEDS, streams, strict=True))
    pilot = Pilot(evidence, declared, SummaryStatistics(scene, streams), by_seed, simulator)
    error = between_frames(pilot)
    simulator.close()
    assert not np.any(error.bias)
    assert pilot.undisturbed.declared.readout.frame_coupling is None


@pytest.mark.parametrize(("frames", "kept"), [(9, 5), (10, 6), (3, 2)])
def test_the_last_frame_is_kept(frames, kept):
    light = wandering_light(frames=frames)
    fewer = every(evidence_of(light, 0.01 * np.arange(frames)), 2)
    assert len(fewer.frames) == len(fewer.times_s) == kept
    assert fewer.times_s[-1] == pytest.approx(0.01 * (frames - 1))
    np.testing.assert_array_equal(fewer.frames[-1], light[-1])
