"""Logarithmic response and its linear foot: events at equal steps of x, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from harness import quiet, solve

from adv2e.config.model import LogResponse
from adv2e.errors import ConfigError


@pytest.mark.parametrize(
    ("linear_below", "light", "change"),
    [
        (20.0, (2.0, 18.0), 16.0 * math.log(20.0) / 20.0),
        (20.0, (5.0, 200.0), math.log(200.0) - 0.25 * math.log(20.0)),
        (math.e, (0.5, 2.5), 2.0 / math.e),
        (0.0, (5.0, 200.0), math.log(40.0)),
        (0.0, (0.02, 10.0), math.log(100.0)),  # from the floor, 0.1 DN
    ],
)
def test_x_is_the_logarithm_above_the_knee_and_a_line_below(linear_below, light, change):
    pixel = quiet(log_response=LogResponse(linear_below=linear_below, floor=0.1), low_pass=None)
    up, down = solve(np.array([light, light[::-1]]).T, [0.0, 0.01], pixel)
    expected = 0.01 * np.arange(0.2, change, 0.2) / change
    np.testing.assert_allclose(up[:, 0], expected, atol=1e-6)
    np.testing.assert_allclose(down[:, 0], expected, atol=1e-6)
    assert set(up[:, 1]) == {1}
    assert set(down[:, 1]) == {-1}


@pytest.mark.parametrize("linear_below", [0.5, 1.0])
def test_a_foot_that_would_not_rise_is_an_error(linear_below):
    with pytest.raises(ConfigError, match="would not rise"):
        LogResponse(linear_below=linear_below)
