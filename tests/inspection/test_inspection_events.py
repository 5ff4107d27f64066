from __future__ import annotations

import numpy as np
import pytest

from adv2e.events import empty_events, make_events, sort_events
from adv2e.inspection.inspect import describe_events, oddities_of, tick_us


def regular(count=5000, step_us=50):
    """Events of a 32x32 sensor, one pixel after another."""
    n = np.arange(count)
    return make_events(n * step_us, n % 32, n // 32 % 32, n % 2)


def test_counts_span_and_rates():
    events = make_events([5, 15, 500_005], [0, 1, 0], [0, 0, 1], [1, 1, 0])
    assert describe_events(events, 4, 2) == {
        "count": 3,
        "on": 2,
        "off": 1,
        "on_share": pytest.approx(2 / 3),
        "first_us": 5,
        "last_us": 500_005,
        "duration_s": 0.5,
        "rate_hz": 6,
        "rate_per_pixel_hz": 0.75,
        "tick_us": 10,
        "causes": None,
    }


def test_what_few_events_cannot_tell_is_none():
    none = describe_events(empty_events(), 0, 0)
    assert (none["count"], none["on_share"], none["first_us"], none["rate_hz"]) == (
        0,
        None,
        None,
        None,
    )
    one = describe_events(make_events([5], [0], [0], [1]), 4, 2)
    assert (one["duration_s"], one["rate_hz"], one["tick_us"]) == (0, None, None)


@pytest.mark.parametrize(("times", "tick"), [([7, 1007, 4007], 1000), ([0, 64, 96], 32)])
def test_the_tick_divides_all_differences(times, tick):
    assert tick_us(make_events(times, [0] * 3, [0] * 3, [1] * 3)) == tick


def test_a_plain_stream_has_no_oddities():
    assert oddities_of(regular(), 32, 32) == []
    assert oddities_of(empty_events(), 0, 0) == []


def test_a_gap_is_named_with_its_length_and_place():
    events = regular()
    events["t"][2000:] += 30_000
    assert oddities_of(events, 32, 32) == [
        "1 gap over 10 ms, the longest of 30.05 ms after 0.09995 s"
    ]


def test_a_slow_stream_needs_longer_gaps():
    events = regular(step_us=1000)
    events["t"][2000:] += 90_000
    assert oddities_of(events, 32, 32) == []
    events["t"][3000:] += 100_000
    assert "1 gap over 100 ms" in oddities_of(events, 32, 32)[0]


def test_hot_pixels_are_listed_by_place_the_hottest_first():
    hot = [(7, 3, 300), (2, 9, 200), *((x, 20, 100) for x in range(5))]
    streams = [regular()]
    for x, y, count in hot:
        t = np.linspace(0, 200_000, count).astype(int)
        streams.append(make_events(t, [x] * count, [y] * count, [1] * count))
    events = sort_events(np.concatenate(streams))
    # seven hot ones of 40,000 pixels leave the 99.9 % quantile alone
    (line,) = oddities_of(events, 200, 200)
    assert line.startswith("7 hot pixels (x, y): (7, 3): 305 events, (2, 9): 205 events, (0, 20):")
    assert line.endswith("and 2 more")
