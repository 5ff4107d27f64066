"""Frame coupling: the disturbance by hand, beside the brute-force camera, and in events."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera.photoreceptor import frame_coupling
from reference.agreement import count_and_time_errors, split_events

from adv2e import load_config, simulate
from adv2e.conversion.simulation import events_from_light
from adv2e.effects.hooks import Hooks, View
from adv2e.effects.readout.frame_coupling import FrameCoupling, FrameCouplingHooks
from adv2e.light import intervals
from adv2e.pixel.steps import steps_of


def test_coupling_is_that_of_the_camera_after_its_rise_and_never_before_a_readout():
    readouts, tau_s = np.array([0.0, 0.002, 0.004, 0.0061]), 800e-6
    hook = FrameCouplingHooks(FrameCoupling(amplitude=0.1, tau_us=800.0), 200.0)
    hook.begin(View(2, 2, 0, 0.0))
    frames = [(round(t * 1e9), np.zeros((2, 2))) for t in readouts]
    assert [t for t, _ in hook.light(iter(frames))] == [t for t, _ in frames]
    begins, rise = readouts + 200e-6, tau_s / 12
    times = np.linspace(0.0, 0.012, 997)
    since = times[:, None] - begins
    rises = np.any((since >= 0.0) & (since < rise), axis=1)
    tops = np.searchsorted(times, begins + rise, "right")  # the camera sees the height there
    wanted = frame_coupling(0.1, tau_s, begins + rise, times)
    found = hook.signal(times)
    falls = ~rises & ~np.isin(np.arange(len(times)), tops)
    assert np.count_nonzero(falls) > 900
    np.testing.assert_allclose(found[falls], wanted[falls], atol=1e-9)
    fresh = (times > begins[0]) & (times < begins[0] + rise)
    assert np.count_nonzero(fresh) > 3
    np.testing.assert_allclose(found[fresh], 0.1 * (times[fresh] - begins[0]) / rise, atol=1e-9)
    # the height is met, and nothing shows up to the readout itself
    assert hook.signal(np.array([begins[0] + rise]))[0] == pytest.approx(0.1)
    assert hook.signal(np.array([begins[0]]))[0] == pytest.approx(0.0, abs=1e-12)
    assert hook.signal(np.array([begins[1]]))[0] < 0.1 * np.exp(-2.0)
    steps = [hook.longest_step_us(t, t + 1e-4) for t in times]
    hook.passed(0.005)
    later = times >= 0.005
    busy = (times > begins[0] - 1e-4) & (times < begins[-1] + rise + math.log(1152) * tau_s)
    assert steps == np.where(busy, 800 / 12, math.inf).tolist()
    assert [hook.longest_step_us(t, t + 1e-4) for t in times[later]] == steps[-sum(later) :]
    np.testing.assert_allclose(hook.signal(times[later]), found[later], atol=1e-12)
    assert len(hook._leaps) == 2


def test_a_pulse_is_a_leap_and_one_back_that_the_frames_before_it_wait_for():
    tau_s, width_s, rise = 3e-3, 0.9e-3, 75e-6
    coupling = FrameCoupling(amplitude=-0.2, tau_us=3000.0, delay_us=-2500.0, width_us=900.0)
    hook = FrameCouplingHooks(coupling, 500.0)
    hook.begin(View(2, 2, 0, 0.0))
    stamps = [0.0, 0.004, 0.0081, 0.012]
    known, passed = [], []

    def coming():
        for stamp in stamps:
            known.append(stamp)
            yield round(stamp * 1e9), np.zeros((2, 2))

    for t_ns, _ in hook.light(coming()):
        # a frame may only go when the leaps up to its time are known, 2 ms ahead of theirs
        assert known[-1] >= t_ns * 1e-9 + 0.002 or known == stamps
        passed.append(t_ns)
    assert passed == [round(stamp * 1e9) for stamp in stamps]
    begins = np.array([0.002, 0.0061, 0.010])  # that of the first frame is before all began
    times = np.linspace(0.0, 0.015, 1500)
    wanted = frame_coupling(-0.2, tau_s, begins + rise, times)
    wanted -= frame_coupling(-0.2, tau_s, begins + width_s + rise, times)
    since = times[:, None] - np.concatenate([begins, begins + width_s])
    # the camera sees the height of a leap with the step that it lies in
    near = np.any((since >= 0.0) & (since < rise + 2e-5), axis=1)
    assert np.count_nonzero(~near) > 1300
    np.testing.assert_allclose(hook.signal(times)[~near], wanted[~near], atol=1e-9)
    assert hook.signal(np.array([0.002 + rise]))[0] == pytest.approx(-0.2)
    back = hook.signal(np.array([0.002 + width_s + rise]))[0]
    assert back == pytest.approx(-0.2 * (np.exp(-width_s / tau_s) - 1.0))

    def step(start_ms):
        return hook.longest_step_us(1e-3 * start_ms, 1e-3 * start_ms + 1e-5)

    # the leap, between both, the leap back, the decay of both, and when that is over
    assert [step(2.02), step(2.5), step(2.92), step(4.0)] == [75.0, 250.0, 75.0, 250.0]
    assert step(1.0) == step(33.0) == math.inf
    before = hook.signal(times)
    hook.passed(0.0065)  # between a leap and the one back, which is still to come
    later = times >= 0.0065
    np.testing.assert_allclose(hook.signal(times)[later], before[later], atol=1e-12)


@pytest.mark.parametrize(("rise_us", "step_us"), [(30.0, 30.0), (400.0, 250.0)])
def test_how_long_a_leap_takes(rise_us, step_us):
    hook = FrameCouplingHooks(FrameCoupling(amplitude=0.2, tau_us=3000.0, rise_us=rise_us))
    hook.begin(View(2, 2, 0, 0.0))
    list(hook.light(iter([(0, np.zeros((2, 2)))])))
    rise = 1e-6 * rise_us
    found = hook.signal(np.array([0.0, 0.5 * rise, rise, rise + 3e-3]))
    np.testing.assert_allclose(found, 0.2 * np.array([0.0, 0.5, 1.0, np.exp(-1.0)]), atol=1e-12)
    assert hook.longest_step_us(0.0, 1e-5) == step_us
    assert hook.longest_step_us(2 * rise, 3 * rise) == 250.0


@pytest.mark.parametrize(
    ("tau_us", "rise_us", "width_us"),
    [(60e3, 0.0, 0.0), (3e3, 3e3, 0.0), (300.0, 5e3, 0.0), (20e3, 2.5e3, 7e3), (900.0, 100.0, 0.0)],
)
def test_frames_that_follow_one_another_faster_than_a_leap_rises(tau_us, rise_us, width_us):
    coupling = FrameCoupling(amplitude=0.05, tau_us=tau_us, rise_us=rise_us, width_us=width_us)
    hook = FrameCouplingHooks(coupling)
    hook.begin(View(2, 2, 0, 0.0))
    stamps = np.array([0.0, 0.002, 0.004, 0.0047, 0.008, 0.010])
    list(hook.light((round(t * 1e9), None) for t in stamps))
    rise, tau = 1e-6 * (rise_us or tau_us / 12), 1e-6 * tau_us
    times = np.linspace(1e-9, 0.02 + 3 * rise, 4001)

    def left(since):
        return np.where(since < rise, np.maximum(since, 0.0) / rise, np.exp((rise - since) / tau))

    since = times[:, None] - stamps
    wanted = left(since).sum(axis=1)
    if width_us:
        wanted -= left(since - 1e-6 * width_us).sum(axis=1)
    np.testing.assert_allclose(hook.signal(times), 0.05 * wanted, atol=1e-12)
    # as long as a leap rises, and decays, it is followed
    for start in (0.010, 0.010 + 0.9 * rise, 0.010 + rise + tau):
        assert hook.longest_step_us(start, start + 1e-5) <= tau_us / 12
    before = hook.signal(times)
    hook.passed(0.0085)
    later = times >= 0.0085
    np.testing.assert_allclose(hook.signal(times)[later], before[later], atol=1e-12)


@pytest.mark.parametrize(
    ("start_ns", "interval_ns", "when"),
    [
        (1_468_941_032_000_000_000, 10_000_000, "delay_us: 10000"),
        (0, 33_333_333, "width_us: 66666.666"),
        (0, 40_000_000, "width_us: 40000"),
    ],
)
def test_leaps_at_the_borders_of_parts(monkeypatch, start_ns, interval_ns, when):
    """What a part begins with is rounded otherwise than what the one before ended with."""
    coupling = f"readout.frame_coupling={{amplitude: 0.1, tau_us: 30000, {when}}}"
    config = load_config(["ideal"], ["sampling.L=1", coupling])
    y, x = np.mgrid[:24, :32]
    frames = [
        (start_ns + interval_ns * k, 110 + 60 * np.sin(0.5 * (x - 0.2 * k)) * np.cos(0.4 * y))
        for k in range(20)
    ]

    def made(most):
        monkeypatch.setattr(intervals, "_MOST", most)
        return np.concatenate(list(events_from_light(iter(frames), config, threads=1)))

    assert len(made(64)) > 500
    assert made(1).tobytes() == made(64).tobytes()


def test_frames_that_were_made_between_others_are_not_read_out():
    times = np.linspace(0.0, 0.007, 500)

    def signal(count, every):
        hook = FrameCouplingHooks(FrameCoupling(amplitude=0.1, tau_us=800.0), 200.0, every)
        hook.begin(View(2, 2, 0, 0.0))
        assert len(list(hook.light((round(6e6 / count * k), None) for k in range(count)))) == count
        return hook.signal(times)

    np.testing.assert_array_equal(signal(9, 3), signal(3, 1))
    assert not np.array_equal(signal(9, 3), signal(9, 1))


@pytest.mark.parametrize("start_s", [0.0, 5.0021, 1.4689e9])
def test_leaps_with_a_period_of_their_own(start_s):
    """They keep to the clock, whatever the frames, their exposure and where they begin."""
    period_us, delay_us, tau_s = 3100.0, 700.0, 300e-6
    coupling = FrameCoupling(amplitude=0.1, tau_us=300.0, delay_us=delay_us, period_us=period_us)
    hook = FrameCouplingHooks(coupling, 4000.0)
    start_ns = round(start_s * 1e9)
    hook.begin(View(2, 2, 0, start_ns * 1e-9))
    times_ns = [start_ns + 4_000_000 * k for k in range(6)]
    assert [t for t, _ in hook.light((t, None) for t in times_ns)] == times_ns
    # by whole nanoseconds, of which Python loses none
    first = -((700_000 - start_ns) // 3_100_000)
    leaps = [first * 3_100_000 + 700_000 + 3_100_000 * k - start_ns for k in range(7)]
    leaps = 1e-9 * np.array([leap for leap in leaps if leap <= 20_000_000])
    assert len(leaps) >= 6
    assert 0.0 <= leaps[0] < 3.1e-3
    since = np.array([50e-6, 100e-6, 600e-6])
    for leap in leaps:
        found = hook.signal(start_s + leap + since)
        rounded = 2e-6 if start_s > 1e9 else 1e-9  # as much as seconds since 1970 are
        wanted = 0.1 * np.exp(-(since - 25e-6) / tau_s)
        np.testing.assert_allclose(found, wanted, rtol=1e-4 + rounded / tau_s)
        assert hook.signal(np.array([start_s + leap - 5e-6]))[0] < 0.1 * np.exp(-9.0)


def test_what_is_left_of_leaps_before_the_first_frame_decays_from_the_beginning():
    coupling = FrameCoupling(
        amplitude=0.2, tau_us=1500.0, delay_us=-41.0, rise_us=40.0, period_us=4000.0
    )
    hook = FrameCouplingHooks(coupling)
    hook.begin(View(2, 2, 0, 0.0))
    assert len(list(hook.light((t, None) for t in (0, 2_000_000)))) == 2
    times = np.array([0.0, 0.5e-3, 1.5e-3])
    waited = times + 1e-6  # since it rose
    before = np.arange(9) * 4e-3
    wanted = 0.2 * np.exp(-(waited + before[:, None]) / 1.5e-3).sum(axis=0)
    np.testing.assert_allclose(hook.signal(times), wanted, rtol=1e-3)
    # the pixel has settled with it: as it decays, OFF events come
    config = load_config(
        ["ideal"],
        ["readout.frame_coupling={amplitude: 0.3, tau_us: 1500, delay_us: -41, rise_us: 40,"
         " period_us: 40000}"],
    )  # fmt: skip
    still = ((0, np.full((3, 4), 90.0)), (20_000_000, np.full((3, 4), 90.0)))
    events = np.concatenate(list(events_from_light(iter(still), config, threads=1)))
    assert len(events) == 12
    assert not events["p"].any()


@pytest.mark.parametrize("tau_us", [150.0, 600.0])
def test_where_the_coupling_has_decayed_long_steps_make_the_same_events(monkeypatch, tau_us):
    planned = []

    def noted(*arguments):
        planned.append(steps_of(*arguments))
        return planned[-1]

    monkeypatch.setattr("adv2e.pixel.steps.steps_of", noted)
    y, x = np.mgrid[:24, :32]
    frames = [
        (110 + 90 * np.sin(0.5 * (x - 0.9 * k)) * np.cos(0.4 * y)).astype(np.uint8)
        for k in range(6)
    ]
    coupling = f"readout.frame_coupling={{amplitude: 0.25, tau_us: {tau_us}}}"
    sets = ["frames.encoding=linear", "sampling.L=10", "pixel.low_pass.cutoff_hz=200", coupling]
    config = load_config(["ideal"], sets)

    def found():
        planned.clear()
        chunks = simulate(frames, [0.04 * k for k in range(6)], config, effects=[])
        return np.concatenate(list(chunks)), sum(planned)

    events, steps = found()
    monkeypatch.setattr(FrameCouplingHooks, "longest_step_us", Hooks.longest_step_us)
    precise, all_steps = found()
    assert steps < 0.65 * all_steps
    assert len(precise) > 5000
    agreement = count_and_time_errors(
        *(split_events(stream, 32, 24 * 32) for stream in (events, precise))
    )
    assert not agreement.differing
    assert agreement.mean_dt_us < 0.1
