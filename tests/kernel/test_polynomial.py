"""The first crossing, against dense sampling of the same polynomial."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.kernel.polynomial import TIE, at_end, first_crossing, value
from adv2e.kernel.workspace import DISTANCE, workspace


def crossing(coefficients, sa=0.0, sb=1.0, on=0.2, off=0.2, monotone=False):
    ws = workspace()
    ws[DISTANCE, : len(coefficients)] = coefficients
    return first_crossing(ws, len(coefficients) - 1, sa, sb, on, off, monotone)


def sampled(coefficients, sa, sb, on, off, count=200_001):
    s = np.linspace(sa, sb, count)
    v = np.polynomial.polynomial.polyval(s, coefficients)
    beyond = np.flatnonzero((v >= on + TIE) | (v <= -off - TIE))
    if not beyond.size:
        return 0, sb
    return (1 if v[beyond[0]] > 0 else -1), s[beyond[0]]


def test_value_and_end():
    ws = workspace()
    ws[DISTANCE, :4] = [1.0, -2.0, 0.5, 3.0]
    assert value(ws, DISTANCE, 3, 0.5) == pytest.approx(1 - 1 + 0.125 + 0.375)
    assert at_end(ws, DISTANCE, 3) == pytest.approx(2.5)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.floats(-2, 2), min_size=2, max_size=9),
    st.floats(0, 0.9),
    st.floats(0.01, 1.0),
)
def test_agrees_with_dense_sampling(shape, sa, width):
    sb = min(1.0, sa + width)
    coefficients = np.array([0.0, *shape])
    # begin between the thresholds, as after an event
    coefficients[0] = 0.05 - np.polynomial.polynomial.polyval(sa, coefficients)
    polarity, s = crossing(coefficients, sa, sb)
    expected, where = sampled(coefficients, sa, sb, 0.2, 0.2)
    if expected == 0 and polarity != 0:
        # sampling may step over a crossing pair, the polynomial may not: check the place found
        v = np.polynomial.polynomial.polyval(s, coefficients)
        assert abs(v) == pytest.approx(0.2, abs=1e-6)
        return
    assert polarity == expected
    if polarity:
        assert s == pytest.approx(where, abs=2e-5)


@pytest.mark.parametrize("depth", [1e-3, 1e-5, 1e-7])
def test_tangent_pairs_are_not_missed(depth):
    # a parabola that rises above the level by `depth`, for a stretch of 2 sqrt(depth)
    polarity, s = crossing([0.2 - 0.25 + depth, 1.0, -1.0])
    assert polarity == 1
    assert s == pytest.approx(0.5 - np.sqrt(depth - TIE), abs=1e-9)
    assert crossing([0.2 - 0.25 - depth, 1.0, -1.0])[0] == 0


def test_first_of_several_crossings():
    # rises through ON, comes back, falls through OFF
    root = np.polynomial.polynomial.polyfromroots([0.2, 0.5, 0.9]) * 30
    root[0] = 0.0
    polarity, s = crossing(root)
    expected, where = sampled(root, 0.0, 1.0, 0.2, 0.2)
    assert (polarity, s) == (expected, pytest.approx(where, abs=1e-5))


def test_exact_tie_does_not_fire():
    # ends at the level itself, as a pixel that returns to an old brightness does
    assert crossing([0.0, 0.4, -0.2])[0] == 0
    assert crossing([0.0, 0.2])[0] == 0
    assert crossing([0.0, 0.4, -0.2 + 3e-9])[0] == 1


def test_beyond_the_level_at_the_start_fires_there():
    assert crossing([0.3, -1.0, 0.2], sa=0.0) == (1, 0.0)
    assert crossing([-0.3, 1.0], sa=0.0) == (-1, 0.0)


def test_line_and_flat():
    assert crossing([0.0, 0.5]) == (1, pytest.approx(0.4))
    assert crossing([0.0, -0.5], off=0.1) == (-1, pytest.approx(0.2))
    assert crossing([0.1, 0.0]) == (0, 1.0)
    assert crossing([0.1, 0.0, 0.0, 0.0]) == (0, 1.0)
