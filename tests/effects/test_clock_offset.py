"""Clock offset: stamps of the frames too late or too early by a constant."""

from __future__ import annotations

import numpy as np
from through_hooks import run

from adv2e.effects.frames.clock_offset import ClockOffsetHooks


def test_clock_offset_moves_all_frames():
    frames = [(5_000_000_000 + 1_000_000_000 * k, np.zeros((1, 1))) for k in range(3)]
    later = run(ClockOffsetHooks(-250.5), frames)[0]
    assert later == [t - 250_500 for t, _ in frames]
