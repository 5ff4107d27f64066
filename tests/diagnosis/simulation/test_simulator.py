"""Simulations of a recording's own frames: the same for any number of threads, and bounded."""

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from made_up.streams import random_stream, wandering_light

from adv2e import load_config
from adv2e.config.active_effects import frame_hooks
from adv2e.conversion.simulation import events_from_light
from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.data.evidence import Evidence, RunIn
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.hints.lamps import lamps_of
from adv2e.diagnosis.simulation.simulator import FrameCache, Simulator
from adv2e.diagnosis.statistics.summary import Sampler, SummaryStatistics
from adv2e.effects.frames.misregistration import shifted
from adv2e.light.interpolation import make_upsampler
from adv2e.pixel.steps import steps_of

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


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
def test_pixels_have_seen_the_frames_of_the_run_in(simulator, interpolation):
    """With all the frames before, a part's events are those of the whole at that time."""
    config = load_config([], [*LINEAR, f"sampling.interpolation={interpolation}"])
    whole = simulator.stream(config, 1).between(80_000, 200_000)
    part = EVIDENCE.during(8, 20)
    bare = replace(part, run_in=RunIn())
    assert np.ptp(part.run_in.times_s) == pytest.approx(0.05)  # half of 0.12 s, no frame in part
    for known, alike in ((replace(part, run_in=all_before(8)), True), (bare, False)):
        made = Simulator(known, 1)
        stream = made.stream(config, 1)
        made.close()
        assert np.array_equal(stream.t, whole.t) == alike
        assert stream.t.min() >= 80_000


def all_before(first):
    return RunIn(EVIDENCE.frames[:first], EVIDENCE.times_s[:first])


@pytest.mark.parametrize("sets", [["frames.exposure_us=4000"], ["sampling.interpolation=flow"]])
@pytest.mark.quick_cases(1)
def test_a_coupling_of_nothing_takes_no_steps_of_time(simulator, monkeypatch, sets):
    config = load_config([], [*LINEAR, *sets])
    nothing = "readout.frame_coupling={amplitude: 0, tau_us: 300}"
    coupled = load_config([], [*LINEAR, *sets, nothing])
    plain = simulator.stream(config, 1)

    def none(*arguments):
        raise AssertionError("steps of time")

    monkeypatch.setattr("adv2e.pixel.steps.steps_of", none)
    np.testing.assert_array_equal(simulator.stream(coupled, 1).t, plain.t)


def test_both_seeds_decide(simulator):
    config, other = (load_config([], LINEAR, seed=seed) for seed in (1, 2))
    once, again = simulator.stream(config, 7).t, simulator.stream(config, 7).t
    np.testing.assert_array_equal(once, again)
    for different in (simulator.stream(config, 8).t, simulator.stream(other, 7).t):
        assert not np.array_equal(once, different)


def test_every_simulation_is_counted():
    told = []
    simulator = Simulator(EVIDENCE, 4, lambda *now: told.append(now))
    simulator.begin("searching")
    config = load_config([], LINEAR)
    in_threads = simulator.map(lambda seed: simulator.stream(config, seed), range(12))
    simulator.close()
    assert simulator.done == 12
    simulator.begin("judging")
    numbers = [*range(13), 12]
    stages = ["searching"] * 13 + ["judging"]
    assert told == list(zip(stages, numbers, strict=True))
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


AT_ANY_TIME = ["sampling.L=1"]  # what follows a frame is then followed up to the next
ADDED = {
    "coupling": [
        "readout.frame_coupling.amplitude=0.08",
        "readout.frame_coupling.tau_us=300",
        *AT_ANY_TIME,
    ],
    "flicker": ["frames.flicker.frequency_hz=400", "frames.flicker.depth=0.2"],
}


@pytest.mark.parametrize("sets", ADDED.values(), ids=ADDED)
def test_what_is_added_is_rougher_at_a_first_look_alone(simulator, monkeypatch, sets):
    planned = []

    def noted(*arguments):
        planned.append(steps_of(*arguments))
        return planned[-1]

    monkeypatch.setattr("adv2e.pixel.steps.steps_of", noted)
    config = load_config([], [*LINEAR, *sets, "pixel.low_pass.cutoff_hz=900"])
    light = zip(EVIDENCE.times_ns, EVIDENCE.light(config), strict=True)
    alone = np.concatenate(list(events_from_light(light, replace(config, seed=3))))
    steps = {"alone": sum(planned)}
    events = {"alone": np.count_nonzero(alone["t"] < 200_000)}
    for rough in (False, True):
        planned.clear()
        events[rough] = len(simulator.stream(config, 3, rough=rough))
        steps[rough] = sum(planned)
    assert steps[False] == steps["alone"]
    assert events[False] == events["alone"]
    assert 0.35 * steps[False] < steps[True] < 0.5 * steps[False]
    assert events[True] == pytest.approx(events[False], rel=0.15)


