"""Units of times: told apart, or doubted, never taken for another one in silence."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.sources.times.rates import UNITS, Unit, frame_unit

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


@pytest.mark.parametrize(("own_s", "told"), [(0.033, False), (0.004, False), (33.0, True)])
def test_a_thousandfold_from_the_video_itself_is_told(own_s, told):
    times = [Decimal(f"{0.0333 * n:.4f}") for n in range(5)]
    assert ("the video's own" in frame_unit(times, own_step_s=own_s).doubt) is told
