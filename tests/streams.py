"""Streams of events at random places and times."""

from __future__ import annotations

import numpy as np

from adv2e.events import make_events, sort_events


def random_events(seed, count, *, first=0, last=100_000, size=(12, 9)):
    """Sorted events of a sensor of `size` in first..last [us]."""
    draw = np.random.default_rng(seed)
    return sort_events(
        make_events(
            draw.integers(first, last, count),
            draw.integers(0, size[0], count),
            draw.integers(0, size[1], count),
            draw.integers(0, 2, count),
        )
    )