@pytest.mark.parametrize("name", ["ideal", "vid2e", "adv2e"])
def test_a_second_pole_only_takes_events_away(simulator, name):
    declared = load_config([name], [*LINEAR, "pixel.refractory.period_us=500"])
    slow = load_config(
        [name],
        [*LINEAR, "pixel.refractory.period_us=500", "pixel.source_follower.cutoff_hz=600"],
    )
    assert len(simulator.stream(slow, 1)) <= 1.1 * len(simulator.stream(declared, 1))


def test_nothing_is_simulated_twice(simulator):
    light = EVIDENCE.light(load_config([], LINEAR))
    scene = Scene.of(light, EVIDENCE.times_s, 1.0)
    config, other = load_config([], LINEAR), load_config([], [*LINEAR, "pixel.leak.rate_hz=3"])
    sampler = Sampler(simulator, SummaryStatistics(scene, [simulator.stream(config, 9)]))
    done = simulator.done
    first = sampler.samples([config, other, config], (1, 2))
    assert simulator.done == done + 4
    np.testing.assert_array_equal(first[0], first[2])
    assert not np.array_equal(first[0], first[1])
    again = sampler.samples([other], (2, 3, 1))
    assert simulator.done == done + 5
    np.testing.assert_array_equal(again[0, [2, 0]], first[1])
    np.testing.assert_array_equal(sampler.sample(other, (1, 2)), first[1])


def test_coarser_steps_of_time_make_the_same_events(simulator, monkeypatch):
    """The light leaps and crosses the knee here: no stamp is off by more than some us."""
    planned = []

    def noted(*arguments):
        planned.append(steps_of(*arguments))
        return planned[-1]

    monkeypatch.setattr("adv2e.pixel.steps.steps_of", noted)
    config = load_config([], [*LINEAR, "pixel.slew_limit.per_s=80", "pixel.low_pass.cutoff_hz=60"])
    light = zip(EVIDENCE.times_ns, EVIDENCE.light(config), strict=True)
    fine = np.concatenate(list(events_from_light(light, replace(config, seed=3))))
    fine, steps = fine[fine["t"] < 200_000], planned.copy()
    planned.clear()
    stream = simulator.stream(config, 3)
    assert sum(planned) < 0.45 * sum(steps)
    assert len(stream) == len(fine) > 500
    assert np.abs(stream.t - fine["t"]).max() < 10


FLOW = [*LINEAR, "sampling.interpolation=flow", "sampling.L=4", "sampling.last_interval=corrected"]


def moving(k):
    """Return a texture after `k` steps, large enough for its motion to be found."""
    x, y = np.meshgrid(np.arange(48.0) - 2.3 * k, np.arange(40.0) + 0.7 * k)
    waves = np.sin(0.5 * x + 0.2 * y) + np.sin(0.31 * y - 0.13 * x) + np.sin(0.22 * x)
    return (100.0 + 30.0 * waves).astype(np.uint8)


# slow enough to be followed at any time, and faster than the steps that the circuit needs
COUPLED = ["readout.frame_coupling.amplitude=0.05", "readout.frame_coupling.tau_us=1150"]

# frames move by 2.4 pixels: fewer than ten between them
UNEVEN = ["sampling.max_motion_px=0.7"]


@pytest.mark.parametrize(
    "exposed",
    [
        [],
        ["frames.exposure_us=6000"],
        COUPLED,
        [*COUPLED, "frames.exposure_us=6000"],
        UNEVEN,
        [*UNEVEN, "frames.exposure_us=6000"],
    ],
)
@pytest.mark.quick_cases(1)
def test_frames_along_the_motion_are_made_once_and_the_same(monkeypatch, exposed):
    made = []
    monkeypatch.setattr(
        "adv2e.diagnosis.simulation.simulator.make_upsampler",
        lambda *arguments: made.append(1) or make_upsampler(*arguments),
    )
    frames = [moving(k) for k in range(8)]
    evidence = Evidence("made up", frames, 0.01 * np.arange(8), random_stream(10), 48, 40)
    simulator = Simulator(evidence, 2)
    config = load_config([], [*FLOW, "pixel.refractory.period_us=300", *exposed])
    light = zip(evidence.times_ns, evidence.light(config), strict=True)
    whole = np.concatenate(list(events_from_light(light, replace(config, seed=5))))
    whole = whole[whole["t"] < 70_000]
    assert len(whole) > 1000
    np.testing.assert_array_equal(simulator.stream(config, 5).t, whole["t"])
    simulator.stream(load_config([], [*FLOW, "pixel.leak.rate_hz=4", *exposed]), 6)
    assert len(made) == 1
    simulator.stream(load_config([], [*FLOW, "frames.exposure_us=3000"]), 5)
    assert len(made) == 2
    simulator.close()


