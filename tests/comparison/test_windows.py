from __future__ import annotations

import numpy as np
import pytest

from adv2e.comparison.windows import fixed_windows, frame_windows, span_of, to_us
from adv2e.errors import DataError
from adv2e.events import cut, empty_events, make_events

FRAMES_NS = np.arange(6) * 10_000_000


def test_only_frame_intervals_inside_all_spans_count():
    windows = frame_windows(FRAMES_NS, [(5_000, 45_000), (0, 31_000)])
    assert windows.used == ((10_000, 20_000), (20_000, 30_000))
    assert windows.total == 5
    assert windows.duration_s == 0.02


def test_a_span_that_ends_on_a_frame_takes_the_interval_before_it():
    assert frame_windows(FRAMES_NS, [(0, 20_000)]).used == ((0, 10_000), (10_000, 20_000))


def test_fixed_windows_begin_with_the_later_stream():
    windows = fixed_windows(10_000, [(1_003, 35_000), (12_000, 60_000)])
    assert windows.used == ((12_000, 22_000), (22_000, 32_000))
    assert windows.total == 2


def test_no_whole_window_in_common_is_an_error_that_says_so():
    with pytest.raises(DataError, match=r"share 0.005 s, which hold none of the frame intervals"):
        frame_windows(FRAMES_NS, [(12_000, 40_000), (0, 17_000)])


def test_cut_is_half_open():
    events = make_events([1, 2, 3, 4], [0] * 4, [0] * 4, [1] * 4)
    assert cut(events, 2, 4)["t"].tolist() == [2, 3]


def test_span_covers_events_and_frames():
    events = make_events([3, 40], [0, 0], [0, 0], [1, 1])
    assert span_of(events) == (3, 40)
    assert span_of(events, np.array([0, 50_000])) == (0, 50)
    assert span_of(empty_events(), np.array([1_000, 50_000])) == (1, 50)
    assert span_of(empty_events()) is None


def test_nanoseconds_go_to_the_nearest_microsecond():
    assert to_us(np.array([1_499, 1_500, -1_400])).tolist() == [1, 2, -1]
