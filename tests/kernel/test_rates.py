"""Achieved rates of noise equal the requested ones within their own sampling error."""

import numpy as np
import pytest
from harness import advance, quiet, start
from scipy import stats

from adv2e.config.model import (
    HotPixels,
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

PIXELS = 3000
SECONDS = 4.0


def still(dn, pixel, seconds=SECONDS, pixels=PIXELS, frames=5, seed=3):
    light = np.full((frames, 1, pixels), dn, np.float32)
    times = [round(k * seconds / (frames - 1) * 1e9) for k in range(frames)]
    array = start(light, times, pixel, seed=seed, exact_times=True)
    return advance(array, light, times)


def within(count, expected, sigmas=4.0):
    return abs(count - expected) <= sigmas * np.sqrt(expected)


@pytest.mark.parametrize("dn", [0.0, 40.0, 255.0])
def test_shot_noise(dn):
    pixel = quiet(shot_noise=ShotNoise(rate_hz=3.0), initial_reference="random")
    events, _ = still(dn, pixel)
    assert within(len(events), PIXELS * SECONDS * 3.0 * (1 - 0.75 * dn / 255))
    assert within(events["p"].sum(), len(events) / 2)
    times = np.sort(events["t"]) / 1e6
    assert stats.kstest(times, stats.uniform(0, SECONDS).cdf).pvalue > 1e-3


def test_shot_noise_loses_what_falls_into_dead_time():
    pixel = quiet(
        shot_noise=ShotNoise(rate_hz=100.0),
        refractory=Refractory(period_us=2000.0),
        initial_reference="random",
    )
    events, exact = still(0.0, pixel, seconds=2.0, pixels=300)
    assert within(len(events), 300 * 2.0 * 100 / (1 + 100 * 2e-3))
    for x in range(20):
        assert np.diff(np.sort(exact[events["x"] == x])).min() >= 2000.0


def test_rates_of_hot_pixels_are_spread_over_decades():
    hot = HotPixels(fraction=0.5, rate_hz=100.0, spread=0.6)
    events, _ = still(0.0, quiet(hot_pixels=hot))
    rates = np.bincount(events["x"], minlength=PIXELS) / SECONDS
    logs = np.log10(rates[rates > 0])
    assert events["p"].all()
    assert within(logs.size, PIXELS * 0.5)
    deviations = stats.kstest(logs, stats.norm(2.0, 0.6).cdf).statistic
    assert deviations < 2.0 / np.sqrt(logs.size)


@pytest.mark.parametrize(("dn", "photo"), [(0.0, 0.0), (128.0, 1.5), (255.0, 1.5)])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_leak(dn, photo, jitter):
    rate = 2.0 + photo * dn / 255
    leak = Leak(rate_hz=2.0, photo_rate_hz=photo, jitter=jitter)
    events, exact = still(dn, quiet(leak=leak, initial_reference="random"))
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
    events, exact = still(dn, quiet(**sections), seconds)
    sources = NoisySources(leak_hz=1.0, photo_leak_hz=6.0, shot_hz=noise_hz, dead_time_s=dead_s)
    rates = noise_rates(sources, np.array([dn / 255]))
    on, off = per_second(events, seconds, bins)
    parts = PIXELS * seconds / bins
    # jitter shortens some of the cycles beside noise, and none in the mean without
    slack = 4 * np.sqrt(rates.on[0] / parts) + 0.5 * jitter**2 * (noise_hz > 0)
    assert np.abs(on - rates.on[0]).max() < slack
    assert np.abs(off - rates.off[0]).max() <= 4 * np.sqrt(rates.off[0] / parts)
    # ON events of pixels at rest are spread evenly, not by the frame or by the cycle
    assert stats.kstest(exact[events["p"] == 1] * 1e-6, stats.uniform(0, seconds).cdf).pvalue > 1e-3
    assert np.unique(events["t"], return_counts=True)[1].max() <= 5


@pytest.mark.parametrize("sections", [{}, {"shot_noise": None}])
def test_a_camera_that_leaks_keeps_what_leak_promises(sections):
    """Of 3000 pixels at rest some 300 events a second, and never all pixels at once."""
    pixel = Pixel(leak=Leak(), **sections)
    events, _ = still(128.0, pixel, 40.0)
    shot = pixel.shot_noise.rate_hz if pixel.shot_noise else 0.0
    sources = NoisySources(leak_hz=0.1, shot_hz=shot, dead_time_s=5e-4)
    rates = noise_rates(sources, np.array([128 / 255]))
    assert rates.leak[0] > 0.09
    on, off = per_second(events, 40.0)
    assert np.abs(on - rates.on[0]).max() < 4 * np.sqrt(rates.on[0] * 8 / (PIXELS * 40.0))
    assert np.abs(off - rates.off[0]).max() <= 4 * np.sqrt(rates.off[0] * 8 / (PIXELS * 40.0))
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
    events, _ = still(80.0, quiet(leak=Leak(rate_hz=5.0), **sections), 1.0)
    expected = 1 / (5e-4 + (1 + overshoot) / 5.0)
    on, _ = per_second(events, 1.0)
    assert np.abs(on - expected).max() < 4 * np.sqrt(expected * 8 / PIXELS)


def test_leak_before_the_recording_leaves_room_for_photoreceptor_noise():
    """Noise takes pixels over the last of their way: those beyond it must not fire at once."""
    noise = PhotoreceptorNoise(rms=0.03)
    pixel = quiet(leak=Leak(rate_hz=2.0), photoreceptor_noise=noise, **RUNNING)
    events, _ = still(128.0, pixel, 0.5, pixels=600)
    first = np.count_nonzero(events["t"] < 20_000)
    assert first < 2 * len(events) * 0.04


def test_hot_pixels():
    pixel = quiet(hot_pixels=HotPixels(fraction=0.1, rate_hz=20.0), initial_reference="random")
    events, _ = still(90.0, pixel)
    hot = np.unique(events["x"])
    assert within(hot.size, 0.1 * PIXELS)
    assert within(len(events), hot.size * SECONDS * 20.0)
    assert events["p"].all()


def test_random_reference_is_uniform_between_the_thresholds():
    pixel = quiet(initial_reference="random")
    light = np.full((2, 1, PIXELS), 100, np.float32)
    array = start(light, [0], pixel)
    offset = (
        array.state[per_pixel.X] - array.state[per_pixel.REFERENCE]
    ) / 0.2  # signal minus reference
    assert stats.kstest(offset, stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_photoreceptor_noise_has_its_rms_and_correlation():
    """Sampled from the state at the ends of intervals, at two brightnesses."""
    interval_ns = 500_000
    for dn in (20.0, 255.0):
        pixel = quiet(photoreceptor_noise=PhotoreceptorNoise(rms=0.05))
        light = np.full((2, 1, 2000), dn, np.float32)
        array = start(light, [0], pixel)
        samples = []
        for k in range(30):
            advance(array, light, [k * interval_ns, (k + 1) * interval_ns])
            samples.append(array.state[per_pixel.NOISE].copy())
        noise = np.array(samples)
        assert noise.std() == pytest.approx(0.05, rel=0.03)
        corner = 2e-9 * np.pi * (21.8 + 278.2 * dn / 255)
        lagged = np.mean(noise[1:] * noise[:-1]) / np.mean(noise**2)
        assert lagged == pytest.approx(np.exp(-corner * interval_ns), abs=0.02)


def test_photoreceptor_noise_alternates():
    pixel = quiet(photoreceptor_noise=PhotoreceptorNoise(rms=0.08), initial_reference="random")
    events, _ = still(128.0, pixel, seconds=0.3, pixels=200)
    pairs = opposite = 0
    for x in range(200):
        p = events["p"][events["x"] == x].astype(int)
        pairs += len(p) - 1 if len(p) else 0
        opposite += np.count_nonzero(np.diff(p))
    assert pairs > 500
    assert opposite / pairs > 0.75


def test_noise_behind_a_second_pole_begins_as_it_goes_on():
    """Its variance, and what it has in common with that before the pole, as theory has them."""
    rms, follower_hz = 0.1, 60.0
    dn = np.repeat([10.0, 200.0], 4000)
    light = np.tile(dn, (3, 1)).astype(np.float32)
    times = [0, 30_000_000, 60_000_000]
    pixel = quiet(
        thresholds=Thresholds(on=9.0, off=9.0, mismatch=0.0),
        source_follower=SourceFollower(cutoff_hz=follower_hz),
        photoreceptor_noise=PhotoreceptorNoise(rms=rms, step=0.3),
    )
    array = start(light, times, pixel)
    share = follower_hz / (follower_hz + 21.8 + (300.0 - 21.8) * dn / 255.0)
    for _ in range(2):
        noise, seen = array.state[per_pixel.NOISE], array.state[per_pixel.SEEN]
        for half in (slice(0, 4000), slice(4000, 8000)):
            expected = rms**2 * share[half][0]
            # five standard errors
            assert np.var(seen[half]) == pytest.approx(expected, rel=0.12)
            both = np.mean(seen[half] * noise[half])
            assert both == pytest.approx(expected, rel=0.12 / np.sqrt(share[half][0]))
        advance(array, light, times)
