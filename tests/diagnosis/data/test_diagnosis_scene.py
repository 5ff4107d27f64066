"""What frames say of a place: how fast it changes and how bright it is."""

import numpy as np
import pytest
from made_up.streams import HEIGHT, WIDTH, placed, random_stream, scene_of, wandering_light

from adv2e.diagnosis.data.scene import (
    BRIGHTNESSES,
    SPEEDS,
    STILL,
    STILL_PER_S,
    _weighted_quantiles,
)


def columns(*courses, height=4, repeat=1):
    """Return light of frames in which each column has a course of its own [DN]."""
    one = np.array(courses, np.float32).T
    return np.repeat(np.repeat(one[:, None, :], height, axis=1), repeat, axis=2)


def growth(per_s, frames=11, period_s=0.01, start=50.0):
    return start * np.exp(per_s * period_s * np.arange(frames))


def test_slopes_are_of_the_logarithm():
    scene = scene_of(columns(growth(0.0), growth(2.0), growth(-3.0)))
    slope = scene.slope.reshape(10, 4, 3)
    np.testing.assert_allclose(slope, np.broadcast_to([0.0, 2.0, -3.0], (10, 4, 3)), atol=1e-3)
    assert scene.intervals == 10
    assert scene.pixels == 12


def test_unequal_frame_intervals():
    light = columns([10.0, 20.0, 40.0, 20.0])
    from adv2e.diagnosis.data.scene import Scene

    scene = Scene.of(light, np.array([0.0, 0.01, 0.05, 0.06]), 0.0)
    np.testing.assert_allclose(scene.slope[:, 0], np.log(2) * np.array([100, 25, -100]), rtol=1e-5)


def test_speeds_by_hand():
    # equal weight of change in each class: 6 slow columns, 2 of three times the speed, 1 of six
    courses = [growth(0.0)] + [growth(1.0)] * 6 + [growth(3.0)] * 2 + [growth(6.0)]
    speed = scene_of(columns(*courses)).speed.reshape(10, 4, 10)
    np.testing.assert_array_equal(speed[:, :, 0], STILL)
    slow, middle, fast = speed[:, :, 1], speed[:, :, 7], speed[:, :, 9]
    assert slow.max() < middle.max() <= fast.max() == SPEEDS - 1
    assert slow.min() > STILL
    for same in (speed[:, :, 1:7], speed[:, :, 7:9]):
        np.testing.assert_array_equal(same, np.broadcast_to(same[:, :, :1], same.shape))


@pytest.mark.parametrize(("per_s", "still"), [(0.9, True), (1.1, False)])
def test_below_the_least_change_a_place_is_still(per_s, still):
    scene = scene_of(columns(growth(per_s * STILL_PER_S), growth(5.0)))
    speed = scene.speed.reshape(10, 4, 2)
    assert np.all((speed[:, :, 0] == STILL) == still)
    assert np.all(speed[:, :, 1] != STILL)


def test_a_place_that_stops_is_still_after_a_while():
    course = np.concatenate([growth(10.0, 6), np.full(60, growth(10.0, 6)[-1])])
    speed = scene_of(columns(course, np.full(66, 30.0))).speed[:, 0]
    # 10/s decays with 50 ms to 0.3/s in 175 ms
    assert np.all(speed[:5] != STILL)
    assert np.all(speed[5:21] != STILL)
    assert np.all(speed[24:] == STILL)


def test_constant_frames_are_all_still():
    scene = scene_of(np.full((5, 4, 6), 80.0, np.float32), quantum_dn=1.0)
    assert np.all(scene.speed == STILL)
    assert np.all(scene.slope == 0.0)
    assert scene.brightness.max() < BRIGHTNESSES


