"""Leak: rates, phases and gaps of pixels at rest, from the first moment on."""

from __future__ import annotations

import numpy as np
import pytest
from harness import PIXELS, SECONDS, at_rest, check_against_twin, clock, moving_light, quiet, start
from reference.circuit import Circuit
from scipy import stats

from adv2e.config.model import (
    Leak,
    LowPass,
    PhotoreceptorNoise,
    Pixel,
    Refractory,
    ResetOvershoot,
    ShotNoise,
    SourceFollower,
    Thresholds,
)
from adv2e.diagnosis.tables.noise import NoisySources, noise_rates
from adv2e.kernel import per_pixel


@pytest.mark.parametrize(("dn", "photo"), [(0.0, 0.0), (128.0, 1.5), (255.0, 1.5)])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_leak(dn, photo, jitter):
    rate = 2.0 + photo * dn / 255
    leak = Leak(rate_hz=2.0, photo_rate_hz=photo, jitter=jitter)
    events, exact = at_rest(dn, quiet(leak=leak, initial_reference="random"))
    assert events["p"].all()
    # a pixel fires regularly, at a phase that is uniform over both thresholds: only the first
    # event may take up to twice a period
    expected = PIXELS * (SECONDS - 0.5 / rate) * rate
    assert abs(len(events) - expected) < 4 * np.sqrt(PIXELS) + 0.01 * jitter * expected
    index = events["x"]
    gaps = np.concatenate([np.diff(np.sort(exact[index == x])) for x in range(400)])
    spread = 4 * max(jitter, 0.01) / np.sqrt(gaps.size)
    assert gaps.mean() == pytest.approx(1e6 / rate, rel=spread)
    assert gaps.std() / gaps.mean() == pytest.approx(jitter, abs=0.02)


def per_second(events, seconds, bins=8):
    """ON and OFF events a pixel and second in each of `bins` parts of the time."""
    parts = [
        np.histogram(events["t"][events["p"] == p], bins, (0, seconds * 1e6))[0] for p in (1, 0)
    ]
    return np.array(parts) * bins / (PIXELS * seconds)


RUNNING = {"initial_reference": "running", "refractory": Refractory()}

CIRCUITS = {
    "lanes": {},
    "no dead time": {"refractory": None},
    "second pole": {"source_follower": SourceFollower(cutoff_hz=200.0)},
    "euler": {"low_pass": LowPass(update="euler")},
    "no filter": {"low_pass": None},
}


