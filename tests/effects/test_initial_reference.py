"""Initial reference: where pixels are when the first frame comes."""

from __future__ import annotations

import numpy as np
import pytest
from harness import PIXELS, advance, at_rest, pure, quiet, solve, start
from scipy import stats

from adv2e.config.model import (
    HighPass,
    Leak,
    LowPass,
    PhotoreceptorNoise,
    Refractory,
    ShotNoise,
    SourceFollower,
    Thresholds,
)
from adv2e.kernel import per_pixel


def test_random_reference_is_uniform_between_the_thresholds():
    pixel = quiet(initial_reference="random")
    light = np.full((2, 1, PIXELS), 100, np.float32)
    array = start(light, [0], pixel)
    offset = (
        array.state[per_pixel.X] - array.state[per_pixel.REFERENCE]
    ) / 0.2  # signal minus reference
    assert stats.kstest(offset, stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_settled_pixels_remember_the_first_frame():
    """All leak a whole period before they fire, and need a whole threshold."""
    leak = Leak(rate_hz=4.0, jitter=0.0)
    _, exact = at_rest(90.0, quiet(leak=leak, initial_reference="settled"), 0.45, pixels=50)
    np.testing.assert_allclose(exact, np.full(50, 0.25e6), atol=1.0)
    rising = np.array([[10.0], [10.0 * np.exp(0.5)]])
    (events,) = solve(rising, [0.0, 1.0], pure(low_pass=None))
    np.testing.assert_allclose(events[:, 0], [0.4, 0.8], atol=1e-6)


LATER = 12
"""Seconds after which pixels that were settled count as having run."""

CASES = {
    "two poles": {},
    "one pole": {"source_follower": None, "photoreceptor_noise": PhotoreceptorNoise(rms=0.05)},
    "fast second pole": {
        "source_follower": SourceFollower(cutoff_hz=900.0),
        "photoreceptor_noise": PhotoreceptorNoise(rms=0.045),
    },
    "uneven": {"thresholds": Thresholds(on=0.18, off=0.24, mismatch=0.03)},
    "no dead time": {"refractory": None},
    "leak": {"leak": Leak(rate_hz=0.5, jitter=0.2)},
    "long dead time": {"refractory": Refractory(period_us=2e4), "leak": Leak(rate_hz=1.0)},
    "shot noise": {"shot_noise": ShotNoise(rate_hz=0.5)},
    "high-pass": {
        "high_pass": HighPass(cutoff_hz=10.0),
        "photoreceptor_noise": PhotoreceptorNoise(rms=0.07),
    },
    "high-pass, one pole": {
        "high_pass": HighPass(cutoff_hz=10.0),
        "source_follower": None,
        "photoreceptor_noise": PhotoreceptorNoise(rms=0.055),
        "leak": Leak(rate_hz=0.5),
    },
    "in steps": {"low_pass": LowPass(update="euler"), "source_follower": None},
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.quick_cases(1)
def test_noise_of_the_first_second_is_that_of_all_others(name):
    """As of pixels that began settled and have forgotten it, which no draw from a law decides."""
    given = {
        "thresholds": Thresholds(on=0.19, off=0.2, mismatch=0.03),
        "refractory": Refractory(),
        "photoreceptor_noise": PhotoreceptorNoise(rms=0.06),
        "source_follower": SourceFollower(cutoff_hz=100.0),
        **CASES[name],
    }
    counts = {}
    for reference in ("settled", "running"):
        pixel = quiet(**given, initial_reference=reference)
        light = np.full((2, 1, PIXELS), 25.0, np.float32)
        array = start(light, [0], pixel, seed=5)
        each = []
        for k in range(LATER + 6 if reference == "settled" else 1):
            events, _ = advance(array, light, [k * 10**9, (k + 1) * 10**9])
            pixels = np.bincount(events["x"][events["p"] == 1], minlength=PIXELS)
            each.append((pixels, np.bincount(events["x"], minlength=PIXELS) - pixels))
        counts[reference] = np.array(each)
    later, first = counts["settled"][LATER:], counts["running"][0]
    if name == "two poles":  # what is to be told apart
        assert counts["settled"][0].sum() > 1.5 * later.sum(axis=(1, 2)).mean()
    for polarity in range(2):
        one, other = first[polarity], later[:, polarity].mean(axis=0)
        # pixels differ, so the spread is theirs; what is drawn for 200 steps leaves some percent
        slack = 4.0 * np.hypot(one.std(), other.std()) / np.sqrt(PIXELS)
        assert one.mean() == pytest.approx(other.mean(), abs=slack + 0.04 * other.mean())


def test_what_noise_has_done_before_is_drawn_pixel_by_pixel():
    pixel = quiet(
        photoreceptor_noise=PhotoreceptorNoise(rms=0.06), leak=Leak(),
        initial_reference="running", refractory=Refractory(),
    )  # fmt: skip
    light = np.full((2, 1, 900), 100, np.float32)
    first, *others = (
        start(light[:, :, :n], [0], pixel, threads=threads, causes=True).state
        for n, threads in ((900, 1), (900, 3), (300, 2))
    )
    for other in others:
        assert np.array_equal(other, first[:, : other.shape[1]])
