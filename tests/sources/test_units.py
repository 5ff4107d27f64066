"""Units of times: told apart, or doubted, never taken for another one in silence."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.sources.times.units import UNITS, Unit, event_unit, frame_unit

UNIT = st.sampled_from(list(UNITS))
EPOCH_S = 1_468_941_032


def decimals(times_s, unit, digits):
    """Times as a list has them: in `unit`, with so many digits behind the point."""
    return [Decimal(f"{time * 1e9 / UNITS[unit]:.{digits}f}") for time in times_s]


@given(
    unit=UNIT,
    fps=st.floats(15, 1000),
    begin_s=st.sampled_from([0.0, 0.5, 3600.0]) | st.floats(0, 9e5),
    jitter=st.floats(0, 0.2),
    count=st.integers(3, 40),
    digits=st.sampled_from([0, 3, 6, 9]),
)
def test_frames_are_read_in_their_unit_or_doubted(unit, fps, begin_s, jitter, count, digits):
    rng = np.random.default_rng(count)
    steps = (1 + jitter * rng.uniform(-1, 1, count)) / fps
    digits = max(digits, {"s": 4, "ms": 1}.get(unit, 0))
    found = frame_unit(decimals(begin_s + np.cumsum(steps), unit, digits))
    assert found.name == unit or found.doubt
    if fps < 800:
        assert found.name == unit
    if unit == "s":
        assert not found.doubt


@given(unit=UNIT, fps=st.floats(15, 900))
def test_dates_tell_their_unit_beyond_doubt(unit, fps):
    times = [EPOCH_S * 10**9 + round(n * 1e9 / fps) for n in range(10)]
    found = frame_unit([Decimal(time) / UNITS[unit] for time in times])
    assert found == Unit(unit)


@pytest.mark.parametrize(
    ("times", "unit", "doubted"),
    [
        ([0, 20_000, 40_000], "us", True),
        ([0, 33, 67, 100], "ms", True),
        ([0, 5, 10], "ms", True),
        ([0, 33_366_667, 66_733_333], "ns", True),
        (["0.0", "33.3", "66.6"], "ms", True),
        (["0.0", "0.0333", "0.0667"], "s", False),
        (["0.0", "0.0002", "0.0004"], "s", False),
        (["0.0", "0.000003", "0.000006"], "s", True),
        ([0, 1, 2, 3], "s", True),
        ([0, 1, 3], "s", True),
        ([EPOCH_S, EPOCH_S + 30, EPOCH_S + 60], "s", True),
        ([5], "s", False),
    ],
)
def test_frames_by_the_number_between_them(times, unit, doubted):
    found = frame_unit([Decimal(time) for time in times])
    assert (found.name, bool(found.doubt)) == (unit, doubted)
    assert not doubted or "--time-unit" in found.doubt


def test_the_user_has_the_last_word_and_the_file_the_one_before():
    times = [Decimal(n) for n in (0, 33, 67)]
    assert frame_unit(times, given="us", stated="ns") == Unit("us")
    assert frame_unit(times, stated="ms") == Unit("ms")
    assert "is that right" in frame_unit(times, stated="s").doubt
    assert frame_unit([Decimal("0.5"), Decimal("0.6")], stated="ns").doubt


def test_lists_that_are_usually_in_microseconds():
    def found(step):
        return frame_unit([Decimal(n) * Decimal(step) for n in range(4)], usual="us")

    assert found(41_667) == Unit("us")
    assert (found(500).name, bool(found(500).doubt)) == ("us", True)
    assert (found("0.033").name, bool(found("0.033").doubt)) == ("s", True)
    assert (found(10).name, bool(found(10).doubt)) == ("ms", True)


@pytest.mark.parametrize(("own_s", "told"), [(0.033, False), (0.004, False), (33.0, True)])
def test_a_thousandfold_from_the_video_itself_is_told(own_s, told):
    times = [Decimal(f"{0.0333 * n:.4f}") for n in range(5)]
    assert ("the video's own" in frame_unit(times, own_step_s=own_s).doubt) is told


# events


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
