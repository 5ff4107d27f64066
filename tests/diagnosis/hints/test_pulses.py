"""Pulses at the readout of frames, told by bursts of events of both polarities."""

import numpy as np
import pytest
from made_up.sampler import HINTS
from made_up.streams import stream_of

from adv2e.config import load_config
from adv2e.config.active_effects import active_hooks
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.readouts import DELAY, Burst, Pulse, pulse_of
from adv2e.effects.composition import begin
from adv2e.effects.frames.clock_drift import ClockDriftHooks
from adv2e.effects.frames.clock_offset import ClockOffsetHooks
from adv2e.effects.readout.frame_coupling import FrameCouplingHooks

INTERVAL_US = 40_000.0
TIMES_S = 5.0 + 1e-6 * INTERVAL_US * np.arange(20)
COUPLING = "readout.frame_coupling={amplitude: %s, tau_us: 5000, delay_us: 1, width_us: %s}"


def events(on_us=None, off_us=None, interval_us=INTERVAL_US, burst=60, seed=1):
    """Return events at any time, with bursts of one or both polarities after each frame."""
    draw = np.random.default_rng(seed)
    t, on = [5e6 + 20 * INTERVAL_US * draw.random(20_000)], [draw.integers(0, 2, 20_000)]
    for polarity, delay_us in ((1, on_us), (0, off_us)):
        if delay_us is not None:
            frames = 5e6 + interval_us * np.arange(19)
            t.append((frames[:, None] + delay_us + 250.0 * draw.random(burst)).ravel())
            on.append(np.full(t[-1].size, polarity))
    t, on = np.concatenate(t), np.concatenate(on)
    return stream_of(t.astype(np.int64), 0, 0, on)


@pytest.mark.parametrize(
    ("on_us", "off_us"), [(700.0, 1900.0), (39_600.0, 550.0), (27_300.0, 14_100.0)]
)
@pytest.mark.quick_cases(1)
def test_when_both_bursts_begin(on_us, off_us):
    found = pulse_of(events(on_us, off_us), TIMES_S)
    assert found.on.begins_us == pytest.approx(on_us, abs=110.0)
    assert found.off.begins_us == pytest.approx(off_us, abs=110.0)
    assert found.on.lasts_us == pytest.approx(300.0, abs=110.0)
    assert found.on.share == pytest.approx(19 * 60 / (10_000 + 19 * 60), rel=0.1)
    assert (found.interval_us, found.drift_ppm) == (pytest.approx(INTERVAL_US), 0.0)


@pytest.mark.parametrize("on_us", [39_990.0, 85.0, 160.0])
@pytest.mark.quick_cases(1)
def test_sharp_bursts_over_the_border_of_a_bin_are_no_drift(on_us):
    draw = np.random.default_rng(1)
    quiet, count = events(), 19 * 100
    frames = np.repeat(5e6 + INTERVAL_US * np.arange(19), 100)
    bursts = [frames + delay_us + 30.0 * draw.random(count) for delay_us in (on_us, 755.0)]
    t = np.concatenate([quiet.t, *bursts]).astype(np.int64)
    on = np.concatenate([quiet.on, np.ones(count, np.int8), np.zeros(count, np.int8)])
    found = pulse_of(stream_of(t, 0, 0, on), TIMES_S)
    assert (found.drift_ppm, found.interval_us) == (0.0, pytest.approx(INTERVAL_US))
    apart = (found.on.begins_us - on_us + 200.0) % INTERVAL_US - 200.0
    assert apart == pytest.approx(0.0, abs=101.0)


@pytest.mark.parametrize("ppm", [-6400.0, 900.0, 15_000.0])
@pytest.mark.quick_cases(1)
def test_bursts_tell_how_fast_the_clock_of_the_frames_is(ppm):
    found = pulse_of(events(3000.0, 9000.0, INTERVAL_US * (1.0 + 1e-6 * ppm)), TIMES_S)
    assert found.drift_ppm == pytest.approx(ppm, abs=80.0)
    assert found.on.begins_us == pytest.approx(3000.0, abs=150.0)
    assert f"{found.interval_us / 1e3:.2f} ms apart" in found.text()


@pytest.mark.parametrize(("fps", "rounded_us"), [(60.0, 100.0), (30.0, 1.0), (24.0, 200.0)])
@pytest.mark.quick_cases(1)
def test_stamps_that_are_rounded_are_no_drift(fps, rounded_us):
    """Their usual interval is not their mean one."""
    draw = np.random.default_rng(6)
    frames = 1e6 / fps * np.arange(round(20 * fps))
    stamps = np.rint(frames / rounded_us) * rounded_us
    parts = [(frames[:-1, None] + delay + 250.0 * draw.random(40)).ravel() for delay in (700, 1900)]
    t = np.concatenate([*parts, frames[-1] * draw.random(20_000)])
    on = np.repeat([1, 0], parts[0].size).tolist() + draw.integers(0, 2, 20_000).tolist()
    found = pulse_of(stream_of(t.astype(np.int64), 0, 0, np.array(on)), 1e-6 * stamps)
    assert found.drift_ppm == 0.0
    assert found.interval_us == pytest.approx(1e6 / fps, rel=1e-5)
    assert found.on.begins_us == pytest.approx(700.0, abs=150.0)


