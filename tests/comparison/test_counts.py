from __future__ import annotations

import pytest

from adv2e.comparison.counts import count_statistics
from adv2e.events import empty_events, make_events


def test_counts_rates_and_share():
    events = make_events([0, 1, 2, 3], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 1, 0])
    assert count_statistics(events, 0.5, 4, 2) == {
        "events": 4,
        "on_events": 3,
        "off_events": 1,
        "rate": 1.0,
        "on_rate": pytest.approx(0.75),
        "off_rate": pytest.approx(0.25),
        "on_share": 0.75,
    }


def test_no_events_have_no_share():
    found = count_statistics(empty_events(), 0.5, 4, 2)
    assert found["on_share"] is None
    assert found["rate"] == 0
