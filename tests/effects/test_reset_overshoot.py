"""Reset overshoot: against plain differences in steps of 1 us."""

from __future__ import annotations

import numpy as np
import pytest
from harness import effect, pure, solve
from reference.differences import LIGHT, TIMES, Truth, check

from adv2e.config.model import Refractory, ResetOvershoot
from adv2e.effects.hooks import INJECTED_DTYPE
from adv2e.errors import ConfigError


@pytest.mark.parametrize("fraction", [-0.3, 0.15, 0.4])
@pytest.mark.parametrize("dead_us", [None, 900.0])
@pytest.mark.quick_cases(1)
def test_reset_overshoot_and_noise_events(fraction, dead_us):
    noise = [(0.0031, 2, 1), (0.00312, 2, -1), (0.02004, 7, -1), (0.0391, 2, -1)]
    sections = {"reset_overshoot": ResetOvershoot(fraction=fraction)}
    if dead_us:
        sections["refractory"] = Refractory(period_us=dead_us)

    def inject(t0, t1):
        rows = [(t, i, 0, p > 0) for t, i, p in noise if t0 <= t < t1]
        return np.array(rows, INJECTED_DTYPE)

    options = {
        "hooks": [effect((1, LIGHT.shape[1]), inject=inject)],
        "chunk": 3,
    }
    found = solve(LIGHT, TIMES, pure(**sections), **options)
    dead_s = dead_us and dead_us * 1e-6
    truth = Truth.of_light(LIGHT, TIMES).events(dead_s=dead_s, overshoot=fraction, noise=noise)
    check(found, truth)


def test_an_overshoot_of_a_whole_threshold_is_an_error():
    with pytest.raises(ConfigError, match=r"fraction: must be at most 0\.9"):
        ResetOvershoot(fraction=1.0)
