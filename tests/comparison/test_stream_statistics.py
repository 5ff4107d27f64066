from __future__ import annotations

import numpy as np
import pytest

from adv2e.comparison.compare import stream_statistics
from adv2e.comparison.features import trains
from adv2e.events import empty_events, make_events


def test_times_run_to_the_next_event_of_the_same_pixel_of_either_polarity():
    events = make_events([0, 100, 500, 1600, 2000], [3, 4, 3, 3, 4], [2] * 5, [1, 1, 0, 1, 1])
    counts, times = trains(events, 12)
    assert sorted(times.tolist()) == [500, 1100, 1900]
    assert sorted(counts.tolist()) == [2, 3]


def test_times_are_those_of_a_loop_over_the_events(events):
    expected, last = [], {}
    for event in events:
        place = (event["x"], event["y"])
        if place in last:
            expected.append(event["t"] - last[place])
        last[place] = event["t"]
    counts, times = trains(events, 12)
    assert sorted(times) == sorted(expected)
    assert sorted(counts) == sorted(np.unique(events[["x", "y"]], return_counts=True)[1])


def test_quantiles_and_short_share():
    steps = np.arange(1, 102) * 100
    events = make_events(np.cumsum(np.r_[0, steps]), [1] * 102, [1] * 102, [1] * 102)
    found = stream_statistics(events, 1.0, 12, 9)
    assert found["inter_event_us_50"] == 5_100
    assert found["inter_event_us_01"] == 200
    assert found["inter_event_us_99"] == 10_000
    assert found["inter_event_share_under_1ms"] == pytest.approx(9 / 101)


def test_pixels_that_fire_once_have_no_times():
    for events in (make_events([1, 2], [1, 2], [1, 1], [1, 1]), empty_events()):
        found = stream_statistics(events, 1.0, 12, 9)
        assert {value for name, value in found.items() if "inter_event" in name} == {None}


def test_counts_rates_and_share():
    events = make_events([0, 1, 2, 3], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 1, 0])
    found = stream_statistics(events, 0.5, 4, 2)
    counted = {name: value for name, value in found.items() if "inter_event" not in name}
    assert counted == {
        "events": 4,
        "on_events": 3,
        "off_events": 1,
        "rate": 1.0,
        "on_rate": pytest.approx(0.75),
        "off_rate": pytest.approx(0.25),
        "on_share": 0.75,
    }


def test_no_events_have_no_share():
    found = stream_statistics(empty_events(), 0.5, 4, 2)
    assert found["on_share"] is None
    assert found["rate"] == 0
