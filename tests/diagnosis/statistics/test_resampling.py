"""What statistics owe to shifting frames by parts of a pixel: moved there and back, they tell."""

import numpy as np
import pytest
from made_up.cameras import Apart, Recorded

from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.summary import BOTH, Sampler, SummaryStatistics
from adv2e.diagnosis.statistics.uncertainty import Resampling

SHIFT = [0.4, 0.25]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Recordings with shifted frames, and a sampler for them."""
    hidden = {"frames": {"shift_px": SHIFT}}
    folder = tmp_path_factory.mktemp("shifted")
    made = Recorded(folder, 4, hidden=hidden, duration_s=0.5, fps=400.0)
    simulator = Simulator(made.evidence, 2)
    pilot = simulator.streams(made.declared, range(101, 117))
    made.sampler = Sampler(simulator, SummaryStatistics(made.scene, pilot))
    yield made
    simulator.close()


def shifted(recorded, *shift):
    return with_keys(recorded.declared, {"frames.shift_px": list(shift)})


@pytest.mark.thorough
def test_simulations_without_the_bias_are_nearer_to_a_camera(recorded):
    """The camera's event pixels see the scene where they are."""
    config = shifted(recorded, *SHIFT)
    sample = recorded.sampler.sample(config, range(16))[:, BOTH]
    error = Resampling(recorded.sampler, recorded.declared).error(config)
    statistics = recorded.sampler.statistics
    apart = Apart.of(recorded.measured(statistics), sample, error, statistics.least)
    before, after = apart.squares()
    assert before > 1.0
    assert after < 0.7 * before
    assert np.mean(np.abs(apart.plain) < 2.0 * apart.chance) < 0.7
    assert np.mean(np.abs(apart.corrected) < 2.0 * apart.doubt) > 0.8


def test_whole_pixels_are_shifted_without_error(recorded):
    resampling = Resampling(recorded.sampler, recorded.declared)
    for shift in ((0.0, 0.0), (1.0, -2.0), (0.01, 0.99)):
        assert resampling.error(shifted(recorded, *shift)) is None


@pytest.mark.thorough
def test_shifts_that_hardly_differ_have_the_same_error(recorded):
    resampling = Resampling(recorded.sampler, recorded.declared)
    one = resampling.error(shifted(recorded, 0.3, 0.0))
    assert resampling.error(shifted(recorded, 0.31, -0.01)) is one
    other = resampling.error(shifted(recorded, 0.5, 0.0))
    assert np.abs(other.bias).sum() > np.abs(one.bias).sum() > 0.0


@pytest.mark.thorough
def test_a_declared_shift_is_not_moved_there_and_back(recorded):
    """What it takes from the frames is the same wherever they are."""
    moved = shifted(recorded, *SHIFT)
    here, there = (Resampling(recorded.sampler, one) for one in (recorded.declared, moved))
    np.testing.assert_array_equal(here.error(moved).bias, there.error(moved).bias)
