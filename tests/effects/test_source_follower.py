"""Source follower: a pole of the same corner at every brightness, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from harness import pure, solve
from reference.closed_forms import times_behind_a_pole

from adv2e.config.model import SourceFollower


@pytest.mark.parametrize("white", [8.0, 255.0])
@pytest.mark.parametrize("method", ["auto", "stepped"])
def test_it_follows_a_ramp_as_a_pole_does_at_every_brightness(white, method):
    pixel = pure(low_pass=None, source_follower=SourceFollower(cutoff_hz=40.0))
    light, times = np.array([[white / 20.0], [white], [white]]), [0.0, 0.02, 0.12]
    (events,) = solve(light, times, pixel, method=method)
    expected = times_behind_a_pole(math.log(20.0), 0.02, 40.0, 0.2, 0.12)
    assert len(expected) == 14
    np.testing.assert_allclose(events[:, 0], expected, atol=1e-6)
    assert (events[:, 1] == 1).all()
