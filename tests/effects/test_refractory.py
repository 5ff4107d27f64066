"""Refractory period: no event within it, and the reference is the signal at its end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from harness import pure, solve
from test_hook_contract import COLUMNS
from test_hook_contract import events as events_of

from adv2e.config.model import Refractory


def test_dead_time_is_the_shortest_interval():
    fast = events_of("pixel.refractory.period_us=1700", "pixel.thresholds={on: 0.05, off: 0.05}")
    pixels = fast["y"].astype(np.int64) * COLUMNS + fast["x"]
    order = np.lexsort((fast["t"], pixels))
    apart = np.diff(fast["t"][order])[np.diff(pixels[order]) == 0]
    assert 1699 <= apart.min() < 1750


@pytest.mark.parametrize(("period_us", "dead_s"), [(None, 0.0), (700.0, 7e-4), (9000.0, 9e-3)])
@pytest.mark.parametrize("method", ["auto", "stepped"])
def test_the_way_to_the_next_event_begins_when_the_dead_time_ends(period_us, dead_s, method):
    slope = math.log(50.0) / 0.1
    refractory = Refractory(period_us=period_us) if period_us else None
    pixel = pure(low_pass=None, refractory=refractory)
    (events,) = solve(np.array([[4.0], [200.0]]), [0.0, 0.1], pixel, method=method)
    expected = np.arange(0.2 / slope, 0.1, 0.2 / slope + dead_s)
    np.testing.assert_allclose(events[:, 0], expected, atol=1e-6)
