"""What statistics owe to the interpolation: found from frames left out, taken off, and doubted."""

import numpy as np
import pytest
from made_up_streams import wandering_light
from three_cameras import Apart, Recorded

from adv2e import load_config
from adv2e.diagnosis.evidence import Evidence
from adv2e.diagnosis.interpolation import InterpolationError, every, interpolation_error
from adv2e.diagnosis.markers import BOTH, Markers
from adv2e.diagnosis.scene import Scene
from adv2e.diagnosis.simulations import Simulator
from adv2e.diagnosis.stream import Stream
from adv2e.events import empty_events

DECLARED = load_config([], ["frames.encoding=linear"])


def repeated(value, noise=0.0, seed=0):
    """Return simulations, (8, 4, 6), of statistics that are all `value` but for noise."""
    return value + noise * np.random.default_rng(seed).normal(size=(8, 4, 6))


def test_a_third_of_the_change_is_the_error():
    error = InterpolationError.of(repeated(10.0 + 1.0), repeated(10.0 + 4.0), repeated(10.0 + 16.0))
    np.testing.assert_allclose(error.bias, 1.0)
    np.testing.assert_allclose(error.sd, 15.0 / 12.0)
    error = InterpolationError.of(repeated(11.0), repeated(14.0), repeated(14.0))
    np.testing.assert_allclose(error.sd, 1.0)
    without_quarter = InterpolationError.of(repeated(11.0), repeated(14.0), None)
    np.testing.assert_allclose(without_quarter.bias, 1.0)
    np.testing.assert_allclose(without_quarter.sd, 1.5)


def test_chance_is_no_change():
    found = InterpolationError.of(
        repeated(5.0, 1.0, 1), repeated(5.0, 1.0, 2), repeated(5.0, 1.0, 3)
    )
    assert np.median(np.abs(found.bias)) == 0.0
    larger = InterpolationError.of(repeated(5.0, 1.0, 1), repeated(25.0, 1.0, 2), None)
    np.testing.assert_allclose(larger.bias, 20.0 / 3.0, atol=0.7)


def test_what_is_uncertain_spreads_simulations_and_moves_none():
    error = InterpolationError(np.zeros((4, 6)), np.tile([0.0, 0.0, 1.0, 1.0, 3.0, 3.0], (4, 1)))
    sample = np.random.default_rng(1).normal(size=(400, 6))
    spread = error.blurred(sample, 2, 1)
    np.testing.assert_allclose(spread.mean(axis=0), sample.mean(axis=0), atol=1e-12)
    np.testing.assert_array_equal(spread[:, :2], sample[:, :2])
    np.testing.assert_allclose(spread.std(axis=0)[2:], np.sqrt([2, 2, 10, 10]), rtol=0.15)
    np.testing.assert_array_equal(spread, error.blurred(sample, 2, 1))
    for view, stream in ((1, 1), (2, 2)):
        assert not np.array_equal(spread, error.blurred(sample, view, stream))


def evidence_of(light, times):
    return Evidence("made up", list(light), times, Stream.of(empty_events(), 16, 12), 16, 12)


def test_simulations_without_the_bias_are_nearer_to_a_camera(tmp_path):
    """The camera sees the scene itself, whose edges move a pixel between two of its frames."""
    recorded = Recorded(tmp_path, 3, duration_s=0.6, fps=200.0)
    declared, scene, evidence = recorded.declared, recorded.scene, recorded.evidence
    simulator = Simulator(evidence, 2)
    streams = {seed: simulator.stream(declared, seed) for seed in range(24)}
    placed = [recorded.placed(stream) for stream in streams.values()]
    markers = Markers(scene, placed)
    error = interpolation_error(
        evidence, declared, scene, markers, streams, lambda fewer: Simulator(fewer, 2)
    )
    simulator.close()
    sample = np.array([markers.measure(one)[BOTH] for one in placed])
    apart = Apart.of(recorded.measured(markers), sample, error, markers.least)
    before, after = apart.squares()
    assert before > 0.5
    assert after < 0.75 * before
    # the doubt covers what is left
    assert np.mean(np.abs(apart.corrected) < 2.0 * apart.doubt) > 0.9


def test_too_few_frames_tell_nothing():
    light = wandering_light(frames=7)
    evidence = evidence_of(light, 0.01 * np.arange(7))
    scene = Scene.of(light, evidence.times_s, 0.0)

    def none(fewer):
        raise AssertionError("nothing to simulate")

    assert interpolation_error(evidence, DECLARED, scene, None, {}, none) is None


@pytest.mark.parametrize(("frames", "kept"), [(9, 5), (10, 6), (3, 2)])
def test_the_last_frame_is_kept(frames, kept):
    light = wandering_light(frames=frames)
    fewer = every(evidence_of(light, 0.01 * np.arange(frames)), 2)
    assert len(fewer.frames) == len(fewer.times_s) == kept
    assert fewer.times_s[-1] == pytest.approx(0.01 * (frames - 1))
    np.testing.assert_array_equal(fewer.frames[-1], light[-1])
