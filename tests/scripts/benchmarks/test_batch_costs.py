"""What hours of recordings cost: that the hours are what the rates come to."""

import pytest
from benchmarks.batch_costs import Case, cost, report


def test_hours_are_what_the_rates_come_to(tmp_path):
    case = Case("small", 346, 260, 10.0)
    found = cost(case, 0.2, 1, tmp_path)
    pixels = 346 * 260
    frames = 3 / 0.2 * 3600  # three frames, of which the first begins
    assert found.core_hours == pytest.approx(found.core_ns * pixels * frames / 1e9 / 3600)
    assert found.gigaevents == pytest.approx(found.rate_hz * pixels * 3600 / 1e9)
    assert found.gigabytes == pytest.approx(found.gigaevents * found.event_bytes)
    text = report({"small": found}, [12.0, 10_000.0])
    assert "| 12 h: core hours |" in text
    assert "| 10,000 h: GB |" in text
    assert f"| {found.core_ns:.0f} |" in text
