"""Pixels that see no change, and how often they fire."""

from __future__ import annotations

import numpy as np
from experiments.recordings import still_pixels, still_rate

from adv2e.events import make_events

WIDTH, HEIGHT = 16, 12


def test_still_pixels_keep_away_from_those_that_change():
    frames = np.full((5, HEIGHT, WIDTH), 100.0, np.float32)
    frames[1::2, 3, 2] = 110
    frames[:, 9, 14] += np.arange(5)  # a standard deviation of 1.4
    still = still_pixels(iter(frames))
    expected = np.ones((HEIGHT, WIDTH), bool)
    expected[:8, :7] = False
    assert np.array_equal(still, expected)
    events = make_events([1, 2, 3], [2, 14, 15], [3, 9, 11], [1, 0, 1])
    assert still_rate(events, still, 0.5) == 2 / (136 * 0.5)