@pytest.mark.parametrize("ppm", [0.0, 40.0, -5000.0])
@pytest.mark.quick_cases(1)
def test_long_recordings_tell_more_of_the_clock(ppm):
    draw = np.random.default_rng(4)
    interval, count = INTERVAL_US * (1.0 + 1e-6 * ppm), 500
    frames = np.repeat(interval * np.arange(count), 40)
    t = np.concatenate([frames + delay + 250.0 * draw.random(frames.size) for delay in (700, 1900)])
    on = np.repeat([1, 0], frames.size)
    quiet = interval * count * draw.random(20_000)
    t, on = np.concatenate([t, quiet]), np.concatenate([on, draw.integers(0, 2, quiet.size)])
    times_s = 1e-6 * INTERVAL_US * np.arange(count)
    found = pulse_of(stream_of(t.astype(np.int64), 0, 0, on), times_s)
    assert found.drift_ppm == pytest.approx(ppm, abs=5.0)
    assert found.on.begins_us == pytest.approx(700.0, abs=120.0)


@pytest.mark.parametrize(
    ("stream", "times_s"),
    [
        (events(), TIMES_S),
        (events(on_us=700.0), TIMES_S),
        (events(off_us=700.0), TIMES_S),
        (events(700.0, 1900.0, burst=2), TIMES_S),
        (events(700.0, 1900.0), TIMES_S + 1e-3 * np.random.default_rng(2).random(20)),
        (events(700.0, 1900.0), TIMES_S[:2]),
    ],
    ids=["none", "on alone", "off alone", "few", "irregular", "two frames"],
)
@pytest.mark.quick_cases(1)
def test_no_pulse(stream, times_s):
    assert pulse_of(stream, times_s) is None


def test_swings_are_no_pulses():
    draw = np.random.default_rng(5)
    t = 5e6 + 20 * INTERVAL_US * draw.random(60_000)
    on = draw.integers(0, 2, t.size)
    phase = 2.0 * np.pi * t / INTERVAL_US + np.pi * on
    kept = draw.random(t.size) < 0.5 + 0.5 * np.sin(phase)
    assert pulse_of(stream_of(t[kept].astype(np.int64), 0, 0, on[kept]), TIMES_S) is None


ON, OFF = Burst(39_600.0, 300.0, 0.124), Burst(600.0, 900.0, 0.09)


