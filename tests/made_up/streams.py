"""Small scenes and streams for the tests of the diagnosis, none of which is simulated."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.events import EVENT_DTYPE

WIDTH, HEIGHT = 16, 12
FRAMES, PERIOD_S = 21, 0.01
STOP_US = int((FRAMES - 1) * PERIOD_S * 1e6)


def wandering_light(
    width=WIDTH, height=HEIGHT, frames=FRAMES, seed=0, step=0.15, still_columns=None
):
    """Return light [DN] that wanders about 50 DN on its own in each pixel, still at the left."""
    draw = np.random.default_rng(seed)
    steps = draw.normal(0.0, step, (frames, height, width))
    steps[0] = draw.normal(0.0, 0.7, (height, width))
    steps[1:, :, : width // 4 if still_columns is None else still_columns] = 0.0
    return (50.0 * np.exp(np.clip(np.cumsum(steps, axis=0), -3.0, 1.5))).astype(np.float32)


def scene_of(light, period_s=PERIOD_S, start_s=0.0, quantum_dn=0.0):
    return Scene.of(light, start_s + period_s * np.arange(len(light)), quantum_dn)


def some_scene(width=WIDTH, height=HEIGHT, **options):
    return scene_of(wandering_light(width, height, **options))


def stream_of(t, x, y, on, width=WIDTH, height=HEIGHT):
    """Return a stream of events in any order."""
    events = np.zeros(len(t), EVENT_DTYPE)
    events["t"], events["x"], events["y"], events["p"] = t, x, y, on
    return Stream.of(events[np.argsort(events["t"], kind="stable")], width, height)


def random_stream(count, seed=0, width=WIDTH, height=HEIGHT, stop_us=STOP_US, pixels=None):
    """Return events anywhere and at any time, or in the first `pixels` pixels only."""
    draw = np.random.default_rng(seed)
    pixel = draw.integers(0, pixels or width * height, count)
    t = draw.integers(0, stop_us, count)
    return stream_of(t, pixel % width, pixel // width, draw.integers(0, 2, count), width, height)


@st.composite
def streams(draw, width=WIDTH, height=HEIGHT, most=60):
    """Draw small streams that crowd in few pixels, some with no or one event, many at one time."""
    count = draw(st.integers(0, most))
    seed = draw(st.integers(0, 2**32 - 1))
    pixels = draw(st.sampled_from([1, 3, width * height]))
    stop_us = draw(st.sampled_from([3, 900, STOP_US]))
    return random_stream(count, seed, width, height, stop_us, pixels)


def placed(stream, scene):
    return Placed.of(stream, scene)


def statistics(group, where):
    """Return the statistics of all data by name."""
    values = group.values(group.count(where).sum(axis=0))
    return dict(zip((entry.name for entry in group.entries), values, strict=True))
