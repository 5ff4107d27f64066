"""The law of threshold crossings by noise behind two poles, beside our own pixel at rest."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.diagnosis.tables.noise import NoisySources, _laws, noise_rates
from adv2e.diagnosis.tables.threshold_noise import event_rates
from adv2e.effects.pixel.thresholds import FLOOR
from adv2e.kernel.per_pixel import fill_levels

ROWS, COLUMNS = 30, 40


def simulated(sources: NoisySources, seconds: float, seed: int = 1) -> np.ndarray:
    """Counts of OFF and ON events of each pixel in the second half, (2, pixels).

    References forget how they began only as leak and noise take them anew, so that the first half
    is left out.
    """
    follower = f"{{cutoff_hz: {sources.follower_hz}}}" if sources.follower_hz else "null"
    config = load_config(
        [],
        [
            f"seed={seed}",
            "sampling.L=1",
            "pixel.shot_noise=null",
            f"pixel.leak.rate_hz={sources.leak_hz}",
            f"pixel.thresholds.on={sources.on}",
            f"pixel.thresholds.off={sources.off}",
            f"pixel.thresholds.mismatch={sources.mismatch}",
            f"pixel.low_pass.cutoff_hz={sources.cutoff_hz}",
            f"pixel.low_pass.dark_cutoff_hz={sources.dark_cutoff_hz}",
            f"pixel.source_follower={follower}",
            f"pixel.photoreceptor_noise.rms={sources.rms}",
            f"pixel.refractory.period_us={1e6 * sources.dead_time_s}",
        ],
    )
    times = np.linspace(0.0, seconds, 3)
    events = np.concatenate(list(simulate([np.ones((ROWS, COLUMNS))] * 3, times, config)))
    late = events[events["t"] > 0.5e6 * seconds]
    at = late["y"].astype(np.int64) * COLUMNS + late["x"]
    counts = [np.bincount(at[late["p"] == p], minlength=ROWS * COLUMNS) for p in (0, 1)]
    return np.array(counts)


@pytest.mark.parametrize(
    "sources",
    [
        NoisySources(
            leak_hz=1.0, rms=0.04, cutoff_hz=100, dark_cutoff_hz=100, follower_hz=1000,
            dead_time_s=2e-4,
        ),
        NoisySources(
            leak_hz=1.0, rms=0.06, cutoff_hz=30, dark_cutoff_hz=30, follower_hz=200, off=0.25,
            dead_time_s=5e-4,
        ),
        NoisySources(
            leak_hz=1.0, rms=0.1, cutoff_hz=200, dark_cutoff_hz=200, follower_hz=100, off=0.23,
            dead_time_s=1e-3,
        ),
    ],
    ids=["first pole slower", "dim", "second pole slower"],
)  # fmt: skip
@pytest.mark.quick_cases(1)
def test_rates_behind_two_poles_are_those_of_our_pixel(sources):
    seconds = 8.0
    off, on = simulated(sources, seconds).mean(axis=1) / (0.5 * seconds)
    first, second = 2 * np.pi * sources.cutoff_hz, 2 * np.pi * sources.follower_hz
    slow, ratio = min(first, second), min(first, second) / max(first, second)
    sigma = sources.rms * np.sqrt(second / (first + second))
    law = event_rates(
        sources.on / sigma, sources.off / sigma, slow * sources.dead_time_s, ratio,
        sources.leak_hz / slow,
    )  # fmt: skip
    assert slow * law[0] == pytest.approx(on, rel=0.1)
    assert slow * law[1] == pytest.approx(off, rel=0.1)


@pytest.mark.thorough
def test_noise_behind_the_second_pole_falls_as_the_first_gets_faster():
    """What one pole cannot: its rate is the corner times a number."""

    def rate(cutoff_hz, follower_hz):
        sources = NoisySources(
            rms=0.06, cutoff_hz=cutoff_hz, dark_cutoff_hz=cutoff_hz, follower_hz=follower_hz,
            leak_hz=0.01, dead_time_s=1e-4,
        )  # fmt: skip
        return noise_rates(sources, np.ones(1)).median(False)[0]

    one = [rate(cutoff, 0.0) / cutoff for cutoff in (30.0, 300.0)]
    assert one[1] == pytest.approx(one[0], rel=0.3)
    two = [rate(cutoff, 100.0) for cutoff in (30.0, 300.0)]
    assert two[1] < 0.2 * two[0]


@pytest.mark.thorough
def test_rates_over_the_pixels_are_those_of_our_pixels():
    seconds = 12.0
    sources = NoisySources(
        leak_hz=1.0, rms=0.05, cutoff_hz=60, dark_cutoff_hz=60, follower_hz=200, off=0.25,
        mismatch=0.03, dead_time_s=5e-4,
    )  # fmt: skip
    off, on = simulated(sources, seconds)
    rates = noise_rates(sources, np.ones(1))
    time = np.array([0.5 * seconds])
    assert rates.mean(True)[0] * time[0] == pytest.approx(on.mean(), rel=0.1)
    assert rates.mean(False)[0] * time[0] == pytest.approx(off.mean(), rel=0.15)
    few = []
    for counts, is_on in ((on, True), (off, False)):
        for number in (1, 2, 4, 8, 16, 32):
            found = rates.share_having(number, time, is_on)[0]
            measured = (counts >= number).mean()
            few.append(measured)
            assert abs(found - measured) < 0.05 + 0.1 * measured
    assert min(few) < 0.1 and max(few) > 0.9
    # all alike, the most sensitive would have hardly more than the others
    alike = noise_rates(NoisySources(**{**vars(sources), "mismatch": 0.0}), np.ones(1))
    assert alike.share_having(8, time, False)[0] < 0.3 * (off >= 8).mean()


@pytest.mark.parametrize(
    "sources",
    [
        NoisySources(
            rms=0.06, cutoff_hz=28, dark_cutoff_hz=28, dead_time_s=5e-4, noise_step=0.1,
        ),
        NoisySources(
            rms=0.1, cutoff_hz=200, dark_cutoff_hz=200, follower_hz=100, mismatch=0.015,
            dead_time_s=5e-4,
        ),
        NoisySources(
            rms=0.06, cutoff_hz=105, dark_cutoff_hz=105, off=0.22, dead_time_s=5e-3,
            noise_step=0.1,
        ),
    ],
    ids=["one pole", "two poles, thresholds nearly equal", "long dead time"],
)  # fmt: skip
@pytest.mark.quick_cases(1)
def test_equal_thresholds_lead_back_to_where_the_last_event_began(sources):
    seconds = 6.0
    off, on = simulated(sources, seconds).mean(axis=1) / (0.5 * seconds)
    rates = noise_rates(sources, np.ones(1))
    assert rates.mean(True)[0] == pytest.approx(on, rel=0.1)
    assert rates.mean(False)[0] == pytest.approx(off, rel=0.1)


@pytest.mark.thorough
def test_the_most_sensitive_pixels_are_in_the_mean():
    """Thresholds that differ by 22 %: one pixel in a thousand has most of the events."""
    sources = NoisySources(
        rms=0.1, cutoff_hz=2200, dark_cutoff_hz=86, follower_hz=100, mismatch=0.044,
        dead_time_s=5e-4,
    )  # fmt: skip
    light, many = np.array([120.0 / 255.0]), 101
    rates = noise_rates(sources, light)
    away = np.linspace(-5.0, 4.0, many)
    on, off = (np.maximum(level + 0.044 * away, 0.01) for level in (sources.on, sources.off))
    law = _laws(sources, light, np.zeros(1))[0]
    weights = np.exp(-0.5 * away**2)
    weights /= weights.sum()
    found = law.rates(np.repeat(on, many), np.tile(off, many))
    means = found @ np.outer(weights, weights).ravel()
    assert rates.mean(True)[0] == pytest.approx(means[0], rel=0.02)
    assert rates.mean(False)[0] == pytest.approx(means[1], rel=0.02)
    assert rates.median(True)[0] < 0.01 * rates.mean(True)[0]


@pytest.mark.thorough
def test_a_mean_over_few_pixels_is_that_of_their_own_thresholds():
    """In the bright few pixels have all events, and how many of them there are is chance."""
    sources = NoisySources(
        rms=0.06, cutoff_hz=156, dark_cutoff_hz=156, follower_hz=60, off=0.227, mismatch=0.062,
        dead_time_s=5e-4,
    )  # fmt: skip
    seconds, pixels = 8.0, ROWS * COLUMNS
    on, off, spare = np.zeros((3, pixels))
    fill_levels(0, pixels, 1, sources.on, sources.off, sources.mismatch, FLOOR, on, off, spare)
    found = _laws(sources, np.ones(1), np.zeros(1))[0].rates(on, off)
    counts = simulated(sources, seconds, seed=1)[::-1] / (0.5 * seconds)
    busiest = np.argsort(found.sum(axis=0))[-10:]
    assert counts[:, busiest].sum() > 0.5 * counts.sum()
    assert found[:, busiest].mean(axis=1) == pytest.approx(
        counts[:, busiest].mean(axis=1), rel=0.15
    )
