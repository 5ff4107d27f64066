"""Misregistration: the picture shifted by splines of its contrast."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import shift as spline_shift
from through_hooks import run

from adv2e.effects.frames.misregistration import MisregistrationHooks


def test_shift_by_whole_pixels_takes_from_the_right_and_below():
    light = np.arange(12, dtype=np.float32).reshape(3, 4) + 1
    found = run(MisregistrationHooks((1.0, 0.0)), [(0, light)])[1][0]
    assert found.tolist() == light[:, [1, 2, 3, 3]].tolist()
    found = run(MisregistrationHooks((0.0, -1.0)), [(0, light)])[1][0]
    assert found.tolist() == light[[0, 0, 1]].tolist()


@pytest.mark.parametrize("shift", [(0.4, -0.7), (-2.5, 0.0), (0.0, 3.1)])
def test_shift_by_parts_of_a_pixel_is_exact_for_smooth_contrast(shift):
    x, y = np.meshgrid(np.arange(40.0), np.arange(36.0))

    def light(x, y):
        return 20.0 * np.exp(0.04 * x + 0.5 * np.sin(0.5 * x + 0.3 * y))

    right, below = shift
    found = run(MisregistrationHooks(shift), [(0, light(x - right, y - below))])[1][0]
    inside = (slice(12, -12), slice(12, -12))
    np.testing.assert_allclose(found[inside], light(x, y)[inside], rtol=4e-4)
    assert np.all(found > 0)


def test_shift_is_that_of_quintic_splines():
    x, y = np.meshgrid(np.arange(50.0), np.arange(46.0))
    contrast = 0.6 * np.sin(0.9 * x + 0.2 * y)
    by = spline_shift(contrast, (-0.3, -0.45), order=5, mode="nearest")
    found = run(MisregistrationHooks((0.45, 0.3)), [(0, np.exp(3.0 + contrast))])[1][0]
    np.testing.assert_allclose(np.log(found[18:-18, 18:-18]) - 3.0, by[18:-18, 18:-18], atol=1e-5)


@pytest.mark.parametrize("part", [0.2, 0.5, 0.85])
def test_shifted_edges_do_not_ring(part):
    x = np.arange(30.0)
    edge = 5.0 + 195.0 * (0.5 + 0.5 * np.tanh(1.5 * (x - 15.3)))
    rows = np.tile(edge, (6, 1))
    for light, way in ((rows, (part, 0.0)), (rows[:, ::-1], (part, 0.0)), (rows.T, (0.0, part))):
        found = np.log(run(MisregistrationHooks(way), [(0, light)])[1][0])
        assert found.max() <= np.log(light.max()) + 0.02
        assert found.min() >= np.log(light.min()) - 0.02


def test_shift_keeps_black_beside_white_above_zero():
    light = np.zeros((5, 9), np.float32)
    light[:, 5:] = 255.0
    found = run(MisregistrationHooks((0.5, 0.5)), [(0, light)])[1][0]
    assert found.min() > 0
    assert found.dtype == np.float32
