from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from adv2e.errors import DataError
from adv2e.events import empty_events, make_events
from adv2e.formats.recording import Recording
from adv2e.representations.voxel_grid import (
    own_window,
    robust,
    smoothed,
    split_grid,
    voxel_grid,
    z_scored,
)

WIDTH, HEIGHT = SIZE = 12, 9


def slow_grid(events, window, bins):
    """The definition, event by event and bin by bin."""
    grid = np.zeros((bins, HEIGHT, WIDTH))
    first, last = window
    span = last - first if last != first else 1
    for event in events:
        place = (bins - 1) * (int(event["t"]) - first) / span
        for k in range(bins):
            sign = 1 if event["p"] else -1
            grid[k, event["y"], event["x"]] += sign * max(0.0, 1.0 - abs(k - place))
    return grid


@pytest.mark.parametrize("bins", [1, 2, 5])
def test_the_grid_is_that_of_the_definition(events, bins):
    window = (0, 100_000)
    np.testing.assert_allclose(
        voxel_grid(events, bins, SIZE, window), slow_grid(events, window, bins), atol=1e-12
    )


def test_the_grid_holds_every_event_once(events):
    grid = voxel_grid(events, 5, SIZE, own_window(events))
    assert grid.sum() == pytest.approx(2 * events["p"].sum() - len(events))


def test_first_and_last_event_fill_first_and_last_bin():
    events = make_events([10, 30], [1, 2], [3, 4], [1, 0])
    grid = voxel_grid(events, 5, SIZE, own_window(events))
    assert grid[0, 3, 1] == 1
    assert grid[4, 4, 2] == -1
    assert np.abs(grid).sum() == 2


