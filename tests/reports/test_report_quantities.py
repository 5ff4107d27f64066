"""Numbers as people read them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.reports.markup import join, markup, meaning_of, plain, summary_of, tag, unit_of
from adv2e.reports.quantities import (
    alike_texts,
    beside,
    estimate_text,
    interval_text,
    native,
    number_text,
    percent_text,
    probability_text,
    readable,
    scaled,
    short_text,
    value_text,
)
from adv2e.reports.result import Estimate


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.23456, "1.23"),
        (0.5, "0.500"),
        (309285.0, "309,285"),
        (-12.34, "-12.3"),
        (9.999, "10.0"),
        (0.000123, "0.000123"),
        (0.0000123, "1.23e-5"),
        (2e6, "2.00e6"),
        (0.0, "0"),
        (-0.0, "0"),
        (float("nan"), "-"),
        (float("-inf"), "-inf"),
    ],
)
def test_numbers_have_three_digits_or_all_whole_ones(value, text):
    assert number_text(value) == text


@pytest.mark.parametrize(
    ("value", "interval", "text", "ends"),
    [
        (6012.34, (5503.0, 6498.0), "6,000", "5,500 to 6,500"),
        (1.3842, (1.312, 1.461), "1.38", "1.31 to 1.46"),
        (0.3124, (0.2904, 0.3401), "0.31", "0.29 to 0.34"),
        (0.0004, (-0.31, 0.29), "0.0", "-0.3 to 0.3"),
        (-0.0004, (-0.31, 0.29), "0.0", "-0.3 to 0.3"),
        (2.5e9, (2.4e9, 2.6e9), "2.50e9", "2.40e9 to 2.60e9"),
        (5, (5, 5), "5", "5 to 5"),
        (np.float64(3.25), (0.0, float("inf")), "3.25", "0 to inf"),
    ],
)
def test_values_have_the_digits_that_the_interval_warrants(value, interval, text, ends):
    assert value_text(value, interval) == text
    assert interval_text(interval) == ends
    assert estimate_text(Estimate(value, interval)) == f"{text} ({ends})"


@pytest.mark.parametrize(
    ("path", "value", "unit", "readable_unit", "text"),
    [
        ("pixel.refractory.period_us", 4003.7, "us", "ms", "4.004"),
        ("pixel.refractory.period_us", 400.3, "us", "µs", "400.3"),
        ("frames.clock_offset_us", -2.5e6, "us", "s", "-2.5"),
        ("readout.arbiter.row_ns", 12_500, "ns", "µs", "12.5"),
        ("readout.loss.fraction", 0.052, "", "%", "5.2"),
        ("frames.shift_px", [0.5, -0.25], "px", "px", "[0.5, -0.25]"),
        ("frames.encoding", "linear", "", "", "linear"),
        ("pixel.leak.rate_hz", 5000.0, "Hz", "Hz", "5,000"),
    ],
)
def test_units_are_those_that_are_easy_to_read(path, value, unit, readable_unit, text):
    factor, better = readable(path, value, unit)
    assert (better, value_text(scaled(value, factor))) == (readable_unit, text)


@pytest.mark.parametrize(
    ("value", "interval", "text"),
    [
        (0.5, (3.97, 4.04), "0.50"),
        (0.512345, (3.9, 4.4), "0.5123"),
        (500, (3970, 4040), "500"),
        (2, (3.97, 4.04), "2.00"),
        ([0.5, 0.1], ([0.1, 0.2], [0.3, 0.4]), "[0.5, 0.1]"),
        ("linear", None, "linear"),
    ],
)
def test_declared_values_have_as_many_decimals_as_the_fitted_one_beside(value, interval, text):
    assert beside(value, interval) == text


def test_numbers_to_compare_end_at_the_same_place():
    assert alike_texts((0.924, -0.000155, 0.91612)) == ["0.924", "0.000", "0.916"]
    assert alike_texts((114.2, 711.3, float("nan"))) == ["114", "711", "-"]
    assert alike_texts((0.0, 0.0, 0.0)) == ["0", "0", "0"]


def test_values_of_other_kinds():
    assert value_text("gamma:1.2", None) == "gamma:1.2"
    assert value_text(True) == "true"
    assert value_text(None) == "null"
    assert value_text(np.array([0.5, -0.25])) == "[0.5, -0.25]"
    assert value_text(187.123456) == "187.1"
    assert interval_text(None) == "-"
    assert interval_text(([0.1, 0.2], [0.3, 0.4])) == "[0.1, 0.2] to [0.3, 0.4]"
    assert estimate_text(Estimate(2.0)) == "2.00"
    assert estimate_text(Estimate(2.0, (float("nan"), 3.0))) == "2.00"


@settings(deadline=None)
@given(st.floats(-1e300, 1e300, allow_subnormal=False), st.integers(1, 6))
def test_texts_are_near_the_number(value, digits):
    near = pytest.approx(value, rel=0.51 * 10 ** (1 - digits), abs=0)
    assert float(number_text(value, digits).replace(",", "")) == near
    assert float(short_text(value, digits).replace(",", "")) == near


@settings(deadline=None)
@given(st.floats(-1e12, 1e12), st.floats(-1e12, 1e12), st.floats(-1e12, 1e12))
def test_values_with_intervals_are_off_by_little_of_the_interval(value, one, other):
    low, high = sorted((one, other))
    text = float(value_text(value, (low, high)).replace(",", ""))
    assert abs(text - value) <= max(0.13 * (high - low), 1e-3 * abs(value)) + 1e-300


def test_probabilities_and_shares():
    assert probability_text(0.0002) == "< 0.001"
    assert probability_text(0.0341) == "= 0.034"
    assert probability_text(float("nan")) == "unknown"
    assert percent_text(0.0341) == "3.4 %"
    assert percent_text(1.0) == "100 %"
    assert percent_text(float("nan")) == "-"


def test_units_and_meanings_come_from_the_declarations():
    assert unit_of("pixel.refractory.period_us") == "us"
    assert unit_of("pixel.leak.jitter") == ""
    assert unit_of("no.such.key") == meaning_of("no.such.key") == ""
    assert meaning_of("pixel.refractory.period_us") == "dead time after an event"


def test_effects_are_described_by_their_module_or_that_of_their_keys():
    assert summary_of("leak").startswith("Leak of the memorised reference")
    assert summary_of("photo_leak", ["pixel.leak.photo_rate_hz"]) == summary_of("leak")
    assert summary_of("photo_leak", ["pixel.leaks.x"]) == summary_of("unheard_of") == ""


def test_numpy_values_become_plain_ones():
    values = native({"a": np.float32(0.5), "b": (np.int64(2), [np.bool_(True)]), 3: np.ones(2)})
    assert values == {"a": 0.5, "b": [2, [True]], "3": [1.0, 1.0]}
    assert [type(v) for v in values["b"]] == [int, list]


def test_texts_are_escaped_and_markup_is_not():
    assert tag("p", "a<b", tag("b", '"&"'), title="'x'", class_="c", id=None) == (
        '<p title="&#x27;x&#x27;" class="c">a&lt;b<b>&quot;&amp;&quot;</b></p>'
    )
    assert tag("meta", http_equiv="X") == '<meta http-equiv="X">'
    assert join("<", markup("<")) == "&lt;&lt;"
    assert plain("a\x00\udc80\tb") == "a\ufffd\ufffd\tb"
