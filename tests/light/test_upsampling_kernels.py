from __future__ import annotations

import numpy as np
import pytest

from adv2e.motion.warping import (
    ONE_SIDED,
    UNKNOWN,
    compose,
    cubic,
    fill_lost,
    find_lost,
    splat,
)


def plane(*rows):
    return np.array(rows, np.float32)


def zeros(shape=(3, 5)):
    return np.zeros(shape, np.float32)


def test_cubic_is_exact_on_pixels_and_for_parabolas():
    x, y = np.meshgrid(np.arange(12.0), np.arange(9.0))
    image = 3.0 + 0.5 * x + 0.1 * x * x + 0.2 * y * y
    assert cubic(image, 4.0, 3.0) == image[3, 4]
    expected = 3.0 + 0.5 * 4.3 + 0.1 * 4.3**2 + 0.2 * 3.6**2
    assert cubic(image, 4.3, 3.6) == pytest.approx(expected, abs=1e-12)


def test_cubic_outside_is_the_border():
    image = np.arange(20.0).reshape(4, 5)
    assert cubic(image, -3.0, 1.0) == image[1, 0]
    assert cubic(image, 9.0, 7.5) == image[3, 4]


def test_cubic_overshoots_an_edge_by_at_most_a_quarter_of_the_range_around():
    image = np.tile(plane([0, 0, 0, 100, 100, 0, 0, 0]), (5, 1))
    assert cubic(image, 2.0 - 0.3, 2.0) == 0.0
    peak = cubic(image, 3.5, 2.0)
    assert peak == 100.0
    slope = np.tile(plane([0, 0, 0, 100, 101, 0, 0, 0]), (5, 1))
    assert cubic(slope, 3.5, 2.0) == pytest.approx(101.25)


def test_splat_lets_the_lower_score_win_and_drops_what_leaves():
    u, v = zeros(), zeros()
    u[1] = [2.0, 1.0, 0.0, 0.0, 4.0]
    score = np.full((3, 5), UNKNOWN, np.float32)
    score[1] = [0.2, 0.1, 0.3, UNKNOWN, 0.0]
    best, source = zeros(), np.full((3, 5), -1, np.int32)
    splat(u, v, zeros(u.shape), zeros(u.shape), score, 1.0, best, source)
    assert source[1, 2] == 5 + 1
    assert best[1, 2] == pytest.approx(0.1)
    reached = best < UNKNOWN
    assert reached.sum() == 1


def test_splat_between_pixels_reaches_the_four_around():
    u, v = zeros(), zeros()
    u[0, 1], v[0, 1] = 3.0, 1.0
    score = np.full((3, 5), UNKNOWN, np.float32)
    score[0, 1] = 0.5
    best, source = zeros(), np.full((3, 5), -1, np.int32)
    splat(u, v, zeros(u.shape), zeros(u.shape), score, 0.5, best, source)
    assert np.argwhere(best < UNKNOWN).tolist() == [[0, 2], [0, 3], [1, 2], [1, 3]]


def test_splat_sends_what_bends_less_far_at_first():
    # of 4 columns and 2 rows bent by (4, -4): at the half 2 - 1 columns and 1 + 1 rows
    u, v, p, q = zeros(), zeros(), zeros(), zeros()
    u[0, 1], v[0, 1], p[0, 1], q[0, 1] = 4.0, 2.0, 4.0, -4.0
    score = np.full((3, 5), UNKNOWN, np.float32)
    score[0, 1] = 0.5
    best, source = zeros(), np.full((3, 5), -1, np.int32)
    splat(u, v, p, q, score, 0.5, best, source)
    assert np.argwhere(best < UNKNOWN).tolist() == [[2, 2]]


@pytest.mark.parametrize("steps", [(1.4, 0.2), (1.1, 0.8)])
def test_splat_lets_the_nearer_of_equals_win(steps):
    # both reach column 2: from column 1 by 1.4 or 1.1, from column 2 by 0.2 or 0.8
    u, v = zeros((1, 5)), zeros((1, 5))
    u[0, 1:3] = steps
    score = np.array([[UNKNOWN, 0.5, 0.5, UNKNOWN, UNKNOWN]], np.float32)
    best, source = zeros((1, 5)), np.full((1, 5), -1, np.int32)
    splat(u, v, zeros(u.shape), zeros(u.shape), score, 1.0, best, source)
    assert source[0, 2] == (2 if steps[1] < steps[0] - 1.0 else 1)