def test_frames_are_made_sharp_once_and_the_same(monkeypatch):
    made = []
    monkeypatch.setattr(
        "adv2e.diagnosis.simulation.simulator.frame_hooks",
        lambda frames, sampling: made.append(frames.exposure_us) or frame_hooks(frames, sampling),
    )
    simulator = Simulator(EVIDENCE, 2)
    laid_over = [
        "frames.black_level_dn=3",
        "frames.clock_offset_us=700",
        "frames.shift_px=[0.2, 0]",
    ]
    config = load_config([], [*LINEAR, "frames.exposure_us=15000", *laid_over])
    light = zip(EVIDENCE.times_ns, EVIDENCE.light(config), strict=True)
    whole = np.concatenate(list(events_from_light(light, replace(config, seed=5))))
    whole = whole[whole["t"].clip(0, 199_999) == whole["t"]]
    assert len(whole) > 500
    np.testing.assert_array_equal(simulator.stream(config, 5).t, whole["t"])
    simulator.stream(load_config([], [*LINEAR, "frames.exposure_us=15000"]), 6)
    assert made.count(15000.0) == 1
    blurred = load_config([], [*LINEAR, *laid_over])
    assert not np.array_equal(simulator.stream(blurred, 5).t, whole["t"])
    assert made.count(15000.0) == 1
    simulator.close()


def test_frames_that_are_being_made_keep_no_others_waiting():
    """The first ones are ready only once others, asked for later, are."""
    cache, others_made = FrameCache(), threading.Event()
    instants = [0, 10_000_000], np.ones((2, 3, 4), np.float32)

    def wait_for_others():
        assert others_made.wait(20.0)
        return instants

    def make_others():
        others_made.set()
        return instants

    one, other = (load_config([], [f"frames.encoding={name}"]) for name in ("linear", "srgb"))
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(cache.of, one, wait_for_others)
        second = pool.submit(cache.of, other, make_others)
        assert first.result() is second.result() is instants
    others_made.clear()
    assert cache.of(one, wait_for_others) is instants  # it is not made again


@pytest.mark.parametrize(
    "beside",
    [
        ["frames.black_level_dn=3", "frames.black_depth_dn=2"],
        ["frames.exposure_us=15000"],
        COUPLED,
        [*COUPLED, "frames.exposure_us=15000"],
    ],
)
def test_frames_are_moved_once_and_the_same(monkeypatch, beside):
    moved = []
    monkeypatch.setattr(
        "adv2e.effects.frames.misregistration.shifted",
        lambda light, by: moved.append(by) or shifted(light, by),
    )
    simulator = Simulator(EVIDENCE, 2)
    config = load_config([], [*LINEAR, *beside, "frames.shift_px=[0.3, -0.2]"])
    light = zip(EVIDENCE.times_ns, EVIDENCE.light(config), strict=True)
    whole = np.concatenate(list(events_from_light(light, replace(config, seed=5))))
    whole = whole[whole["t"].clip(0, 199_999) == whole["t"]]
    assert len(whole) > 500
    moved.clear()
    np.testing.assert_array_equal(simulator.stream(config, 5).t, whole["t"])
    simulator.stream(config, 6)
    assert len(moved) == len(EVIDENCE.frames)
    other = load_config([], [*LINEAR, *beside, "frames.shift_px=[0.3, 0.2]"])
    assert not np.array_equal(simulator.stream(other, 5).t, whole["t"])
    simulator.close()


def test_where_nothing_is_between_the_frames_they_are_the_recorded_ones(simulator, monkeypatch):
    monkeypatch.setattr("adv2e.diagnosis.simulation.simulator.made", None)
    assert len(simulator.stream(load_config([], [*FLOW, "sampling.L=1"]), 1)) > 0


@pytest.mark.parametrize("phase", [-2.0, 0.3, 2.9])
@pytest.mark.parametrize("line_hz", [85.0, 84.5, 85.6])
@pytest.mark.quick_cases(1)
def test_phase_and_frequency_of_a_lamp_are_read_off_the_events(line_hz, phase):
    frames = [np.full((24, 32), 40 + 5 * k, np.uint8) for k in range(21)]
    evidence = Evidence("made up", frames, 0.01 * np.arange(21), random_stream(10), 32, 24)
    declared = load_config([], LINEAR)
    keys = {"frequency_hz": 85.0, "depth": 0.25, "phase_rad": phase}
    lit = with_keys(declared, {f"frames.flicker.{key}": value for key, value in keys.items()})
    lighted = Simulator(evidence, 1)
    (lamp,) = lamps_of(
        (line_hz, 170.0, 255.1),
        lighted.stream(lit, 1),
        declared,
        lambda c: lighted.stream(c, 2),
    )
    lighted.close()
    assert lamp.hz == pytest.approx(85.0, abs=0.15)  # the recording lasts 0.2 s
    middle = 2.0 * np.pi * (lamp.hz - 85.0) * 0.1 + lamp.phase_rad - phase
    assert np.angle(np.exp(1j * middle)) == pytest.approx(0.0, abs=0.1)
