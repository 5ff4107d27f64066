"""Time of putting events in order; see test_bench_pixel.py for how to run."""

import numpy as np
import pytest

from adv2e.events import is_sorted, make_events, sort_events
from adv2e.kernel.packing import PIXEL_BITS

COUNT, WIDTH, HEIGHT, TILES = 200_000, 346, 260, 8
INTERVAL_US = 4167


@pytest.fixture(scope="module")
def columns():
    """Times [us], columns, rows and polarities of 16 intervals of a busy clip, tile by tile.

    As tiles hand them over: within a tile the intervals follow each other, in which pixels come one
    by one with their events.
    """
    rng = np.random.default_rng(0)
    interval = rng.integers(0, 16, COUNT)
    pixel = rng.integers(0, WIDTH * HEIGHT, COUNT)
    order = np.lexsort((pixel, interval, pixel * TILES // (WIDTH * HEIGHT)))
    t = interval * INTERVAL_US + rng.integers(0, INTERVAL_US, COUNT)
    p = rng.integers(0, 2, COUNT)
    return t[order], pixel[order] % WIDTH, pixel[order] // WIDTH, p


@pytest.mark.benchmark(group="sorting 200,000 events")
def test_sort_events(benchmark, columns):
    assert is_sorted(benchmark(sort_events, make_events(*columns)))


@pytest.mark.benchmark(group="sorting 200,000 events")
def test_sort_of_packed_keys(benchmark, columns):
    """What the pixel array does: one integer an event, time first."""
    t, x, y, p = columns
    keys = (t << (PIXEL_BITS + 1)) | ((y * WIDTH + x) << 1) | p
    sort = benchmark(np.sort, keys)
    expected = sort_events(make_events(*columns))
    assert np.array_equal(sort >> (PIXEL_BITS + 1), expected["t"])
    assert np.array_equal((sort >> 1) & ((1 << PIXEL_BITS) - 1), _places(expected))


def _places(events):
    return events["y"].astype(np.int64) * WIDTH + events["x"]