@pytest.mark.parametrize("noise_hz", [0.0, 2.0])
@pytest.mark.parametrize("jitter", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("circuit", CIRCUITS)
@pytest.mark.quick_cases(1)
def test_leak_goes_on_from_the_first_moment_as_later(circuit, jitter, noise_hz):
    """The camera has run before: no burst, no pause, and the rate that `characterise` expects."""
    dead_s = 2e-3
    sections = {
        "refractory": Refractory(period_us=dead_s * 1e6),
        "thresholds": Thresholds(mismatch=0.03),
        "leak": Leak(rate_hz=1.0, photo_rate_hz=6.0, jitter=jitter),
        "shot_noise": ShotNoise(rate_hz=noise_hz) if noise_hz else None,
        "initial_reference": "running",
        **CIRCUITS[circuit],
    }
    if sections["refractory"] is None:
        dead_s = 0.0
    dn, seconds, bins = 85.0, 1.0, 8
    events, exact = at_rest(dn, quiet(**sections), seconds)
    sources = NoisySources(leak_hz=1.0, photo_leak_hz=6.0, shot_hz=noise_hz, dead_time_s=dead_s)
    rates = noise_rates(sources, np.array([dn / 255]))
    on_hz, off_hz = rates.median(True)[0], rates.median(False)[0]
    on, off = per_second(events, seconds, bins)
    parts = PIXELS * seconds / bins
    # jitter shortens some of the cycles beside noise, and none in the mean without
    slack = 4 * np.sqrt(on_hz / parts) + 0.5 * jitter**2 * (noise_hz > 0)
    assert np.abs(on - on_hz).max() < slack
    assert np.abs(off - off_hz).max() <= 4 * np.sqrt(off_hz / parts)
    # ON events of pixels at rest are spread evenly, not by the frame or by the cycle
    assert stats.kstest(exact[events["p"] == 1] * 1e-6, stats.uniform(0, seconds).cdf).pvalue > 1e-3
    assert np.unique(events["t"], return_counts=True)[1].max() <= 5


@pytest.mark.parametrize("sections", [{}, {"shot_noise": None}])
def test_a_camera_that_leaks_keeps_what_leak_promises(sections):
    """Of 3000 pixels at rest some 300 events a second, and never all pixels at once."""
    pixel = Pixel(leak=Leak(), **sections)
    events, _ = at_rest(128.0, pixel, 40.0)
    shot = pixel.shot_noise.rate_hz if pixel.shot_noise else 0.0
    sources = NoisySources(leak_hz=0.1, shot_hz=shot, dead_time_s=5e-4)
    rates = noise_rates(sources, np.array([128 / 255]))
    on_hz, off_hz = rates.median(True)[0], rates.median(False)[0]
    assert rates.leak_of[0, 0] > 0.09
    on, off = per_second(events, 40.0)
    assert np.abs(on - on_hz).max() < 4 * np.sqrt(on_hz * 8 / (PIXELS * 40.0))
    assert np.abs(off - off_hz).max() <= 4 * np.sqrt(off_hz * 8 / (PIXELS * 40.0))
    assert np.unique(events["t"], return_counts=True)[1].max() <= 3


def test_what_has_come_before_is_drawn_pixel_by_pixel():
    """A pixel's place in its cycle does not depend on the pixels beside it, or on threads."""
    pixel = quiet(leak=Leak(rate_hz=0.1), **RUNNING)
    light = np.full((2, 1, PIXELS), 100, np.float32)
    first, *others = (
        start(light[:, :, :n], [0], pixel, threads=threads).state
        for n, threads in ((PIXELS, 1), (PIXELS, 3), (700, 2))
    )
    for other in others:
        assert np.array_equal(other, first[:, : other.shape[1]])
    fallen = (first[per_pixel.X] - first[per_pixel.REFERENCE]) / 0.2
    assert stats.kstest(fallen, "uniform").pvalue > 1e-3
    steady = start(light, [0], quiet(leak=Leak(rate_hz=0.0), **RUNNING), threads=1).state
    assert np.array_equal(steady[per_pixel.REFERENCE], steady[per_pixel.X])


@pytest.mark.parametrize("overshoot", [-0.4, 0.4])
def test_leak_before_the_recording_knows_the_overshoot_of_the_reset(overshoot):
    sections = {"reset_overshoot": ResetOvershoot(fraction=overshoot), **RUNNING}
    events, _ = at_rest(80.0, quiet(leak=Leak(rate_hz=5.0), **sections), 1.0)
    expected = 1 / (5e-4 + (1 + overshoot) / 5.0)
    on, _ = per_second(events, 1.0)
    assert np.abs(on - expected).max() < 4 * np.sqrt(expected * 8 / PIXELS)


def test_leak_before_the_recording_leaves_room_for_photoreceptor_noise():
    """Noise takes pixels over the last of their way: those beyond it must not fire at once."""
    noise = PhotoreceptorNoise(rms=0.03)
    pixel = quiet(leak=Leak(rate_hz=2.0), photoreceptor_noise=noise, **RUNNING)
    events, _ = at_rest(128.0, pixel, 0.5, pixels=600)
    first = np.count_nonzero(events["t"] < 20_000)
    assert first < 2 * len(events) * 0.04


@pytest.mark.parametrize("update", ["first_order_hold", "paper"])
def test_leak_of_the_stepped_forms_follows_the_light(update):
    """As if at the mean light of a step; the twin's is a line within it, which costs some us."""
    light = moving_light(31, 24, seed=3)
    pixel = quiet(low_pass=LowPass(update=update), leak=Leak(photo_rate_hz=40.0, jitter=0.0))
    circuit = Circuit(update=update, K=5, leak_hz=0.1, photo_leak_hz=40.0)
    check_against_twin(light, clock(31, 1 / 240), pixel, circuit, K=5, within_us=10.0)
