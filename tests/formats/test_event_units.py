"""Units of events' times: told apart, or doubted, never taken for another one in silence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.formats.columns import event_unit
from adv2e.sources.times.rates import UNITS, Unit

UNIT = st.sampled_from(list(UNITS))
EPOCH_S = 1_468_941_032


def stream(rate_hz, count, unit, *, whole, begin_s=0.0, seed=0):
    """Times of events as a file has them, from a clock that ticks in microseconds."""
    rng = np.random.default_rng(seed)
    us = np.sort(rng.integers(0, max(2, round(count * 1e6 / rate_hz)), count)) + round(
        begin_s * 1e6
    )
    if whole:
        return us * 1000 // UNITS[unit]
    return us / (UNITS[unit] / 1000)


@given(
    unit=UNIT,
    rate=st.floats(3, 7),
    count=st.sampled_from([200, 5000]),
    whole=st.booleans(),
    begin_s=st.sampled_from([0.0, 12.5, EPOCH_S]),
    pixels=st.sampled_from([32 * 32, 240 * 180, 346 * 260, 1280 * 720]),
)
def test_events_are_read_in_their_unit_or_doubted(unit, rate, count, whole, begin_s, pixels):
    whole = whole and unit != "s"
    times = stream(10**rate, count, unit, whole=whole, begin_s=begin_s)
    found = event_unit(times, pixels, whole=whole)
    assert found.name == unit or found.doubt


@pytest.mark.parametrize("rate_hz", [1e4, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("begin_s", [0, EPOCH_S])
def test_the_usual_units_are_read_rightly(rate_hz, begin_s):
    pixels = 240 * 180
    seconds = event_unit(stream(rate_hz, 5000, "s", whole=False), pixels, whole=False)
    assert seconds == Unit("s")
    whole = event_unit(stream(rate_hz, 5000, "us", whole=True, begin_s=begin_s), pixels, whole=True)
    assert whole.name == "us"
    assert bool(whole.doubt) is (begin_s == 0)


def test_dates_in_floats_tell_the_unit_of_events():
    times = stream(1e5, 1000, "ms", whole=False, begin_s=EPOCH_S)
    assert event_unit(times, 43_200, whole=False) == Unit("ms")


def test_few_events_are_in_the_usual_unit():
    assert event_unit(np.array([1500, 1_468_941_032_229_165]), 5, whole=True).name == "us"
    assert event_unit(np.array([0.5, 0.6]), 5, whole=False) == Unit("s")


def test_frames_beside_events_decide():
    times = stream(1e5, 1000, "ms", whole=True)
    assert event_unit(times, 43_200, whole=True, beside=Unit("ms", "doubt")) == Unit("ms")


@pytest.mark.parametrize(
    ("unit", "whole", "found"),
    [
        ("ms", True, "ms"),
        ("ms", False, "ms"),
        ("us", True, "us"),
        ("us", False, "us"),
        ("ns", True, "us"),  # 200 events a second are few for a sensor, but may be
    ],
)
def test_typical_streams_in_other_units_are_told(unit, whole, found):
    result = event_unit(stream(2e5, 5000, unit, whole=whole), 346 * 260, whole=whole)
    assert (result.name, "taken as" in result.doubt) == (found, True)
