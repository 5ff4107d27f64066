"""Tick of the time stamps: events wait for the next tick, in their order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from through_hooks import bursts, out_of

from adv2e.effects.readout.timestamp_tick import TimestampTickHooks, ticked
from adv2e.events import make_events, sort_events


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.lists(st.integers(0, 300), max_size=6), st.floats(0.3, 40.0))
def test_ticks_do_not_depend_on_chunks_and_are_never_early(seed, cuts, tick_us):
    events = bursts(seed, 300, 900)
    whole = out_of(TimestampTickHooks(tick_us), events)
    assert out_of(TimestampTickHooks(tick_us), events, sorted(cuts)).tobytes() == whole.tobytes()
    assert whole.tobytes() == sort_events(whole).tobytes()
    late = ticked(events["t"], tick_us) - events["t"]
    assert late.min() >= -0.5
    assert late.max() < tick_us + 0.5


def test_ticks_by_hand():
    times = np.array([0, 1, 249, 250, 251, 1001], np.int64)
    assert ticked(times, 250.0).tolist() == [0, 250, 250, 250, 500, 1250]
    assert ticked(times, 62.5).tolist() == [0, 62, 250, 250, 312, 1062]


@pytest.mark.parametrize("cuts", [(), (1,), (2, 3)])
def test_a_coarse_clock_leaves_the_events_of_a_pixel_in_their_order(cuts):
    events = make_events([1, 20, 300, 400, 700], [5, 5, 5, 2, 5], [1, 1, 1, 1, 1], [1, 0, 1, 1, 0])
    found = out_of(TimestampTickHooks(1000.0), events, cuts)
    assert found["t"].tolist() == [1000] * 5
    assert found["x"].tolist() == [2, 5, 5, 5, 5]
    assert found["p"][1:].tolist() == [1, 0, 1, 0]
