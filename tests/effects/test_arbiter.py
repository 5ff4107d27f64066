"""Arbiter: rows wait to be read out, by hand and beside the brute-force camera."""

from __future__ import annotations

import numpy as np
import pytest
from camera.readout import Stream
from camera.readout import arbiter as camera_arbiter
from hypothesis import given, settings
from hypothesis import strategies as st
from through_hooks import COLUMNS, ROWS, bursts, out_of

from adv2e.effects.readout.arbiter import Arbiter, ArbiterHooks
from adv2e.events import make_events, sort_events
from adv2e.kernel import rng


@pytest.mark.parametrize(("event_ns", "row_ns"), [(500, 3000), (3000, 0), (0, 20000), (2000, 9000)])
@pytest.mark.parametrize("start_s", [0.0, 1_468_941_032.0])
def test_arbiter_is_that_of_the_camera(event_ns, row_ns, start_s):
    events = bursts(3)
    shifted = events.copy()
    shifted["t"] += round(start_s * 1e6)
    found = out_of(
        ArbiterHooks(Arbiter(event_ns=event_ns, row_ns=row_ns)), shifted, (7, 900, 2500), start_s
    )
    pixels = events["y"].astype(np.int64) * COLUMNS + events["x"]
    within = rng.next_uniforms(0, rng.REQUEST, pixels, np.zeros(ROWS * COLUMNS, np.int64))
    # in microseconds: what comes at the same time as a latch must not hang on rounding
    stream = Stream(
        events["t"] + (within - 0.5), pixels, np.where(events["p"], 1, -1).astype(np.int64)
    ).in_order()
    wanted = camera_arbiter(stream, COLUMNS, event_ns * 1e-3, row_ns * 1e-3)
    y, x = np.divmod(wanted.pixel, COLUMNS)
    stamps = np.rint(wanted.time) + round(start_s * 1e6)
    again = sort_events(make_events(stamps, x, y, wanted.polarity > 0))
    assert len(again) < len(events)
    assert found.tobytes() == again.tobytes()


def test_arbiter_serves_the_row_that_waited_longest_from_left_to_right():
    # row 5 asks first and is selected at 10 us; what asks until then goes with it
    events = make_events([0, 2, 9, 11], [7, 1, 3, 0], [5, 2, 5, 5], [1, 1, 0, 1])
    found = out_of(ArbiterHooks(Arbiter(event_ns=1000.0, row_ns=10_000.0)), events)
    # 3 and 7 of row 5 leave at 11 and 12 us, row 2 at 23 us, the rest of row 5 at 34 us
    assert found["t"].tolist() == [11, 12, 23, 34]
    assert found["x"].tolist() == [3, 7, 1, 0]
    assert found["y"].tolist() == [5, 5, 2, 5]
    assert found["p"].tolist() == [0, 1, 1, 1]


def test_a_pixel_that_waits_cannot_ask_again():
    events = make_events([0, 1, 10, 12], [4] * 4, [4] * 4, [1, 0, 0, 1])
    found = out_of(ArbiterHooks(Arbiter(event_ns=1000.0, row_ns=10_000.0)), events)
    assert found["t"].tolist() == [11, 23]
    assert found["p"].tolist() == [1, 1]


def test_what_leaves_the_arbiter_is_not_rounded_twice():
    # one event a millisecond, so that none waits for another
    t = 1000 * np.arange(1, 4001)
    events = make_events(t, t // 1000 % COLUMNS, t // 1000 % ROWS, np.ones(t.size))
    found = out_of(ArbiterHooks(Arbiter(event_ns=500.0, row_ns=4000.0)), events)
    waited = found["t"] - t
    assert set(waited.tolist()) == {4, 5}
    assert np.mean(waited == 4) == pytest.approx(0.5, abs=0.04)


def test_rows_that_ask_the_arbiter_together_are_served_in_any_order():
    t = np.repeat(1000 * np.arange(1, 2001), 2)
    events = make_events(t, np.full(t.size, 3), np.tile([2, 7], 2000), np.ones(t.size))
    found = out_of(ArbiterHooks(Arbiter(event_ns=1000.0, row_ns=10_000.0)), events)
    first = found["y"][::2]
    assert np.mean(first == 2) == pytest.approx(0.5, abs=0.06)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.lists(st.integers(0, 300), max_size=6))
def test_arbiter_does_not_depend_on_chunks(seed, cuts):
    events = bursts(seed, 300, 900)
    hook = ArbiterHooks(Arbiter(event_ns=700.0, row_ns=2500.0))
    whole = out_of(hook, events)
    assert out_of(hook, events, sorted(cuts)).tobytes() == whole.tobytes()
    assert whole.tobytes() == sort_events(whole).tobytes()
