"""What statistics owe to shifting frames by parts of a pixel: moved there and back, they tell."""

import numpy as np
import pytest
from camera import SCENES, Camera

from adv2e import load_config
from adv2e.diagnosis.evidence import read_evidence
from adv2e.diagnosis.keys import with_keys
from adv2e.diagnosis.light import light_of
from adv2e.diagnosis.markers import BOTH, Markers
from adv2e.diagnosis.resampling import Resampling
from adv2e.diagnosis.scene import Placed, Scene
from adv2e.diagnosis.simulations import Laboratory, Simulator

SHIFT = [0.4, 0.25]


class Recorded:
    """Recordings of a scene by three cameras whose frames are shifted."""

    def __init__(self, folder):
        paths = [folder / f"{seed}.zip" for seed in range(3)]
        for seed, path in enumerate(paths):
            scene = SCENES["patchwork"]((32, 24), seed=4)
            hidden = {"frames": {"shift_px": SHIFT}}
            Camera(
                scene, hidden=hidden, size=(32, 24), duration_s=0.5, fps=400.0, seed=seed
            ).record(path)
        self.declared = load_config([folder / "0.declared.yaml"])
        evidence, *_ = recordings = [read_evidence(path) for path in paths]
        scene = Scene.of(light_of(evidence, self.declared), evidence.times_s, 0.0)
        self.simulator = Simulator(evidence, 2)
        pilot = [self.simulator.stream(self.declared, seed) for seed in range(101, 117)]
        markers = Markers(scene, [Placed.of(stream, scene) for stream in pilot])
        self.laboratory = Laboratory(self.simulator, scene, markers)
        self.measured = np.array([markers.measure(Placed.of(r.stream, scene)) for r in recordings])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    made = Recorded(tmp_path_factory.mktemp("shifted"))
    yield made
    made.simulator.close()


def shifted(recorded, *shift):
    return with_keys(recorded.declared, {"frames.shift_px": list(shift)})


def test_simulations_without_the_bias_are_nearer_to_a_camera(recorded):
    """The camera's event pixels see the scene where they are."""
    config = shifted(recorded, *SHIFT)
    sample = recorded.laboratory.ensemble(config, range(16))[:, BOTH]
    error = Resampling(recorded.laboratory, recorded.declared).error(config)
    sd = np.maximum(sample.std(axis=0), recorded.laboratory.markers.least)
    apart = (recorded.measured[:, BOTH].mean(axis=0) - sample.mean(axis=0)) / sd
    apart, bias = np.clip(apart, -20.0, 20.0), error.bias[BOTH] / sd
    chance = np.sqrt(1.0 / 3.0 + 1.0 / 16.0)
    before, after = (np.mean(one**2) - chance**2 for one in (apart, apart + bias))
    assert before > 1.0
    assert after < 0.7 * before
    doubt = np.hypot(chance, error.sd[BOTH] / sd)
    assert np.mean(np.abs(apart) < 2.0 * chance) < 0.7
    assert np.mean(np.abs(apart + bias) < 2.0 * doubt) > 0.8


def test_whole_pixels_are_shifted_without_error(recorded):
    resampling = Resampling(recorded.laboratory, recorded.declared)
    for shift in ((0.0, 0.0), (1.0, -2.0), (0.01, 0.99)):
        assert resampling.error(shifted(recorded, *shift)) is None


def test_shifts_that_hardly_differ_have_the_same_error(recorded):
    resampling = Resampling(recorded.laboratory, recorded.declared)
    one = resampling.error(shifted(recorded, 0.3, 0.0))
    assert resampling.error(shifted(recorded, 0.31, -0.01)) is one
    other = resampling.error(shifted(recorded, 0.5, 0.0))
    assert np.abs(other.bias).sum() > np.abs(one.bias).sum() > 0.0


def test_a_declared_shift_is_not_moved_there_and_back(recorded):
    """What it takes from the frames is the same wherever they are."""
    moved = shifted(recorded, *SHIFT)
    here, there = (Resampling(recorded.laboratory, one) for one in (recorded.declared, moved))
    np.testing.assert_array_equal(here.error(moved).bias, there.error(moved).bias)