def test_steps_of_the_quantum_do_not_count_as_motion():
    course = np.where(np.arange(20) % 2, 51.0, 50.0)
    dithering = columns(course, growth(30.0, 20, start=1.0))
    coarse = scene_of(dithering, quantum_dn=1.0).speed.reshape(19, 4, 2)
    assert np.all(coarse[:, :, 0] == STILL)
    assert np.any(coarse[:, :, 1] != STILL)
    exact = scene_of(dithering, quantum_dn=0.0).speed.reshape(19, 4, 2)
    assert np.all(exact[:, :, 0] != STILL)


def test_black_is_held_at_a_floor():
    scene = scene_of(columns([0.0, 0.0, 100.0, 0.0, 1e-9]))
    assert np.all(np.isfinite(scene.slope))
    assert abs(scene.slope[1, 0]) == pytest.approx(np.log(1000.0) / 0.01, rel=1e-4)


def test_brightness_has_thirds_of_what_moves():
    dark, medium, bright = (growth(3.0, start=start) for start in (5.0, 40.0, 150.0))
    scene = scene_of(columns(dark, medium, bright, np.full(11, 250.0), np.full(11, 2.0)))
    found = scene.brightness.reshape(10, 4, 5)[:, 0]
    assert np.all(found[:, 0] <= found[:, 1])
    assert np.all(found[:, 1] <= found[:, 2])
    np.testing.assert_array_equal(found[:, 3], BRIGHTNESSES - 1)
    np.testing.assert_array_equal(found[:, 4], 0)
    assert set(found.ravel().tolist()) == {0, 1, 2}


def test_quantiles_share_out_the_weight():
    draw = np.random.default_rng(3)
    values = draw.normal(size=(50, 400)).astype(np.float32)
    weight = draw.exponential(size=values.shape).astype(np.float32) ** 3
    edges = _weighted_quantiles(values, weight, 4)
    share = np.bincount(np.digitize(values, edges).ravel(), weight.ravel()) / weight.sum()
    np.testing.assert_allclose(share, 0.25, atol=0.02)


def test_quantiles_without_weight_share_out_the_values():
    values = np.arange(90, dtype=np.float32)[None]
    edges = _weighted_quantiles(values, np.zeros_like(values), 3)
    share = np.bincount(np.digitize(values, edges).ravel()) / 90
    np.testing.assert_allclose(share, 1 / 3, atol=0.03)


@pytest.mark.parametrize("late_us", [0.0, 2500.0, -12_000.0])
def test_the_interval_of_a_time(late_us):
    scene = scene_of(wandering_light(), start_s=5.0)
    t = np.sort(np.random.default_rng(1).integers(4_900_000, 5_300_000, 500))
    found = scene.interval_of(t, late_us)
    last = scene.intervals - 1
    expected = [
        min(last, max(0, int(np.sum(scene.times_us <= time - late_us)) - 1)) for time in t.tolist()
    ]
    assert found.tolist() == expected


def test_events_are_placed():
    scene = scene_of(wandering_light())
    stream = random_stream(300, seed=2)
    found = placed(stream, scene)
    for k in range(0, 300, 7):
        interval = int(stream.t[k] // 10_000)
        segment = int(stream.t[k] // 50_000)
        pixel = stream.pixel[k]
        assert (found.interval[k], found.segment[k]) == (interval, segment)
        assert found.part[k] == scene.split.label[segment, pixel]
        assert found.speed[k] == scene.speed[interval, pixel]
        assert found.brightness[k] == scene.brightness[interval, pixel]


def test_no_event_is_placed_nowhere():
    found = placed(random_stream(0), scene_of(wandering_light()))
    for column in (found.interval, found.segment, found.part, found.speed, found.brightness):
        assert column.shape == (0,)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (4, 4), (600, 2), (WIDTH, HEIGHT)])
def test_any_size_of_sensor(width, height):
    scene = scene_of(wandering_light(width, height))
    found = placed(random_stream(50, width=width, height=height), scene)
    assert scene.speed.shape == (20, width * height)
    assert len(found.part) == 50
