"""Event loss: a share of the events, drawn by pixel."""

from __future__ import annotations

import pytest
from through_hooks import bursts, out_of

from adv2e.effects.readout.event_loss import EventLoss, EventLossHooks


def test_loss_takes_its_share_and_draws_by_pixel():
    events = bursts(1, 40_000, 2_000_000)
    hook = EventLossHooks(EventLoss(fraction=0.25))
    kept = out_of(hook, events)
    assert len(kept) / len(events) == pytest.approx(0.75, abs=0.01)
    assert out_of(hook, events, (1, 5000, 5001)).tobytes() == kept.tobytes()
    assert out_of(hook, events, seed=1).tobytes() != kept.tobytes()
    one = events[events["x"] == 3]
    assert out_of(hook, one).tobytes() == kept[kept["x"] == 3].tobytes()
    assert len(out_of(EventLossHooks(EventLoss(fraction=1.0)), events)) == 0
