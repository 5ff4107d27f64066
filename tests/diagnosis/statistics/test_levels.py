"""What statistics owe to the levels of the frames' numbers."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from made_up.cameras import Recorded

from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.data.evidence import Evidence, RunIn
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.summary import BOTH, SummaryStatistics
from adv2e.diagnosis.statistics.uncertainty import Pilot, between_levels, coarser

SEEDS = range(16)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return Recorded(tmp_path_factory.mktemp("levels"), 5, duration_s=0.4, fps=250.0)


def of_8_bits(recorded):
    """Return the recording with frames of 8 bits, and its declared model."""
    frames = [np.rint(image / 257.0).astype(np.uint8) for image in recorded.evidence.frames]
    evidence = replace(recorded.evidence, frames=frames)
    return evidence, with_keys(recorded.declared, {"frames.full_scale": 255})


def streams_of(evidence, declared):
    with closing(Simulator(evidence, 2)) as simulator:
        return {seed: simulator.stream(declared, seed) for seed in SEEDS}


def pilot_of(evidence, declared):
    scene = Scene.of_evidence(evidence, declared)
    streams = streams_of(evidence, declared)
    statistics = SummaryStatistics(scene, list(streams.values()))
    return Pilot(evidence, declared, statistics, streams, Simulator(evidence, 2))


@pytest.mark.thorough
def test_the_doubt_covers_what_8_bits_change(recorded):
    """What they change is told by the same camera's frames of 16 bits, which see the same light."""
    pilot = pilot_of(*of_8_bits(recorded))
    fine = streams_of(recorded.evidence, recorded.declared)
    of_fine = replace(pilot, streams=fine).sample[:, BOTH]
    sample = pilot.sample[:, BOTH]
    deviation = np.maximum(sample.std(axis=0, ddof=1), pilot.statistics.least)
    off = (sample - of_fine) / deviation
    error = between_levels(pilot)
    np.testing.assert_array_equal(error.bias, 0.0)  # nothing is taken off
    doubt = error.sd[BOTH] / deviation
    apart = off.mean(axis=0)
    chance = np.maximum(off.std(axis=0, ddof=1) / np.sqrt(len(SEEDS)), 0.05)
    told = np.hypot(doubt, chance)
    assert np.mean(np.abs(apart) < 2.0 * chance) < 0.88  # some statistics do feel the steps
    assert np.mean(np.abs(apart) < 2.0 * told) > 0.92
    assert np.max(np.abs(apart) / told) < 0.5 * np.max(np.abs(apart) / chance)
    assert np.median(doubt) < 0.5


def test_fine_levels_tell_everything(recorded):
    nothing_to_simulate = None
    fine = Pilot(recorded.evidence, recorded.declared, None, {}, nothing_to_simulate)
    assert between_levels(fine) is None


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_third_level_is_left(dtype):
    largest = np.iinfo(dtype).max
    levels = np.arange(largest + 1).astype(dtype)
    before = RunIn([levels], -np.ones(1))
    coarse = coarser(Evidence("made up", [levels], np.zeros(1), None, 1, 1, run_in=before))
    (image,) = coarse.frames
    np.testing.assert_array_equal(coarse.run_in.frames, [image])
    assert image.dtype == dtype
    assert set(np.unique(image)) == set(range(0, largest + 1, 3))
    off = image.astype(int) - levels
    assert set(off) == {-1, 0, 1}
    assert abs(off.mean()) < 0.01
