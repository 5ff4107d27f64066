"""Drift of the thresholds: against plain differences in steps of 1 us."""

from __future__ import annotations

import pytest
from harness import pure, quiet, solve
from reference.differences import LIGHT, TIMES, Truth, check
from test_contract import events

from adv2e.config.model import Refractory, Thresholds
from adv2e.errors import ConfigError

DEAD = {"refractory": Refractory(period_us=900.0)}


@pytest.mark.parametrize("per_s", [-8.0, 6.0])
@pytest.mark.quick_cases(1)
def test_threshold_drift(per_s):
    thresholds = Thresholds(on=0.2, off=0.15, mismatch=0.0, drift_per_s=per_s)
    found = solve(LIGHT, TIMES, pure(thresholds=thresholds, **DEAD))
    truth = Truth.of_light(LIGHT, TIMES)
    expected = truth.events(off=0.15, dead_s=9e-4, factor=lambda t: 1 + per_s * t)
    check(found, expected)
    assert sum(map(len, found)) != sum(map(len, truth.events(off=0.15, dead_s=9e-4)))


def test_thresholds_that_drift_to_zero_are_an_error():
    thresholds = Thresholds(drift_per_s=-30.0)
    with pytest.raises(ConfigError, match=r"drift_per_s: -30 1/s .* 0\.0333 s after"):
        solve(LIGHT, TIMES, pure(thresholds=thresholds))


def test_drift_does_something_and_is_none_by_default():
    drifting = quiet(thresholds=Thresholds(mismatch=0.0, drift_per_s=4.0))
    assert events(drifting).tobytes() != events(quiet()).tobytes()
    assert Thresholds().drift_per_s == 0.0
