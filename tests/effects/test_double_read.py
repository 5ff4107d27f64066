"""Double reads: a share of the events comes twice, by polarity."""

from __future__ import annotations

import numpy as np
import pytest
from through_hooks import COLUMNS, bursts, out_of

from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.hints.stamps import double_reads
from adv2e.effects.readout.double_read import DoubleRead, DoubleReadHooks
from adv2e.events import make_events, sort_events

ROWS = 12


def spread(count=60_000):
    """Return events far apart in each pixel: no two of one within a millisecond."""
    draws = np.random.default_rng(1)
    t = 1000 * np.arange(1, count // (ROWS * COLUMNS) + 1)[:, None] + np.arange(ROWS * COLUMNS)
    y, x = np.divmod(np.broadcast_to(np.arange(ROWS * COLUMNS), t.shape).ravel(), COLUMNS)
    return sort_events(make_events(t.ravel(), x, y, draws.integers(0, 2, t.size)))


def pairs(events):
    """Return events less than 2 us after one of their pixel, and those before them, looked up."""
    last, found = {}, []
    for t, x, y, p in events[["t", "x", "y", "p"]].tolist():
        before = last.get((x, y))
        if before is not None and t - before[0] < 2:
            found.append((before[1], p, t - before[0]))
        last[x, y] = t, p
    return found


def test_both_readings_are_as_the_event_and_draws_are_by_pixel():
    events = spread()
    ons = np.count_nonzero(events["p"])
    hook = DoubleReadHooks(DoubleRead(on=0.1, off=0.3))
    made = out_of(hook, events)
    found = np.array(pairs(made))
    assert np.all(found[:, 0] == found[:, 1])
    assert np.mean(found[:, 2]) == pytest.approx(0.5, abs=0.02)
    assert np.sum(found[:, 1]) / ons == pytest.approx(0.1, rel=0.05)
    assert np.sum(1 - found[:, 1]) / (len(events) - ons) == pytest.approx(0.3, rel=0.03)
    assert len(made) == len(events) + len(found)
    assert out_of(hook, events, (1, 5000, 5001)).tobytes() == made.tobytes()
    assert out_of(hook, events, seed=1).tobytes() != made.tobytes()
    one = events[events["x"] == 3]
    assert out_of(hook, one).tobytes() == made[made["x"] == 3].tobytes()


def test_one_of_both_readings_is_on_the_first_as_often_as_the_second():
    events = spread()
    hook = DoubleReadHooks(DoubleRead(on=0.2, off=0.2, polarity="on"))
    first, second, _ = np.array(pairs(out_of(hook, events))).T
    kinds = np.bincount(2 * first + second, minlength=4) / len(first)
    assert kinds == pytest.approx([0, 0.25, 0.25, 0.5], abs=0.02)


def test_events_of_one_stamp_stay_sorted_across_chunks():
    events = bursts(1)
    made = out_of(DoubleReadHooks(DoubleRead(on=1, off=1)), events, (7, 8, 2000))
    assert len(made) == 2 * len(events)
    assert made.tobytes() == sort_events(made).tobytes()


@pytest.mark.parametrize("polarity", ["same", "on"])
def test_the_shares_are_read_off_the_stamps(polarity):
    true = DoubleRead(on=0.02, off=0.05, polarity=polarity)
    made = out_of(DoubleReadHooks(true), spread())
    found = double_reads(Stream.of(made, COLUMNS, ROWS))
    assert found.polarity == polarity
    assert (found.on, found.off) == pytest.approx((true.on, true.off), rel=0.1)


def test_no_shares_are_read_off_events_apart_or_a_coarse_clock():
    apart = spread()
    assert double_reads(Stream.of(apart, COLUMNS, ROWS)) is None
    made = out_of(DoubleReadHooks(DoubleRead(on=0.1, off=0.1)), apart)
    made["t"] -= made["t"] % 10
    assert double_reads(Stream.of(made, COLUMNS, ROWS)) is None
