"""Shot noise: its rate by light, its polarities and times, and what dead time leaves."""

from __future__ import annotations

import numpy as np
import pytest
from harness import PIXELS, SECONDS, at_rest, quiet, within
from scipy import stats

from adv2e.config.model import Refractory, ShotNoise


@pytest.mark.parametrize("dn", [0.0, 40.0, 255.0])
def test_shot_noise(dn):
    pixel = quiet(shot_noise=ShotNoise(rate_hz=3.0), initial_reference="random")
    events, _ = at_rest(dn, pixel)
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
    events, exact = at_rest(0.0, pixel, seconds=2.0, pixels=300)
    assert within(len(events), 300 * 2.0 * 100 / (1 + 100 * 2e-3))
    for x in range(20):
        assert np.diff(np.sort(exact[events["x"] == x])).min() >= 2000.0
