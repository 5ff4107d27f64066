"""Hot pixels: their share and rates."""

from __future__ import annotations

import numpy as np
import pytest
from harness import PIXELS, SECONDS, at_rest, quiet, within
from scipy import stats

from adv2e.config.model import (
    HotPixels,
    LowPass,
    PhotoreceptorNoise,
    SourceFollower,
    Thresholds,
)


def test_hot_pixels():
    pixel = quiet(hot_pixels=HotPixels(fraction=0.1, rate_hz=20.0), initial_reference="random")
    events, _ = at_rest(90.0, pixel)
    hot = np.unique(events["x"])
    assert within(hot.size, 0.1 * PIXELS)
    assert within(len(events), hot.size * SECONDS * 20.0)
    assert events["p"].all()


def test_rates_of_hot_pixels_are_spread_over_decades():
    hot = HotPixels(fraction=0.5, rate_hz=100.0, spread=0.6)
    events, _ = at_rest(0.0, quiet(hot_pixels=hot))
    rates = np.bincount(events["x"], minlength=PIXELS) / SECONDS
    logs = np.log10(rates[rates > 0])
    assert events["p"].all()
    assert within(logs.size, PIXELS * 0.5)
    deviations = stats.kstest(logs, stats.norm(2.0, 0.6).cdf).statistic
    assert deviations < 2.0 / np.sqrt(logs.size)


SOLVERS = {
    "lanes": {},
    "second pole": {"source_follower": SourceFollower(cutoff_hz=200.0)},
    "noise": {"photoreceptor_noise": PhotoreceptorNoise(rms=1e-3)},
    "in steps": {"low_pass": LowPass(update="euler")},
    "no filter": {"low_pass": None},
}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.quick_cases(1)
def test_some_hot_pixels_are_off(solver):
    """By a count of pixels and events that shares no code with the draws; ON ones stay as are."""
    found = {}
    for share in (0.0, 0.3):
        hot = HotPixels(fraction=0.4, rate_hz=20.0, off_fraction=share)
        events, _ = at_rest(90.0, quiet(hot_pixels=hot, **SOLVERS[solver]))
        on = np.bincount(events["x"][events["p"] == 1], minlength=PIXELS)
        found[share] = on, np.bincount(events["x"], minlength=PIXELS) - on
    (on_alone, none), (on, off) = found.values()
    assert not none.any()
    assert not (on * off).any()  # a pixel has one polarity
    assert np.array_equal(on + off > 0, on_alone > 0)
    assert within(np.count_nonzero(off), 0.3 * np.count_nonzero(on_alone))
    assert within(off.sum(), np.count_nonzero(off) * SECONDS * 20.0)


def test_off_events_do_not_vanish_in_bright_light():
    """Those of other noise do; of hot pixels as many are left at every brightness."""
    hot = HotPixels(fraction=0.05, rate_hz=10.0, off_fraction=0.5)
    pixel = quiet(
        hot_pixels=hot,
        photoreceptor_noise=PhotoreceptorNoise(rms=0.08),
        source_follower=SourceFollower(cutoff_hz=50.0),
        thresholds=Thresholds(mismatch=0.01),
        low_pass=LowPass(cutoff_hz=5000.0),
    )
    off = {}
    for dn in (2.0, 255.0):
        events, _ = at_rest(dn, pixel)
        off[dn] = np.count_nonzero(events["p"] == 0)
    assert off[2.0] > 3 * off[255.0]
    assert off[255.0] / (PIXELS * SECONDS) == pytest.approx(0.05 * 0.5 * 10.0, rel=0.25)
