"""Hot pixels: their share and rates."""

from __future__ import annotations

import numpy as np
from harness import PIXELS, SECONDS, at_rest, quiet, within
from scipy import stats

from adv2e.config.model import HotPixels


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
