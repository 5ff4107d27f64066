from __future__ import annotations

import numpy as np
import pytest

from adv2e.comparison.distances import MEASURES, distances, pooled, smoothed_errors
from adv2e.comparison.windows import Windows
from adv2e.events import cut, empty_events, make_events
from adv2e.representations.voxel_grid import own_window, smoothed, voxel_grid, z_scored

SIZE = (12, 9)
WINDOWS = Windows("windows", ((0, 40_000), (40_000, 100_000)), 2)
RELATIVE = [name for name in MEASURES if name.startswith("relative")]


def norm(grid):
    return np.linalg.norm(grid.ravel())


def test_each_measure_is_that_of_its_definition(random_events):
    a, b = random_events(1, 900), random_events(2, 700)
    found = distances(a, b, WINDOWS, *SIZE)
    for n, window in enumerate(WINDOWS.used):
        parts = cut(a, *window), cut(b, *window)
        g = [voxel_grid(part, 5, SIZE, window) for part in parts]
        own = [voxel_grid(part, 5, SIZE, own_window(part)) for part in parts]
        one = [voxel_grid(part, 1, SIZE, window) for part in parts]
        expected = {
            "bins_shared_window": norm(g[0] - g[1]),
            "bins_own_span": norm(own[0] - own[1]),
            "bins_z_scored": norm(z_scored(g[0]) - z_scored(g[1])),
            "relative_5_bins": norm(g[0] - g[1]) / norm(g[0]),
            "relative_5_bins_smoothed": norm(smoothed(g[0]) - smoothed(g[1]))
            / norm(smoothed(g[0])),
            "relative_1_bin_smoothed": norm(smoothed(one[0]) - smoothed(one[1]))
            / norm(smoothed(one[0])),
        }
        assert {name: found.per_window[name][n] for name in expected} == pytest.approx(expected)
    assert found.per_window["error"] == smoothed_errors(a, b, SIZE[0])


def test_absolute_measures_are_means_and_relative_ones_medians_over_windows(random_events):
    windows = Windows("windows", ((0, 20_000), (20_000, 30_000), (30_000, 100_000)), 3)
    found = distances(random_events(1, 900), random_events(2, 700), windows, *SIZE)
    shared, relative = (
        found.per_window[name] for name in ("bins_shared_window", "relative_5_bins")
    )
    assert found.values["bins_shared_window"] == pytest.approx(np.mean(shared))
    assert found.values["relative_5_bins"] == np.median(relative)
    assert np.median(relative) != pytest.approx(np.mean(relative))


def test_identical_streams_are_at_zero_everywhere(events):
    assert set(distances(events, events, WINDOWS, *SIZE).values.values()) == {0.0}


def test_no_simulated_events_are_at_one_in_every_relative_measure(events):
    found = distances(events, empty_events(), WINDOWS, *SIZE).values
    assert [found[name] for name in [*RELATIVE, "error"]] == pytest.approx([1, 1, 1, 1])


def test_own_spans_hide_a_delay_that_the_shared_window_shows():
    measured = make_events([1_000, 11_000, 21_000], [1, 5, 9], [4, 4, 4], [1, 0, 1])
    delayed = measured.copy()
    delayed["t"] += 9_000
    found = distances(measured, delayed, WINDOWS, *SIZE)
    assert found.per_window["bins_own_span"] == [0, 0]
    assert found.per_window["bins_shared_window"][0] > 1


def test_windows_without_measured_events_have_no_relative_value(random_events):
    measured = random_events(1, 300, last=40_000)
    found = distances(measured, random_events(2, 300), WINDOWS, *SIZE)
    for name in RELATIVE:
        assert found.per_window[name][1] is None
        assert found.values[name] == found.per_window[name][0]
    assert found.per_window["bins_shared_window"][1] > 0


def test_events_outside_the_windows_do_not_count(random_events):
    inside = Windows("windows", ((20_000, 60_000),), 1)
    a, b = random_events(1, 900), random_events(2, 700)
    cut_before = distances(cut(a, 20_000, 60_000), cut(b, 20_000, 60_000), inside, *SIZE)
    assert distances(a, b, inside, *SIZE) == cut_before


def test_relative_measures_can_be_over_another_stream(random_events):
    a, b, whole = random_events(1, 300), random_events(2, 300), random_events(3, 3000)
    own, other = (distances(a, b, WINDOWS, *SIZE, whole=unit).values for unit in (None, whole))
    assert other["bins_shared_window"] == own["bins_shared_window"]
    for name in [*RELATIVE, "error"]:
        assert other[name] < 0.6 * own[name]


def test_pooling_leaves_out_what_is_not_there():
    assert pooled([None, 1.0, 3.0, 11.0], "median") == 3
    assert pooled([None, 1.0, 3.0, 11.0], "mean") == 5
    assert pooled([None], "mean") is None