def test_lost_are_those_that_do_not_come_back_or_leave():
    u, v, ru, rv = zeros(), zeros(), zeros(), zeros()
    u[1] = [2.0, 0.0, 0.0, 0.0, 3.0]
    ru[1, 2] = -1.1  # short by 0.9 of 2: allowed are 1 + 0.2
    u[2, 0] = 2.0  # nothing comes back
    lost = np.zeros((3, 5), np.bool_)
    find_lost(u, v, ru, rv, lost)
    # the pixel that ru tells to go back to where nobody came from is lost in the other direction
    assert np.argwhere(lost).tolist() == [[1, 2], [1, 4], [2, 0]]


def test_lost_pixels_take_the_motion_over_like_light():
    g = plane([0, 0, 0, 5, 5, 5]).repeat(2, axis=0)
    u = plane([7, 9, 9, 9, 9, -3]).repeat(2, axis=0)
    lost = np.array([[False, True, True, True, True, False]] * 2)
    v, distance = zeros((2, 6)), zeros((2, 6))
    fill_lost(u, v, lost, g, distance)
    assert u[0].tolist() == [7, 7, 7, -3, -3, -3]
    assert distance[0] == pytest.approx([0, 0.02, 0.04, 0.04, 0.02, 0])


def test_lost_pixels_without_any_seen_one_stay_unknown():
    lost = np.ones((3, 5), np.bool_)
    u, distance = np.full((3, 5), 2.0, np.float32), zeros()
    fill_lost(u, zeros(), lost, zeros(), distance)
    assert np.all(distance == UNKNOWN)


def composed(best_a, best_b, u_a=0.0, u_b=0.0, fraction=0.25, p_a=0.0, p_b=0.0):
    """Return the middle pixel of a row where the middle pixels of both frames arrive."""
    a, b = plane([10, 20, 30, 40, 50]), plane([100, 110, 120, 130, 140])
    ua, ub, pa, pb = (np.full(5, value, np.float32) for value in (u_a, u_b, p_a, p_b))
    flat = zeros(5)
    source = np.arange(5, dtype=np.int32)[None]
    bests = (np.full((1, 5), best, np.float32) for best in (best_a, best_b))
    out = zeros((1, 5))
    of_a, of_b = ((u, flat, p, flat) for u, p in ((ua, pa), (ub, pb)))
    best_of_a, best_of_b = bests
    compose(a, b, (*of_a, best_of_a, source), (*of_b, best_of_b, source), fraction, out)
    return float(out[0, 2])


def test_seen_in_both_is_blended_along_the_better_motion():
    # u = 4 from a: one pixel back in a, three on in b, which is its border
    assert composed(0.1, 0.2, u_a=1.0, u_b=9.0) == pytest.approx(0.75 * 27.5 + 0.25 * 127.5)
    assert composed(0.2, 0.1, u_a=9.0, u_b=-1.0) == pytest.approx(0.75 * 27.5 + 0.25 * 127.5)


def test_seen_in_one_frame_is_taken_from_it():
    assert composed(ONE_SIDED, UNKNOWN, u_a=1.0) == pytest.approx(27.5)
    assert composed(UNKNOWN, ONE_SIDED, u_b=-1.0) == pytest.approx(127.5)


def test_not_known_is_blended_in_place():
    assert composed(UNKNOWN, UNKNOWN, u_a=1.0, u_b=1.0) == pytest.approx(0.75 * 30 + 0.25 * 120)


def test_lost_in_both_is_blended_along_both_motions():
    expected = 0.75 * 27.5 + 0.25 * 120
    assert composed(ONE_SIDED, ONE_SIDED, u_a=1.0) == pytest.approx(expected)


def test_light_is_taken_from_the_ends_of_a_path_that_bends():
    # a quarter of the way bent by 4/3 columns is a quarter of a column behind the straight one
    bend = 4.0 / 3.0
    expected = 0.75 * 30.0 + 0.25 * 130.0
    assert composed(0.1, 0.2, u_a=1.0, p_a=bend) == pytest.approx(expected)
    assert composed(0.2, 0.1, u_a=9.0, u_b=-1.0, p_b=bend) == pytest.approx(expected)
    assert composed(ONE_SIDED, UNKNOWN, u_a=1.0, p_a=bend) == pytest.approx(30.0)
    assert composed(UNKNOWN, ONE_SIDED, u_b=-1.0, p_b=bend) == pytest.approx(130.0)
