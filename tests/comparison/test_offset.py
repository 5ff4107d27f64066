from __future__ import annotations

import pytest

from adv2e.comparison.offset import latency_offset_us
from adv2e.events import empty_events

WIDTH = 12


@pytest.mark.parametrize("shift", [0, 3_210, -17_000])
def test_the_offset_of_a_shifted_stream_is_found(events, shift):
    later = events.copy()
    later["t"] += shift
    assert latency_offset_us(events, later, WIDTH) == pytest.approx(shift, abs=10)


def test_the_offset_survives_missing_and_foreign_events(random_events):
    measured = random_events(1, 3000)
    simulated = measured[::2].copy()
    simulated["t"] += 5_000
    simulated[::3] = random_events(2, len(simulated[::3]))
    assert latency_offset_us(measured, simulated, WIDTH) == pytest.approx(5_000, abs=200)


def test_unrelated_streams_have_none(random_events):
    assert latency_offset_us(random_events(1, 3000), random_events(2, 3000), WIDTH) is None


def test_opposite_streams_have_none_at_zero(events):
    opposite = events.copy()
    opposite["p"] = 1 - opposite["p"]
    assert latency_offset_us(events, opposite, WIDTH) is None


def test_offsets_beyond_reach_are_not_given(random_events):
    measured = random_events(1, 300, last=1_000)
    simulated = measured.copy()
    simulated["t"] += 200_000
    assert latency_offset_us(measured, simulated, WIDTH) is None


def test_empty_streams_have_none(events):
    assert latency_offset_us(events, empty_events(), WIDTH) is None
    assert latency_offset_us(empty_events(), empty_events(), WIDTH) is None
