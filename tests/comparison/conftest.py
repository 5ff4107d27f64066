from __future__ import annotations

import numpy as np
import pytest

from adv2e.events import make_events, sort_events

WIDTH, HEIGHT = 12, 9


def random_events(seed, count, *, first=0, last=100_000):
    """Sorted events at random places and times in first..last [us]."""
    draw = np.random.default_rng(seed)
    return sort_events(
        make_events(
            draw.integers(first, last, count),
            draw.integers(0, WIDTH, count),
            draw.integers(0, HEIGHT, count),
            draw.integers(0, 2, count),
        )
    )


@pytest.fixture(name="random_events")
def _random_events():
    return random_events


@pytest.fixture
def events():
    return random_events(1, 3000)