@pytest.mark.parametrize("tick_us", [INTERVAL_US, 0.5 * INTERVAL_US, 0.1 * INTERVAL_US])
@pytest.mark.quick_cases(1)
def test_coarse_stamps_are_no_pulse(tick_us):
    quiet = events()
    t = (quiet.t // tick_us * tick_us).astype(np.int64)
    assert pulse_of(stream_of(t, 0, 0, quiet.on), TIMES_S) is None


@pytest.mark.parametrize("swing", [0.05, 0.5])
def test_a_lamp_at_four_times_the_frame_rate_is_no_pulse(swing):
    """Sharp or not, its bursts come every quarter of an interval."""
    draw = np.random.default_rng(5)
    on = draw.integers(0, 2, 20_000)
    turns = draw.integers(0, 80, on.size) + 0.5 * on + swing * draw.random(on.size)
    t = 5e6 + 0.25 * INTERVAL_US * turns
    assert pulse_of(stream_of(t.astype(np.int64), 0, 0, on), TIMES_S) is None


def test_a_lamp_at_the_frame_rate_is_no_pulse():
    draw = np.random.default_rng(5)
    on = draw.integers(0, 2, 20_000)
    turns = draw.integers(0, 20, on.size) + 0.5 * on + 0.15 * draw.random(on.size)
    t = 5e6 + INTERVAL_US * turns
    assert pulse_of(stream_of(t.astype(np.int64), 0, 0, on), TIMES_S) is None


PULSE = Pulse(ON, OFF, INTERVAL_US, drift_ppm=0.0)


def test_the_bursts_in_words():
    assert PULSE.text() == (
        "12% of the ON events come at once -0.40 ms from each frame, 9% of the OFF events come at"
        " once +0.60 ms from each frame, as if their readout disturbed the pixels (frame_coupling)"
    )


@pytest.mark.parametrize(
    ("sets", "amplitude", "delay_us"),
    [
        ([], 0.05, -400.0),
        ([], -0.05, 600.0),
        (["frames.clock_offset_us=1900"], 0.05, -2300.0),
        (["frames.clock_offset_us=-300", "frames.exposure_us=5000"], 0.05, -2600.0),
        (["frames.exposure_us=50000"], 0.05, 14_600.0),
    ],
)
def test_a_pulse_stays_with_the_bursts_wherever_the_frames_are(sets, amplitude, delay_us):
    config = load_config([], [*sets, COUPLING % (amplitude, 1000)])
    found = PULSE.placed(config).readout.frame_coupling
    assert found.delay_us == pytest.approx(delay_us)
    assert (found.amplitude, found.width_us) == (amplitude, 1000.0)


@pytest.mark.parametrize("ppm", [-6400.0, 800.0])
def test_a_drift_counts_from_the_first_frame_that_is_simulated(ppm):
    """Leaps of the model lie where bursts are, whatever frames before the recording are run in."""
    stamps = 10.0 + 1e-6 * INTERVAL_US * np.arange(26)
    nothing = stream_of([], [], [], [])
    whole = Evidence("whole", [np.zeros((2, 2), np.uint8)] * 26, stamps, nothing, 2, 2)
    for part in (whole.during(0, 12), whole.during(13, 25)):
        frames = part.times_s[0] * 1e6 + INTERVAL_US * (1.0 + 1e-6 * ppm) * np.arange(12)
        t = np.sort(np.concatenate([frames + 3000.0 + k for k in range(40)] * 2))
        bursts = np.concatenate([t, t + 5000.0])
        on = np.repeat([1, 0], len(t))
        noise = np.linspace(part.times_s[0] * 1e6, part.times_s[-1] * 1e6, 4000)
        stream = stream_of(
            np.concatenate([bursts, noise, noise]).astype(np.int64), 0, 0,
            np.concatenate([on, np.repeat([1, 0], len(noise))]),
        )  # fmt: skip
        pulse = pulse_of(stream, part.times_s, part.before_s)
        assert pulse.drift_ppm == pytest.approx(ppm, abs=150.0)
        sets = [COUPLING % (0.1, 5000), "frames.exposure_us=4000", "frames.clock_offset_us=300"]
        config = load_config(["ideal"], [*sets, f"frames.clock_drift_ppm={pulse.drift_ppm}"])
        hooks = active_hooks(pulse.placed(config))
        (coupling,) = (hook for hook in hooks if isinstance(hook, FrameCouplingHooks))
        clocks = [hook for hook in hooks if isinstance(hook, (ClockDriftHooks, ClockOffsetHooks))]
        light = ((t_ns, np.zeros((2, 2))) for t_ns in part.simulated.times_ns)
        list(begin([*clocks, coupling], light, 0))
        leaps = np.array(coupling._leaps) * 1e6
        leaps = leaps[leaps > part.times_s[0] * 1e6]
        assert leaps[:11] == pytest.approx(frames[:11] + 3000.0, abs=170.0, rel=0)


def test_what_is_no_pulse_is_not_moved():
    for sets in ([], [COUPLING % (0.05, 0)]):
        config = load_config([], sets)
        assert PULSE.placed(config) == config


def test_the_library_has_the_pulse_in_the_place_of_leaps_at_the_end_of_exposures():
    def couplings(hints, sets=()):
        made = library(load_config([], list(sets)), hints)
        return [one for one in made if one.name == "frame_coupling"]

    (leap,) = couplings(HINTS)
    assert (leap.extra, leap.pulse) == ((), None)
    drifting = Pulse(ON, OFF, INTERVAL_US, -6400.0)
    up, down = couplings(HINTS.__class__(**{**vars(HINTS), "pulse": drifting}))
    assert dict(up.extra)["readout.frame_coupling.width_us"] == pytest.approx(1000.0)
    assert dict(down.extra)["readout.frame_coupling.width_us"] == pytest.approx(39_000.0)
    assert dict(up.extra)["readout.frame_coupling.rise_us"] == 300.0
    assert dict(up.extra)["frames.clock_drift_ppm"] == -6400.0
    assert all(start[0] > 0.0 for start in up.starts)
    assert all(start[0] < 0.0 for start in down.starts)
    config = up.applied(load_config([], ["frames.clock_offset_us=1000"]), up.scaled((0.05, 4000.0)))
    coupling = config.readout.frame_coupling
    assert (coupling.amplitude, coupling.tau_us) == (pytest.approx(0.05), pytest.approx(4000.0))
    assert coupling.delay_us == pytest.approx(-1400.0)
    assert config.frames.clock_drift_ppm == -6400.0
    # told as it is in the model, wherever that puts the frames
    assert up.settings_in(config, up.scaled((0.05, 4000.0)))[DELAY] == coupling.delay_us
    fit = Fitted.at((0.05, 4000.0), up, load_config([], ["frames.exposure_us=6000"]))
    assert fit.settings[DELAY] == fit.config.readout.frame_coupling.delay_us
    assert fit.settings[DELAY] == pytest.approx(-3400.0)
    # one that is declared stays where it is said to be
    declared = couplings(HINTS, [COUPLING % (0.05, 1000)])
    assert [one.pulse for one in declared] == [None]
