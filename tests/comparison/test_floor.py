from __future__ import annotations

import numpy as np
import pytest

from adv2e.comparison.compare import half_split
from adv2e.comparison.distances import distances
from adv2e.comparison.windows import Windows
from adv2e.events import make_events, sort_events

SIZE = (12, 9)
WINDOWS = Windows("windows", ((0, 50_000), (50_000, 100_000)), 2)


def test_events_that_share_no_cell_have_a_floor_of_one():
    pixel = np.arange(12 * 9)
    events = make_events(pixel * 400, pixel % 12, pixel // 12, pixel % 2)
    assert half_split(events, WINDOWS, *SIZE)["relative_5_bins"] == pytest.approx(1)


def test_the_floor_is_how_far_one_poisson_draw_is_from_its_rate():
    draw = np.random.default_rng(5)
    rates = draw.integers(0, 80, (9, 12))
    counts = draw.poisson(rates)
    y, x = (np.repeat(place.ravel(), counts.ravel()) for place in np.mgrid[:9, :12])
    times = draw.integers(0, 50_000, len(x))
    events = sort_events(make_events(times, x, y, np.ones(len(x))))
    window = Windows("windows", ((0, 50_000),), 1)
    deviation = np.sqrt(rates.sum()) / np.linalg.norm(counts)
    found = half_split(events, window, *SIZE, splits=40)["bins_shared_window"]
    every_bin = distances(events, events[:0], window, *SIZE).values["bins_shared_window"]
    # bilinear sharing between 5 bins keeps 2/3 of a pulse's square on average
    assert found == pytest.approx(np.sqrt(rates.sum() * 2 / 3), rel=0.05)
    assert 0 < found / every_bin < 2 * deviation


def test_the_half_split_can_be_repeated(events):
    assert half_split(events, WINDOWS, *SIZE) == half_split(events, WINDOWS, *SIZE)


def test_more_events_of_a_rate_lower_the_relative_floor(events):
    tripled = sort_events(np.concatenate([events] * 3))
    few, many = (half_split(stream, WINDOWS, *SIZE) for stream in (events, tripled))
    assert many["relative_5_bins"] < few["relative_5_bins"]
