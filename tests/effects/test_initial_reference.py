"""Initial reference: where pixels are when the first frame comes."""

from __future__ import annotations

import numpy as np
from harness import PIXELS, at_rest, pure, quiet, solve, start
from scipy import stats

from adv2e.config.model import Leak
from adv2e.kernel import per_pixel


def test_random_reference_is_uniform_between_the_thresholds():
    pixel = quiet(initial_reference="random")
    light = np.full((2, 1, PIXELS), 100, np.float32)
    array = start(light, [0], pixel)
    offset = (
        array.state[per_pixel.X] - array.state[per_pixel.REFERENCE]
    ) / 0.2  # signal minus reference
    assert stats.kstest(offset, stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_settled_pixels_remember_the_first_frame():
    """All leak a whole period before they fire, and need a whole threshold."""
    leak = Leak(rate_hz=4.0, jitter=0.0)
    _, exact = at_rest(90.0, quiet(leak=leak, initial_reference="settled"), 0.45, pixels=50)
    np.testing.assert_allclose(exact, np.full(50, 0.25e6), atol=1.0)
    rising = np.array([[10.0], [10.0 * np.exp(0.5)]])
    (events,) = solve(rising, [0.0, 1.0], pure(low_pass=None))
    np.testing.assert_allclose(events[:, 0], [0.4, 0.8], atol=1e-6)
