"""Slew limit: against plain differences in steps of 1 us, and of any light."""

from __future__ import annotations

import numpy as np
import pytest
from harness import effect, pure, quiet, solve
from hypothesis import example, given, settings
from hypothesis import strategies as st
from reference.differences import LIGHT, TIMES, Truth, check

from adv2e.config.model import LowPass, Pixel, SlewLimit, SourceFollower, Thresholds
from adv2e.errors import ConfigError

MANY = st.lists(
    st.lists(st.floats(0.0, 255.0, width=32), min_size=3, max_size=3), min_size=2, max_size=6
)


@pytest.mark.parametrize("per_s", [15.0, 40.0, 120.0])
@pytest.mark.parametrize("follower_hz", [None, 250.0])
@pytest.mark.quick_cases(1)
def test_slew_limit(per_s, follower_hz):
    sections = {"slew_limit": SlewLimit(per_s=per_s)}
    if follower_hz:
        sections["source_follower"] = SourceFollower(cutoff_hz=follower_hz)
    truth = Truth.of_light(LIGHT, TIMES, slew=per_s, follower_hz=follower_hz)
    check(solve(LIGHT, TIMES, pure(**sections)), truth.events(), least=20)


def test_slew_limit_of_no_account_changes_nothing(monkeypatch):
    monkeypatch.setattr("adv2e.pixel.steps._BEND_US", np.inf)  # steps as without it
    shape = 1, LIGHT.shape[1]
    # a course of each pixel, so that one pole is not made by itself, in another order of rounding
    nothing = effect(shape, 100.0, signal=lambda t: np.zeros((len(t), *shape)))
    found = solve(LIGHT, TIMES, pure(slew_limit=SlewLimit(per_s=1e6)), hooks=[nothing])
    plain = solve(LIGHT, TIMES, pure(), hooks=[nothing])
    assert all(np.array_equal(a, b) for a, b in zip(found, plain, strict=True))


def test_slew_limit_holds_for_the_stepped_forms_too():
    """A step of the light becomes a ramp whatever the update."""
    light = np.array([[2.0], [200.0], [200.0]])
    slew = SlewLimit(per_s=40.0)
    for update in ("first_order_hold", "zero_order_hold", "euler"):
        low_pass = LowPass(cutoff_hz=3000.0, update=update)
        events = solve(light, [0.0, 0.001, 0.2], pure(low_pass=low_pass, slew_limit=slew), K=200)
        np.testing.assert_allclose(np.diff(events[0][2:18, 0]), 0.2 / 40.0, rtol=1e-6)


@settings(max_examples=60, deadline=None)
@given(light=MANY, slew=st.floats(5.0, 200.0), threshold=st.floats(0.05, 0.5))
@example(  # ends its ramp within a step, just before an event
    light=[[255.0, 0, 0], [71.0, 0, 0], [208.0, 0, 0], [8.0, 0, 0]], slew=90.0, threshold=0.19140625
)
def test_slew_limit_keeps_events_apart(light, slew, threshold):
    """No two events of one polarity are nearer than the limit allows, but for 1 us."""
    times = np.arange(len(light)) * 0.01
    pixel = quiet(
        slew_limit=SlewLimit(per_s=slew),
        thresholds=Thresholds(on=threshold, off=threshold, mismatch=0.0),
    )
    for events in solve(np.array(light), times, pixel):
        passed = threshold * np.cumsum(events[:, 1])
        assert np.all(np.abs(passed) <= slew * (events[:, 0] + 1e-6))
        gaps, moved = np.diff(events[:, 0]), np.abs(np.diff(passed))
        same = events[1:, 1] == events[:-1, 1]
        assert np.all(moved[same] <= slew * (gaps[same] + 1e-6))


def test_a_slew_limit_without_the_filter_that_it_limits_is_an_error():
    with pytest.raises(ConfigError, match=r"slew_limit: .*low_pass"):
        Pixel(low_pass=None, slew_limit=SlewLimit(per_s=40.0))
