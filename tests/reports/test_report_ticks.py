"""Ticks: inside the axis, even, round, few, and labelled so that they can be told apart."""

import itertools
import math
from decimal import Decimal

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from adv2e.reports.charts import linear_ticks, log_ticks, tick_labels

NUMBERS = st.floats(-1e250, 1e250, allow_subnormal=False)
POSITIVE = st.floats(1e-250, 1e250)


@st.composite
def ranges(draw):
    low, high = sorted((draw(NUMBERS), draw(NUMBERS)))
    # nearer than this, an axis widens the range
    assume(high - low > 1e-6 * max(abs(low), abs(high)))
    assume(high - low > 1e-250)
    return low, high


@pytest.mark.parametrize(
    ("low", "high", "ticks", "labels"),
    [
        (0, 1, [0, 0.2, 0.4, 0.6, 0.8, 1], ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
        (-3, 8.5, [-2, 0, 2, 4, 6, 8], ["-2", "0", "2", "4", "6", "8"]),
        (0.31, 0.349, [0.31, 0.32, 0.33, 0.34], ["0.31", "0.32", "0.33", "0.34"]),
        (0, 4e6, [0, 1e6, 2e6, 3e6, 4e6], ["0", "1e6", "2e6", "3e6", "4e6"]),
        (0, 3e-5, [0, 5e-6, 1e-5, 1.5e-5, 2e-5, 2.5e-5, 3e-5],
         ["0", "5e-6", "1e-5", "1.5e-5", "2e-5", "2.5e-5", "3e-5"]),
    ],
)  # fmt: skip
def test_linear_examples(low, high, ticks, labels):
    assert linear_ticks(low, high) == ticks
    assert tick_labels(ticks) == labels


@pytest.mark.parametrize(
    ("low", "high", "ticks", "labels"),
    [
        (0.5, 2000, [1, 10, 100, 1000], ["1", "10", "100", "1000"]),
        (100, 1e6, [100, 1e3, 1e4, 1e5, 1e6], ["100", "1000", "10000", "100000", "1e6"]),
        (2, 300, [2, 5, 10, 20, 50, 100, 200], ["2", "5", "10", "20", "50", "100", "200"]),
        (2e-6, 3e-5, [2e-6, 5e-6, 1e-5, 2e-5], ["2e-6", "5e-6", "1e-5", "2e-5"]),
        (4.1, 4.6, [4.1, 4.2, 4.3, 4.4, 4.5, 4.6], ["4.1", "4.2", "4.3", "4.4", "4.5", "4.6"]),
    ],
)
def test_logarithmic_examples(low, high, ticks, labels):
    assert log_ticks(low, high) == ticks
    assert tick_labels(ticks) == labels


@settings(deadline=None)
@given(ranges())
def test_linear_ticks_are_few_round_and_even(ends):
    low, high = ends
    ticks = linear_ticks(low, high)
    assert 2 <= len(ticks) <= 7
    assert all(low <= tick <= high for tick in ticks)
    exact = [Decimal(repr(tick)) for tick in ticks]
    steps = {b - a for a, b in itertools.pairwise(exact)}
    assert len(steps) == 1
    (step,) = steps
    assert step.normalize().as_tuple().digits in ((1,), (2,), (5,))


@settings(deadline=None)
@given(POSITIVE, POSITIVE)
def test_logarithmic_ticks_are_few_and_inside(one, other):
    low, high = sorted((one, other))
    assume(high > 1.001 * low)
    ticks = log_ticks(low, high)
    assert 2 <= len(ticks) <= 14
    assert ticks == sorted(set(ticks))
    assert all(low <= tick <= high for tick in ticks)


@settings(deadline=None)
@given(ranges(), st.booleans())
def test_labels_say_the_number(ends, log):
    if log:
        low, high = (abs(end) + 1e-200 for end in ends)
        low, high = sorted((low, high))
        assume(high > 1.001 * low)
        ticks = log_ticks(low, high)
    else:
        ticks = linear_ticks(*ends)
    labels = tick_labels(ticks)
    assert len(set(labels)) == len(labels) == len(ticks)
    gap = min(b - a for a, b in itertools.pairwise(ticks))
    for label, tick in zip(labels, ticks, strict=True):
        assert math.isclose(float(label), tick, rel_tol=1e-9, abs_tol=1e-3 * gap)


def test_labels_of_few_ticks():
    assert tick_labels([]) == []
    assert tick_labels([0.0]) == ["0"]
    assert tick_labels([3.0]) == ["3"]