def test_windows_of_a_recording_are_those_of_its_events(events):
    recording = Recording("r", "array", WIDTH, HEIGHT, events)
    for first in range(0, 100_000, 9_000):
        window = first, first + 8_999
        inside = events[(events["t"] >= first) & (events["t"] <= window[1])]
        expected = slow_grid(inside, window, 3)
        np.testing.assert_allclose(
            voxel_grid(recording, 3, window=window), expected, rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("where", ["everywhere", "at the end", "inside"])
def test_a_window_of_events_out_of_order_is_refused(events, where):
    swapped = events.copy()
    if where == "everywhere":
        swapped = swapped[np.random.default_rng(1).permutation(len(swapped))]
    elif where == "at the end":
        swapped[-1]["t"] = 0
    else:
        middle = len(swapped) // 2
        swapped["t"][middle] = swapped["t"][middle + 1] + 1
    with pytest.raises(DataError, match="sorted by time"):
        voxel_grid(swapped, 3, SIZE, (0, 100_000))


def test_an_array_needs_a_size(events):
    with pytest.raises(DataError, match="size is missing"):
        voxel_grid(events, 3)


def test_columns_can_be_taken_by_networks(events):
    columns = Recording("r", "array", WIDTH, HEIGHT, events).columns()
    for name, column in columns.items():
        assert column.flags.c_contiguous
        assert column.dtype.kind == "i"
        np.testing.assert_array_equal(column, events[name])
    large = Recording("r", "array", 40_000, 2, events).columns()
    assert (large["x"].dtype, large["y"].dtype) == (np.int32, np.int32)


def test_events_of_a_single_time_fall_into_the_first_bin():
    events = make_events([7, 7], [1, 2], [3, 4], [1, 1])
    grid = voxel_grid(events, 5, SIZE, own_window(events))
    assert grid[0].sum() == 2
    assert not grid[1:].any()


def test_epoch_times_keep_their_microseconds(events):
    later = events.copy()
    later["t"] += 1_468_941_032_229_165
    start = 1_468_941_032_229_165
    np.testing.assert_array_equal(
        voxel_grid(events, 5, SIZE, (0, 100_000)),
        voxel_grid(later, 5, SIZE, (start, start + 100_000)),
    )


def test_no_events_make_an_empty_grid():
    none = empty_events()
    assert voxel_grid(none, 5, SIZE, own_window(none)).shape == (5, HEIGHT, WIDTH)
    assert not z_scored(np.zeros((5, HEIGHT, WIDTH))).any()


def test_z_score_is_taken_over_the_cells_that_are_not_zero(events):
    grid = voxel_grid(events[:200], 5, SIZE, (0, 100_000))
    filled = grid != 0
    assert 0 < filled.sum() < grid.size
    scored = z_scored(grid)
    assert not scored[~filled].any()
    assert scored[filled].mean() == pytest.approx(0, abs=1e-12)
    assert scored[filled].std() == pytest.approx(1)


def test_z_score_of_equal_cells_is_zero_rather_than_nan():
    grid = np.zeros((1, HEIGHT, WIDTH))
    grid[0, 2, 2] = grid[0, 5, 5] = 3.0
    assert not z_scored(grid).any()


def test_smoothing_is_a_3x3_gaussian_of_sigma_1_with_nothing_outside(events):
    grid = voxel_grid(events, 5, SIZE, (0, 100_000))
    y, x = np.mgrid[-1:2, -1:2]
    weights = np.exp(-(x**2 + y**2) / 2)
    weights /= weights.sum()
    for k in range(5):
        expected = ndimage.convolve(grid[k], weights, mode="constant")
        np.testing.assert_allclose(smoothed(grid)[k], expected, atol=1e-12)


def test_without_a_window_it_is_that_of_the_events_in_any_order(events):
    expected = voxel_grid(events, 5, SIZE, own_window(events))
    np.testing.assert_array_equal(voxel_grid(events, 5, SIZE), expected)
    shuffled = np.random.default_rng(1).permutation(events)
    np.testing.assert_allclose(voxel_grid(shuffled, 5, SIZE), expected, atol=1e-12)


def test_events_outside_the_window_are_left_out_and_its_ends_belong_to_it():
    events = make_events([9, 10, 20, 21], [0, 1, 2, 3], [0, 0, 0, 0], [1, 1, 1, 1])
    grid = voxel_grid(events, 2, (4, 1), (10, 20))
    np.testing.assert_array_equal(grid[:, 0], [[0, 1, 0, 0], [0, 0, 1, 0]])


@pytest.mark.parametrize(
    ("bins", "size", "window", "text"),
    [
        (0, (4, 1), None, "0 bins, at least 1 is needed"),
        (5, (3, 1), None, "number 1 has x 3, outside a sensor of 3x1 pixels"),
        (5, (4, 1), (9, 8), "the window ends at 8 us, before it begins at 9 us"),
    ],
)
def test_a_grid_that_cannot_be(bins, size, window, text):
    events = make_events([0, 10], [0, 3], [0, 0], [1, 1])
    with pytest.raises(DataError, match=text):
        voxel_grid(events, bins, size, window)


def test_an_array_without_fields_is_refused():
    with pytest.raises(DataError, match="structured array"):
        voxel_grid(np.zeros((3, 4)), 5, SIZE)


def test_split_polarities_are_counts_of_on_above_those_of_off(events):
    window = (0, 100_000)
    grid = split_grid(events, 3, SIZE, window)
    assert grid.shape == (6, HEIGHT, WIDTH)
    on, off = (events[events["p"] == p] for p in (1, 0))
    np.testing.assert_allclose(grid[:3], slow_grid(on, window, 3), atol=1e-12)
    np.testing.assert_allclose(grid[3:], -slow_grid(off, window, 3), atol=1e-12)


def test_the_robust_normalisation_takes_ordered_cells_and_interpolates_nothing():
    grid = np.random.default_rng(1).normal(size=(5, 4, 3))
    cells = sorted(grid.ravel().tolist())
    low, high = cells[0], cells[round(0.95 * 59)]
    expected = [[[(min(v, high) - low) / (high + 1e-6) for v in r] for r in c] for c in grid]
    np.testing.assert_allclose(robust(grid), expected, atol=1e-12)
    zeros = np.zeros((5, 4, 3))
    assert robust(zeros) is zeros
