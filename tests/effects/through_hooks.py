"""Effects by hooks, run by themselves: frames through `light`, events through `events`."""

from __future__ import annotations

import numpy as np

from adv2e.effects.hooks import View
from adv2e.events import make_events, sort_events


def run(hook, frames):
    """Return times [ns] and light that come out of `hook`."""
    found = list(hook.light(iter(frames)))
    return [t for t, _ in found], np.stack([light for _, light in found])


def still(*values, dtype=np.float32):
    return [(1000 * k, np.full((2, 3), v, dtype)) for k, v in enumerate(values)]


ROWS, COLUMNS = 12, 10


def out_of(hook, events, cuts=(), start_s=0.0, seed=0):
    """Return the events that come out of `hook`, `events` cut into chunks."""
    hook.begin(View(ROWS, COLUMNS, seed, start_s))
    parts = list(hook.events(iter(np.split(events, list(cuts)))))
    return np.concatenate(parts) if parts else events[:0]


def bursts(seed, count=4000, span_us=20_000):
    """Return sorted events, many at the same time and in the same row."""
    draws = np.random.default_rng(seed)
    t = np.sort(draws.choice(draws.integers(0, span_us, count // 4), count))
    columns = draws.integers(0, COLUMNS, count), draws.integers(0, ROWS, count)
    return sort_events(make_events(t, *columns, draws.integers(0, 2, count)))
