"""Simulations of a recording's own frames: the same for any number of threads, and bounded."""

import numpy as np
import pytest
from made_up_streams import random_stream, wandering_light

from adv2e import load_config
from adv2e.diagnosis.evidence import Evidence
from adv2e.diagnosis.simulations import Simulator

FRAMES = [image.astype(np.uint8) for image in wandering_light(seed=1)]
EVIDENCE = Evidence("made up", FRAMES, 0.01 * np.arange(21), random_stream(10), 16, 12)
LINEAR = ["frames.encoding=linear"]


@pytest.fixture
def simulator():
    made = Simulator(EVIDENCE, 2)
    yield made
    made.close()


def test_streams_lie_between_the_frames(simulator):
    config = load_config([], [*LINEAR, "frames.clock_offset_us=4000", "pixel.leak.rate_hz=30"])
    stream = simulator.stream(config, 1)
    assert len(stream) > 100
    assert stream.t.min() >= 0
    assert stream.t.max() < 200_000
    assert (stream.width, stream.height) == (16, 12)


def test_the_seed_decides_and_that_of_the_configuration_does_not(simulator):
    config, other = (load_config([], LINEAR, seed=seed) for seed in (1, 2))
    np.testing.assert_array_equal(simulator.stream(config, 7).t, simulator.stream(other, 7).t)
    assert len(simulator.stream(config, 8)) != 0
    assert not np.array_equal(simulator.stream(config, 7).t, simulator.stream(config, 8).t)


def test_every_simulation_is_counted():
    told = []
    simulator = Simulator(EVIDENCE, 4, lambda done, likely: told.append(done))
    config = load_config([], LINEAR)
    in_threads = simulator.map(lambda seed: simulator.stream(config, seed), range(12))
    simulator.close()
    assert simulator.done == 12
    assert told == list(range(1, 13))
    alone = Simulator(EVIDENCE, 1)
    for seed, stream in enumerate(in_threads):
        np.testing.assert_array_equal(stream.t, alone.stream(config, seed).t)
    alone.close()


def test_frames_are_decoded_as_every_configuration_says(simulator):
    # more ways than are kept
    names = ["linear", "srgb", "gamma:1.2", "gamma:1.4", "gamma:1.6", "gamma:1.8", "linear"]
    found = [simulator.stream(load_config([], [f"frames.encoding={name}"]), 1).t for name in names]
    np.testing.assert_array_equal(found[0], found[-1])
    assert len({len(t) for t in found}) > 3


@pytest.mark.parametrize("name", ["ideal", "vid2e", "adv2e"])
def test_a_second_pole_only_takes_events_away(simulator, name):
    declared = load_config([name], [*LINEAR, "pixel.refractory.period_us=500"])
    slow = load_config(
        [name],
        [*LINEAR, "pixel.refractory.period_us=500", "pixel.source_follower.cutoff_hz=600"],
    )
    assert len(simulator.stream(slow, 1)) <= 1.1 * len(simulator.stream(declared, 1))
