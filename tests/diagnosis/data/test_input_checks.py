"""What looks like a mistake in a recording: told, and only where there is one."""

import dataclasses

import numpy as np
import pytest
from made_up.streams import PERIOD_S, scene_of, stream_of

from adv2e.diagnosis.data.input_checks import check_inputs
from adv2e.diagnosis.data.scene import Placed

ROWS, COLUMNS, FRAMES = 12, 20, 30


def picture():
    """Return the light of a pattern that moves, and is not symmetric, (frames, rows, columns)."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    t = np.arange(FRAMES)[:, None, None]
    wave = np.sin(0.7 * x + 0.05 * x * y - 0.6 * t) + 0.5 * np.cos(0.9 * y + 0.3 * t)
    return (60.0 * np.exp(0.4 * wave)).astype(np.float32)


def events_of(scene, count=4000, seed=1):
    """Return a stream of which every event goes with the light."""
    draw = np.random.default_rng(seed)
    t = np.sort(draw.uniform(scene.times_us[0], scene.times_us[-1] - 1, count)).astype(np.int64)
    pixel = draw.integers(0, scene.pixels, count)
    on = scene.slope[scene.interval_of(t), pixel] > 0
    x, y = pixel % COLUMNS, pixel // COLUMNS
    return stream_of(t, x, y, on.astype(np.int8), COLUMNS, ROWS)


LIGHT = picture()
SCENE = scene_of(LIGHT)
STREAM = events_of(SCENE)


def told(stream=STREAM, scene=SCENE, light=LIGHT):
    return check_inputs(Placed.of(stream, scene), scene, light)


def test_nothing_is_told_of_events_that_go_with_the_light():
    assert told() == []


def test_swapped_polarities_are_told():
    (line,) = told(dataclasses.replace(STREAM, on=1 - STREAM.on))
    assert "ON events come where the light falls" in line


@pytest.mark.parametrize(
    ("turn", "which"),
    [
        (lambda x, y: (COLUMNS - 1 - x, y), "left to right"),
        (lambda x, y: (x, ROWS - 1 - y), "upside down"),
        (lambda x, y: (COLUMNS - 1 - x, ROWS - 1 - y), "by half a turn"),
    ],
)
def test_mirrored_events_are_told(turn, which):
    x, y = turn(STREAM.pixel % COLUMNS, STREAM.pixel // COLUMNS)
    pixel = (y * COLUMNS + x).astype(np.int32)
    (line,) = told(dataclasses.replace(STREAM, pixel=pixel))
    assert f"turned {which}" in line


def test_events_at_random_tell_no_direction():
    draw = np.random.default_rng(2)
    assert told(dataclasses.replace(STREAM, on=draw.integers(0, 2, len(STREAM)))) == []


def test_a_part_of_the_sensor_without_events_is_told():
    inside = (STREAM.pixel % COLUMNS < 10) & (STREAM.pixel // COLUMNS < 8)
    lines = told(STREAM.chosen(inside))
    assert [line.partition(",")[0] for line in lines] == [
        "no event has x above 9",
        "no event has y above 7",
    ]


def test_missing_frames_are_told():
    times = SCENE.times_us.copy()
    times[10:] += 30e6 * PERIOD_S
    lines = told(scene=dataclasses.replace(SCENE, times_us=times))
    start, stop = times[9] / 1e6, times[10] / 1e6
    assert lines == [
        f"no frames from {start:.3f} to {stop:.3f} s: what moves there is made up, so look at the"
        " time before or after it (--start, --stop)"
    ]


def test_frames_in_the_dark_or_all_the_same_are_told():
    assert "is frames.full_scale right?" in told(light=LIGHT / 1000.0)[0]
    assert told(light=np.repeat(LIGHT[:1], FRAMES, axis=0)) == [
        "the frames are all the same: nothing that moves can be simulated from them, so only noise"
        " can be judged"
    ]
