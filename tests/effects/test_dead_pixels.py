"""Dead pixels: a share of the pixels is silent."""

from __future__ import annotations

import numpy as np
from through_hooks import COLUMNS, ROWS, bursts, out_of

from adv2e.effects.pixel.dead_pixels import DeadPixels, DeadPixelsHooks


def test_dead_pixels_are_silent_and_the_others_as_they_were():
    events = bursts(2, 20_000, 100_000)
    found = out_of(DeadPixelsHooks(DeadPixels(fraction=0.3)), events)
    pixels = events["y"].astype(int) * COLUMNS + events["x"]
    left = np.unique(found["y"].astype(int) * COLUMNS + found["x"])
    assert 0.5 < len(left) / (ROWS * COLUMNS) < 0.9
    assert found.tobytes() == events[np.isin(pixels, left)].tobytes()
