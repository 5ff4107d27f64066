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


GROUPS = ["a", "a", "a", "b", "b", "b"]
LEAST = np.full(6, 1.0)


def changed(by):
    """Return simulations of which the first statistic has changed by so many deviations."""
    sample = repeated(10.0)
    sample[:, :, 0] += by
    return sample


def test_a_quarter_of_the_change_is_taken_off():
    error = InterpolationError.of(repeated(10.0), changed(0.4), None, GROUPS, LEAST)
    np.testing.assert_allclose(error.bias[:, 0], 0.1, rtol=0.01)
    np.testing.assert_array_equal(error.bias[:, 1:], 0.0)
    # of the change and of what is usual in its group, of three of which one changes
    usual = 0.4 / np.sqrt(3.0)
    share = 0.7 / np.sqrt(2.0)
    np.testing.assert_allclose(error.sd[:, 0], share * np.hypot(0.4, usual), rtol=0.01)
    np.testing.assert_allclose(error.sd[:, 1:3], share * usual, rtol=0.01)
    np.testing.assert_array_equal(error.sd[:, 3:], 0.0)


def test_less_is_uncertain_where_blended_frames_resolve_the_motion():
    """Fewer frames change more then: the error goes with the square of the time between them."""
    doubts = [
        InterpolationError.of(repeated(10.0), changed(0.4), changed(0.4 * more), GROUPS, LEAST)
        for more in (1.0, 2.0, 5.0, 50.0)
    ]
    along_flow = InterpolationError.of(repeated(10.0), changed(0.4), None, GROUPS, LEAST)
    shares = [one.sd[0, 0] / along_flow.sd[0, 0] * 0.7 for one in doubts]
    assert shares == pytest.approx([1.0, 0.41, 0.2, 0.2], rel=0.1)
    for one in doubts:
        np.testing.assert_array_equal(one.bias, along_flow.bias)


def test_what_nothing_changes_is_certain():
    same = repeated(10.0)
    error = InterpolationError.of(same, same, same, GROUPS, LEAST)
    np.testing.assert_array_equal(error.sd, 0.0)


def test_the_error_grows_with_the_unit_of_a_statistic():
    one, ten = (
        InterpolationError.of(
            unit * repeated(5.0, 1.0),
            unit * (2.0 + repeated(5.0, 1.0)),
            unit * (6.0 + repeated(5.0, 1.0)),
            GROUPS,
            0.01 * LEAST,
        )
        for unit in (1.0, 10.0)
    )
    np.testing.assert_allclose(ten.bias, 10.0 * one.bias)
    np.testing.assert_allclose(ten.sd, 10.0 * one.sd)


def test_of_far_more_than_chance_less_is_taken_off():
    """What is that large says that the motion is not resolved, and little of the error."""
    error = InterpolationError.of(repeated(0.0), repeated(100.0), None, GROUPS, LEAST)
    assert np.all((error.bias > 2.0) & (error.bias < 10.0))
    # as large as the change but for what is taken off, less so than in proportion
    assert np.all((error.sd > 10.0) & (error.sd < 90.0))


def test_chance_is_no_change():
    found = InterpolationError.of(repeated(5.0, 1.0, 1), repeated(5.0, 1.0, 2), None, GROUPS, LEAST)
    assert np.median(np.abs(found.bias)) == 0.0
    assert np.median(found.sd) < 0.2


def test_what_is_uncertain_spreads_simulations_and_moves_none():
    error = InterpolationError(np.zeros((4, 6)), np.tile([0.0, 0.0, 1.0, 1.0, 3.0, 3.0], (4, 1)))
    sample = np.random.default_rng(1).normal(size=(400, 6))
    spread = error.blurred(sample, 2, 1)
    np.testing.assert_allclose(spread.mean(axis=0), sample.mean(axis=0), atol=1e-12)
    np.testing.assert_array_equal(spread[:, :2], sample[:, :2])
    np.testing.assert_allclose(spread.std(axis=0)[2:], np.sqrt([2, 2, 10, 10]), rtol=0.2)
    # far more often far off than normal numbers, and some simulations more than others
    apart = (spread - sample)[:, 2:] / error.sd[2, 2:]
    assert np.mean(apart**4) > 6.0
    each = np.log(np.mean(apart**2, axis=1))
    shuffled = np.random.default_rng(2).permuted(apart, axis=0)
    assert each.std() > 1.1 * np.log(np.mean(shuffled**2, axis=1)).std()
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
