"""Clock drift: stamps of the frames stretched from the first frame on."""

from __future__ import annotations

import numpy as np
from through_hooks import run

from adv2e.effects.frames.clock_drift import ClockDriftHooks


def test_clock_drift_stretches_from_the_first_frame():
    frames = [(5_000_000_000 + 1_000_000_000 * k, np.zeros((1, 1))) for k in range(3)]
    slow = run(ClockDriftHooks(100.0), frames)[0]
    assert [t - 5_000_000_000 for t in slow] == [0, 1_000_100_000, 2_000_200_000]
