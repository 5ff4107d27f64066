"""Frame rates and instants: as people write them, exact, and found behind rounded stamps."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adv2e.errors import UsageError
from adv2e.sources import open_source
from adv2e.sources.times.rates import FrameRate, constant_rate, parse_ns, parse_rate, seconds
from adv2e.ticks import NS, S, to_ticks


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


def test_frame_rate_does_not_drift():
    rate = FrameRate(Fraction(30000, 1001))
    assert rate.time_ns(0) == 0
    assert rate.time_ns(1) == 33_366_667
    assert rate.time_ns(30_000 * 3600) == 1001 * 3600 * 10**9


def test_float_seconds_of_the_epoch_keep_what_the_float_holds():
    t = np.array([1468941032.229165635, -0.25])
    exact = [round(Fraction(float(value)) * 10**9) for value in t]
    assert to_ticks(t, S, NS, "t").tolist() == exact


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


@pytest.mark.parametrize(
    ("text", "hz"),
    [
        (30, Fraction(30)),
        (29.97, Fraction(2997, 100)),
        ("29.97", Fraction(2997, 100)),
        ("30000/1001", Fraction(30000, 1001)),
        (Fraction(24000, 1001), Fraction(24000, 1001)),
        (np.float64(0.5), Fraction(1, 2)),
        ("1e3", Fraction(1000)),
        (".5/2", Fraction(1, 4)),
    ],
)
def test_a_rate_is_what_its_digits_say(text, hz):
    assert parse_rate(text) == hz


@pytest.mark.parametrize(
    "text", ["", "x", "1/0", "0", "-1", "1/-2", "nan", "inf", "1//2", "1e99", "1e-9", "9" * 5000]
)
def test_what_is_no_rate_says_what_would_be_right(text):
    with pytest.raises(ValueError, match="must be"):
        parse_rate(text)
    with pytest.raises(UsageError, match="--fps: must be"):
        open_source("none.npy", fps=text)


@pytest.mark.parametrize("kind", ["npy", "images", "video"])
def test_frames_at_a_fraction_are_exact(write_video, write_images, picture, tmp_path, kind):
    pictures = [picture(n, (24, 32, 3)) for n in range(31)]
    if kind == "npy":
        path = tmp_path / "stack.npy"
        np.save(path, np.stack(pictures))
    else:
        path = write_images(pictures) if kind == "images" else write_video("clip.avi", pictures)
    source = open_source(path, fps="30000/1001")
    times = [frame.t_ns for frame in source.frames()]
    assert times == [round(Fraction(n * 1001 * 10**9, 30000)) for n in range(31)]
    assert times[30] == 1_001_000_000
    if kind == "video":
        assert source.notes[0] == "--fps 30000/1001 replaces the times in the file"
