"""Every pixel and time belongs to exactly one part of the data."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.splits import Split

SIZES = [(1, 1), (4, 4), (5, 3), (32, 24), (1280, 4), (2, 900), (240, 180), (346, 260)]


def segment_by_hand(t, borders):
    return max(k for k in range(len(borders) - 1) if k == 0 or t >= borders[k])


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_pixel_has_one_part_in_every_segment(width, height):
    division = Split.of(width, height, 0.0, 1e6)
    assert division.label.shape == (division.segments, width * height)
    assert set(np.unique(division.label)) <= {splits.TRAIN, splits.VALIDATION, splits.TEST}
    assert sum(division.share(part) for part in range(splits.COUNT)) == pytest.approx(1.0)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_pixel_is_in_every_part_at_some_time(width, height):
    division = Split.of(width, height, 0.0, 1e6)
    for part, segments in ((splits.TRAIN, 2), (splits.VALIDATION, 1), (splits.TEST, 1)):
        np.testing.assert_array_equal((division.label == part).sum(axis=0), segments)
    assert [division.share(part) for part in range(splits.COUNT)] == [0.5, 0.25, 0.25]


@pytest.mark.parametrize(("width", "height"), [(4, 4), (32, 24), (346, 260), (1280, 4)])
def test_every_segment_has_all_parts_in_all_regions(width, height):
    division = Split.of(width, height, 0.0, 1e6)
    size = max(1, min(8, width // 4, height // 4))
    for label in division.label.reshape(-1, height, width):
        for start in range(0, width - 4 * size + 1, 4 * size):
            row = label[0, start : start + 4 * size]
            assert set(row.tolist()) == {splits.TRAIN, splits.VALIDATION, splits.TEST}


def test_a_tile_has_one_part():
    label = Split.of(64, 48, 0.0, 1e6).label.reshape(-1, 6, 8, 8, 8)
    np.testing.assert_array_equal(label, np.broadcast_to(label[:, :, :1, :, :1], label.shape))


def test_tiles_beside_and_below_do_not_all_agree():
    label = Split.of(64, 48, 0.0, 1e6).label.reshape(-1, 6, 8, 8, 8)[:, :, 0, :, 0]
    assert np.mean(label[:, 1:] == label[:, :-1]) < 0.6
    assert np.mean(label[:, :, 1:] == label[:, :, :-1]) < 0.6


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.integers(-50, 1100), max_size=30),
    st.floats(-20.0, 20.0),
    st.floats(10.0, 1000.0),
)
def test_the_segment_of_a_time(times, start, length):
    division = Split.of(4, 4, start, start + length)
    times = np.sort(np.array(times, np.int64))
    expected = [segment_by_hand(t, division.borders_us.tolist()) for t in times.tolist()]
    found = division.segment_of(times)
    assert found.tolist() == expected
    assert found.shape == times.shape


def test_segments_have_the_same_length():
    division = Split.of(4, 4, 1e15, 1e15 + 4e6)
    np.testing.assert_array_equal(np.diff(division.borders_us), 1e6)


def test_the_text_names_parts_and_shares():
    text = Split.of(32, 24, 0.0, 1e6).text()
    assert "train 50%, validation 25%, test 25%" in text
    assert "4 segments" in text
