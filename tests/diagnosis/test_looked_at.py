"""What is read off a recording before the search does not see the part that is looked at last."""

from contextlib import closing

import numpy as np
import pytest

from adv2e import simulate
from adv2e.config import load_config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.splits import Split, Stream
from adv2e.diagnosis.prepare import prepare
from adv2e.diagnosis.simulation.simulator import Simulator

WIDTH, HEIGHT, COUNT = 32, 24, 25
TIMES_S = 0.02 * np.arange(COUNT)
PULSE = "readout.frame_coupling={amplitude: 0.1, tau_us: 30000, delay_us: 5000, width_us: 4000}"
CONFIG = load_config(["ideal"], ["frames.encoding=linear", "sampling.L=1"])


def recording(part):
    """A pattern that moves, and bursts 5 and 9 ms after each frame in the pixels of one part."""
    draw = np.random.default_rng(3)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    frames = [
        np.rint(100 + 60 * np.sin(0.5 * (x - 0.7 * k)) * np.cos(0.4 * y)).astype(np.uint8)
        for k in range(COUNT)
    ]
    stream = Stream.of(np.concatenate(list(simulate(frames, TIMES_S, CONFIG))), WIDTH, HEIGHT)
    division = Split.of(WIDTH, HEIGHT, 0.0, 1e6 * TIMES_S[-1])
    t, pixel, on = [stream.t], [stream.pixel], [stream.on]
    for frame_us in (1e6 * TIMES_S[:-1]).astype(np.int64).tolist():
        segment = division.segment_of(np.array([frame_us]))[0]
        (inside,) = np.nonzero(division.label[segment] == part)
        for polarity, delay_us in ((1, 5000), (0, 9000)):
            t.append(frame_us + delay_us + draw.integers(0, 100, inside.size))
            pixel.append(inside)
            on.append(np.full(inside.size, polarity))
    t, pixel, on = (np.concatenate(one) for one in (t, pixel, on))
    order = np.argsort(t, kind="stable")
    kept = Stream(
        t[order], pixel[order].astype(np.int32), on[order].astype(stream.on.dtype), WIDTH, HEIGHT
    )
    return Evidence("made up", frames, TIMES_S, kept, WIDTH, HEIGHT)


@pytest.mark.thorough
@pytest.mark.parametrize(("part", "seen"), [(splits.TRAIN, True), (splits.TEST, False)])
def test_bursts_are_looked_for_before_the_last_look(part, seen):
    evidence = recording(part)
    with closing(Simulator(evidence, 2)) as simulator:
        prepared = prepare(evidence, CONFIG, simulator, [], False, lambda line: None)
    assert any("come at once" in note for note in prepared.evidence.notes) is seen
    found = [one for one in prepared.candidates if one.name == "frame_coupling"]
    assert all(bool(one.pulse) is seen for one in found)


@pytest.mark.thorough
def test_a_pulse_that_is_declared_is_not_told():
    evidence = recording(splits.TRAIN)
    declared = load_config(["ideal"], ["sampling.L=1", PULSE])
    with closing(Simulator(evidence, 2)) as simulator:
        prepared = prepare(evidence, declared, simulator, [], False, lambda line: None)
    assert not any("come at once" in note for note in prepared.evidence.notes)
