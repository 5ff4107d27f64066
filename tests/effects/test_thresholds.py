"""Thresholds and their mismatch: when the first event of a steady change comes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from harness import pure, solve
from scipy import stats

from adv2e.config.model import Thresholds


def first_events(thresholds, change, pixels=3000):
    """Return how far the signal of each pixel has moved by its first event [ln]."""
    light = np.full((2, pixels), 10.0)
    light[1] *= math.exp(change)
    found = solve(light, [0.0, 1.0], pure(low_pass=None, thresholds=thresholds))
    return abs(change) * np.array([events[0, 0] for events in found])


def test_each_pixel_has_thresholds_of_its_own_drawn_from_a_normal_distribution():
    thresholds = Thresholds(on=0.3, off=0.2, mismatch=0.03)
    on, off = first_events(thresholds, 1.0), first_events(thresholds, -1.0)
    assert stats.kstest(on, stats.norm(0.3, 0.03).cdf).pvalue > 1e-3
    assert stats.kstest(off, stats.norm(0.2, 0.03).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(on, off)[0, 1]) < 4.0 / math.sqrt(on.size)


def test_no_threshold_is_below_a_hundredth():
    on = first_events(Thresholds(on=0.05, mismatch=0.1), 1.0)
    assert on.min() == pytest.approx(0.01, abs=1e-6)
    share = stats.norm(0.05, 0.1).cdf(0.01)
    assert np.mean(on < 0.010001) == pytest.approx(share, abs=4.0 * math.sqrt(share / on.size))
