"""Windows of a stream that comes in parts, against those of the whole stream."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from streams import random_events

from adv2e.exporting.voxels import before_images, between_images, by_count, by_time


@pytest.fixture(params=[1, 7, 1000, 5000])
def parts(request):
    events = random_events(4, 3000, first=500, last=99_000)
    return events, lambda: iter(np.array_split(events, len(events) // request.param or 1))


def inside(events, start, stop):
    return events[(events["t"] >= start) & (events["t"] < stop)]


def test_windows_of_one_length_to_the_last_whole_one(parts):
    events, stream = parts
    first = int(events["t"][0])
    slices = list(by_time(stream(), first, 7000))
    starts = list(range(first, int(events["t"][-1]) - 7000 + 1, 7000))
    assert [(s.start_us, s.stop_us) for s in slices] == [(t, t + 7000) for t in starts]
    for part in slices:
        assert np.array_equal(part.events, inside(events, part.start_us, part.stop_us))


def test_windows_of_one_count(parts):
    events, stream = parts
    slices = list(by_count(stream(), 700))
    assert len(slices) == 4
    assert np.array_equal(np.concatenate([s.events for s in slices]), events[:2800])
    for part in slices:
        times = part.events["t"]
        assert (part.start_us, part.stop_us, times.size) == (times[0], times[-1], 700)


def test_windows_between_images_also_where_there_are_no_events(parts):
    events, stream = parts
    images = [0, 300, 20_000, 20_001, 60_000, 120_000, 130_000]
    slices = list(between_images(stream(), images))
    spans = list(itertools.pairwise(images))
    assert [(s.start_us, s.stop_us) for s in slices] == spans
    for part in slices:
        assert np.array_equal(part.events, inside(events, part.start_us, part.stop_us))


def test_windows_before_images_may_overlap(parts):
    events, stream = parts
    images = [0, 10_000, 20_000, 30_000, 200_000]
    slices = list(before_images(stream(), images, 25_000))
    assert len(slices) == 5
    for t, part in zip(images, slices, strict=True):
        assert np.array_equal(part.events, inside(events, t - 25_000, t))
