from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.sources.times import (
    WHOLE,
    WHOLE_SECONDS,
    FrameRate,
    Stamp,
    constant_rate,
    order_note,
    parse_info,
    parse_list,
    parse_ns,
    parse_times,
    read_text,
    seconds,
    seconds_to_ns,
)


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [
        ("0", 0),
        ("0.038766001", 38_766_001),
        ("1468941032.229165635", 1_468_941_032_229_165_635),
        ("1e-06", 1_000),
        ("4.999999873689376e-05", 50_000),
        ("-.5", -500_000_000),
        ("+3.", 3_000_000_000),
    ],
)
def test_decimals_are_read_to_the_nanosecond(text, t_ns):
    assert parse_ns(text) == t_ns


@pytest.mark.parametrize("text", ["nan", "inf", "1,5", "1_0", "", "0x10", "1e999", "1e30"])
def test_other_texts_are_no_times(text):
    with pytest.raises(ValueError, match=r"not a number|out of range"):
        parse_ns(text)


@given(st.integers(-(2**62), 2**62))
def test_written_seconds_read_back(t_ns):
    assert parse_ns(seconds(t_ns)) == t_ns


def test_list_with_comments_and_blank_lines():
    text = "# t\r\n0.5\r\n\r\n  1.5   # late\r\n"
    assert parse_times(text, "t.txt") == [
        Stamp(500_000_000, 2, None),
        Stamp(1_500_000_000, 4, None),
    ]


@pytest.mark.parametrize(
    ("text", "t_ns", "note"),
    [
        ("0 a\n2000 b\n", [0, 2_000_000], WHOLE),
        ("0 a\n2 b\n2.5 c\n", [0, 2_000_000_000, 2_500_000_000], ""),
        ("3 a\n", [3_000_000_000], ""),
        ("0 a\n20 b\n", [0, 20_000], WHOLE),
        ("0 a\n19 b\n", [0, 19_000_000_000], WHOLE_SECONDS),
    ],
)
def test_a_list_of_a_recording_may_be_in_microseconds(text, t_ns, note):
    stamps, found = parse_list(text, "images.txt")
    assert ([stamp.t_ns for stamp in stamps], found) == (t_ns, note)


@pytest.mark.parametrize("digits", [19, 20, 5000])
def test_whole_numbers_beyond_all_clocks_are_told(digits):
    with pytest.raises(DataError, match=r"images.txt line 2: '9+' is out of range"):
        parse_list(f"0 a\n{'9' * digits} b\n", "images.txt")


def test_named_lines_are_sorted_by_time():
    stamps = parse_times("0.2 b c.png\n0.1 a.png\n", "t.txt")
    assert stamps == [Stamp(100_000_000, 2, "a.png"), Stamp(200_000_000, 1, "b c.png")]


@pytest.mark.parametrize(
    ("text", "note"),
    [
        ("0.1 a\n0.2 b\n0.3 c\n", ""),
        ("0.1 a\n0.3 c\n0.2 b\n", "line 3 is earlier than one before it: sorted by time"),
    ],
)
def test_lines_that_are_sorted_are_told(text, note):
    stamps, told = parse_list(text, "images.txt")
    assert told == note == order_note(stamps)
    assert [stamp.name for stamp in stamps] == ["a", "b", "c"]


def test_info_lists_have_microseconds_behind_the_path():
    stamps = parse_info("dir one/1.png 0\ndir one/2.png 41667\n", "info.txt")
    assert stamps == [Stamp(0, 1, "dir one/1.png"), Stamp(41_667_000, 2, "dir one/2.png")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "t.txt: no times"),
        ("# nothing\n", "t.txt: no times"),
        ("0.1\nabc\n", "t.txt line 2: 'abc'"),
        ("0.2\n0.1\n", "t.txt line 2: times must increase; 0.1 s is not after the 0.2 s of line 1"),
        ("0.2\n0.2\n", "t.txt line 2: times must increase"),
        ("0.2 a\n0.1 b\n0.2 c\n", "t.txt line 3: times must increase.*line 1"),
        ("0.1 a\n0.2\n", "t.txt line 2: all lines or none"),
        ("0.1\n0.2 a\n", "t.txt line 2: all lines or none"),
        ("0.1 a\n0.2 a\n", "t.txt line 2: a is on line 1"),
    ],
)
def test_wrong_lists_are_named_by_line(text, message):
    with pytest.raises(DataError, match=message):
        parse_times(text, "t.txt")


