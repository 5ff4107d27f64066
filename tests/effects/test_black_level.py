"""Black level: light added to the frames, and below black where they are clipped."""

from __future__ import annotations

import numpy as np
from through_hooks import run, still

from adv2e.effects.frames.black_level import BlackLevelHooks


def test_black_level_is_added_and_light_stays_at_or_above_zero():
    assert run(BlackLevelHooks(2.5), still(0, 10))[1][:, 0, 0].tolist() == [2.5, 12.5]
    assert run(BlackLevelHooks(-4.0), still(3, 10))[1][:, 0, 0].tolist() == [0.0, 6.0]


def test_light_falls_on_where_frames_are_clipped():
    light = np.full((9, 12), 20.0, np.float32)
    light[2:7, 3:10] = 0.0
    below = 9.0 - run(BlackLevelHooks(9.0, 6.0), [(0, light)])[1][0]
    clipped = light == 0.0
    assert np.all(below[~clipped] == -20.0)
    # one, two and three pixels from what is not clipped
    expected = 6.0 * (1.0 - np.exp(-np.array([1.0, 2.0, 3.0]) / 1.5))
    np.testing.assert_allclose(below[4, 3:6], expected, rtol=1e-5)
    np.testing.assert_allclose(below[2, 3:10], expected[0], rtol=1e-5)
    everywhere = run(BlackLevelHooks(9.0, 6.0), [(0, np.zeros_like(light))])[1][0]
    np.testing.assert_allclose(everywhere, 3.0)
    assert run(BlackLevelHooks(2.0, 6.0), [(0, light)])[1].min() == 0.0