def test_info_without_a_time_is_named_by_line():
    with pytest.raises(DataError, match=r"info\.txt line 2: expected 'path time'"):
        parse_info("a.png 1\nb.png\n", "info.txt")


def test_a_list_that_is_no_text(tmp_path):
    path = tmp_path / "times.txt"
    path.write_bytes(b"\x93NUMPY\xff\xfe\x00")
    with pytest.raises(DataError, match=r"times\.txt: not a text file"):
        read_text(path)
    with pytest.raises(DataError, match=r"none\.txt: No such file"):
        read_text(tmp_path / "none.txt")


def test_frame_rate_does_not_drift():
    rate = FrameRate(Fraction(30000, 1001))
    assert rate.time_ns(0) == 0
    assert rate.time_ns(1) == 33_366_667
    assert rate.time_ns(30_000 * 3600) == 1001 * 3600 * 10**9


def test_float_seconds_of_the_epoch_keep_what_the_float_holds():
    t = np.array([1468941032.229165635, -0.25])
    exact = [round(Fraction(float(value)) * 10**9) for value in t]
    assert seconds_to_ns(t).tolist() == exact


def rounded(rate, count, tick=1_000_000):
    return [round(Fraction(n * 10**9, tick) / rate) * tick for n in range(count)]


@pytest.mark.parametrize(
    "hz",
    [Fraction(r) for r in (24, 25, 30, 50, 60, 120)]
    + [Fraction(24000, 1001), Fraction(30000, 1001), Fraction(60000, 1001)],
)
def test_rounded_stamps_give_their_rate_back(hz):
    stamps = rounded(hz, 300)
    assert constant_rate(stamps, stated_hz=float(hz), tolerance_ns=10**6) == FrameRate(hz)


def test_a_rate_stated_with_three_decimals_is_the_broadcast_rate():
    stamps = rounded(Fraction(30000, 1001), 40)
    rate = constant_rate(stamps, stated_hz=29.97, tolerance_ns=10**6)
    assert rate == FrameRate(Fraction(30000, 1001))


def test_an_odd_rate_is_taken_as_stated():
    stamps = rounded(Fraction(15, 2), 50)
    assert constant_rate(stamps, stated_hz=7.5, tolerance_ns=10**6) == FrameRate(Fraction(15, 2))


def test_a_rate_not_stated_is_found_from_the_stamps():
    stamps = rounded(Fraction(30000, 1001), 3000)
    rate = constant_rate(stamps, stated_hz=0.0, tolerance_ns=10**6)
    assert rate == FrameRate(Fraction(30000, 1001))


def test_first_stamp_need_not_be_zero():
    stamps = [t + 7 * 10**9 for t in rounded(Fraction(30), 100)]
    assert constant_rate(stamps, stated_hz=30.0, tolerance_ns=10**6) == FrameRate(Fraction(30))


def test_one_frame_out_of_place_means_no_constant_rate():
    stamps = rounded(Fraction(25), 100)
    stamps[60] += 2_000_000
    assert constant_rate(stamps, stated_hz=25.0, tolerance_ns=10**6) is None


def test_drift_means_no_constant_rate():
    stamps = [round(n * 1000 / 25.01) * 10**6 for n in range(2000)]
    assert constant_rate(stamps, stated_hz=25.0, tolerance_ns=10**6) is None


def test_a_single_stamp_has_no_rate():
    assert constant_rate([0], stated_hz=25.0, tolerance_ns=10**6) is None
