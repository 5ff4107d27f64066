"""Frames brought to a sensor, against a dense twin, and what is said of it."""

from __future__ import annotations

import hashlib

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from adv2e.config.model import FITS, Sensor
from adv2e.errors import ConfigError, DataError
from adv2e.light.sensor import fitting_of

SIZES = [
    ((7, 5), (4, 3)),
    ((5, 7), (4, 3)),
    ((4, 3), (7, 5)),  # enlarged
    ((3, 8), (6, 4)),
    ((12, 8), (4, 4)),  # whole ratios
    ((9, 6), (3, 2)),
    ((1, 1), (5, 3)),
    ((13, 4), (13, 3)),
    ((6, 4), (5, 5)),
]


def fitting(frames, sensor, fit="crop"):
    return fitting_of(*frames, Sensor(width=sensor[0], height=sensor[1], fit=fit), "a clip")


def dense(frame, width, height, fit):
    """Return the same by repeating each pixel until all edges fall between two of them."""
    rows, columns = frame.shape
    unit = 2 * width * height
    steps = unit * columns // width, unit * rows // height  # of a pixel of the sensor
    if fit != "stretch":
        steps = (min(steps),) * 2 if fit == "crop" else (max(steps),) * 2
    whole = np.kron(frame, np.ones((unit, unit)))
    for axis, (step, size) in enumerate(zip(steps[::-1], (height, width), strict=True)):
        over = whole.shape[axis] - step * size
        assert over % 2 == 0
        if over < 0:
            beside = [(0, 0), (0, 0)]
            beside[axis] = (-over // 2, -over // 2)
            whole = np.pad(whole, beside)
        else:
            kept = np.arange(over // 2, over // 2 + step * size)
            whole = whole.take(kept, axis=axis)
    return whole.reshape(height, steps[1], width, steps[0]).mean(axis=(1, 3))


@pytest.mark.parametrize("fit", ["crop", "pad", "stretch"])
@pytest.mark.parametrize(("frames", "sensor"), SIZES)
def test_each_pixel_is_the_mean_of_the_light_on_its_area(frames, sensor, fit):
    light = np.random.default_rng(1).uniform(0, 255, frames[::-1]).astype(np.float32)
    seen = fitting(frames, sensor, fit).light(light, "")
    assert seen.dtype == np.float32
    expected = dense(light.astype(np.float64), *sensor, fit).astype(np.float32)
    np.testing.assert_array_max_ulp(seen, expected, 1)


SIDE = st.integers(1, 9)


@given(st.tuples(SIDE, SIDE), st.tuples(SIDE, SIDE), st.sampled_from(["crop", "pad", "stretch"]))
@settings(max_examples=60, deadline=None)
def test_any_ratio_of_sizes_is_exact(frames, sensor, fit):
    light = np.random.default_rng(sum(frames)).uniform(0, 255, frames[::-1]).astype(np.float32)
    try:
        made = fitting(frames, sensor, fit)
    except DataError:  # next to nothing of the frames would be left
        assume(False)
    seen = light if made is None else made.light(light, "")
    expected = dense(light.astype(np.float64), *sensor, fit).astype(np.float32)
    np.testing.assert_array_max_ulp(seen, expected, 1)


def test_the_result_is_the_same_everywhere():
    """Whatever the versions of NumPy and OpenCV, and the processor."""
    light = (np.arange(720 * 1280) % 4099).reshape(720, 1280).astype(np.float32) * np.float32(0.06)
    digests = []
    for sensor, fit in [((346, 260), "crop"), ((240, 180), "pad"), ((1500, 731), "stretch")]:
        seen = fitting((1280, 720), sensor, fit).light(light, "")
        digests.append(hashlib.sha256(seen.astype("<f4").tobytes()).hexdigest()[:16])
    assert digests == ["99c6c809fb05d8bb", "e9dd12c48deac66a", "e08c9d1c4aa133a0"]


def test_a_film_for_a_davis346_is_near_the_area_filter_of_opencv():
    """Which is not exact, and has no rectangle between pixels."""
    light = np.random.default_rng(1).uniform(0, 255, (720, 1280)).astype(np.float32)
    seen = fitting((1280, 720), (346, 260), "stretch").light(light, "")
    theirs = cv2.resize(light, (346, 260), interpolation=cv2.INTER_AREA)
    np.testing.assert_allclose(seen, theirs, rtol=2e-6)


@pytest.mark.parametrize("fit", ["crop", "stretch"])
@pytest.mark.parametrize(
    ("frames", "sensor"),
    [*SIZES, ((1280, 720), (346, 260)), ((346, 260), (640, 480)), ((4099, 17), (997, 13))],
)
def test_constant_light_stays_as_it_is_to_the_last_bit(frames, sensor, fit):
    for light in np.random.default_rng(2).uniform(1e-6, 2e5, 5).astype(np.float32):
        seen = fitting(frames, sensor, fit).light(np.full(frames[::-1], light), "")
        assert seen.shape == sensor[::-1]
        assert np.all(seen == light)


def test_no_pixel_is_brighter_or_darker_than_what_it_sees():
    light = np.random.default_rng(3).choice([0.0, 1e-3, 255.0], (31, 47)).astype(np.float32)
    for sensor in ((13, 11), (100, 90)):
        seen = fitting((47, 31), sensor).light(light, "")
        assert seen.min() >= 0.0
        assert seen.max() <= 255.0


def test_padding_is_black():
    seen = fitting((8, 4), (4, 4), "pad").light(np.full((4, 8), 90.0, np.float32), "")
    assert seen.tolist() == [[0.0] * 4, [90.0] * 4, [90.0] * 4, [0.0] * 4]


def test_a_pixel_that_the_edge_of_the_picture_crosses_sees_its_share():
    seen = fitting((4, 3), (2, 2), "pad").light(np.full((3, 4), 80.0, np.float32), "")
    assert seen.tolist() == [[60.0, 60.0], [60.0, 60.0]]


def test_enlarged_frames_show_their_pixels():
    light = np.array([[1.0, 5.0]], np.float32)
    seen = fitting((2, 1), (6, 3), "stretch").light(light, "")
    assert seen.tolist() == [[1.0, 1.0, 1.0, 5.0, 5.0, 5.0]] * 3


def test_what_is_cut_is_cut_at_both_ends():
    light = np.arange(7, dtype=np.float32).reshape(1, 7).repeat(2, axis=0)
    assert fitting((7, 2), (3, 2)).light(light, "").tolist() == [[2.0, 3.0, 4.0]] * 2
    assert fitting((7, 2), (4, 2)).light(light, "").tolist() == [[1.5, 2.5, 3.5, 4.5]] * 2


@pytest.mark.parametrize("fit", FITS)
def test_frames_of_the_size_of_the_sensor_stay_untouched(fit):
    assert fitting((346, 260), (346, 260), fit) is None
    assert fitting_of(32, 24, None, "") is None


@pytest.mark.parametrize(
    ("frames", "sensor", "fit", "text"),
    [
        ((1280, 720), (346, 260), "crop", "scaled to 462x260 and cut to 346x260"),
        ((720, 1280), (346, 260), "crop", "scaled to 346x615 and cut to 346x260"),
        ((692, 520), (346, 260), "crop", "scaled to 346x260"),
        ((400, 260), (346, 260), "crop", "cut to 346x260"),
        ((1280, 720), (346, 260), "stretch", "stretched to 346x260"),
        ((1280, 720), (346, 260), "pad", "scaled to 346x195, the rest of 346x260 is black"),
        ((300, 260), (346, 260), "pad", "the rest of 346x260 is black"),
    ],
)
def test_what_is_done_is_one_sentence(frames, sensor, fit, text):
    assert fitting(frames, sensor, fit).text() == text


def test_none_refuses_other_sizes():
    with pytest.raises(DataError, match=r"^a clip: frames are 8x4, but the sensor is 4x8 and"):
        fitting((8, 4), (4, 8), "none")


def test_next_to_nothing_of_the_frames_is_refused():
    with pytest.raises(DataError, match=r"^a clip: .* 100x300 would see 0\.67 of a pixel; say pad"):
        fitting((1000, 2), (100, 300), "crop")
    with pytest.raises(DataError, match=r"^a clip: .* fill 0\.0035 of a pixel of a sensor of 346x"):
        fitting((100_000, 1), (346, 260), "pad")
    seen = fitting((100_000, 1), (346, 260), "stretch").light(np.ones((1, 100_000)), "")
    assert np.all(seen == 1)


def test_frames_without_pixels_are_refused():
    with pytest.raises(DataError, match=r"^a clip: frames of 0x5 pixels$"):
        fitting((0, 5), (4, 4))


@pytest.mark.parametrize("light", [np.inf, np.nan, 1e6])
def test_light_that_cannot_be_is_named_before_it_spreads(light):
    frame = np.ones((4, 4))
    frame[1, 2] = light
    with pytest.raises(DataError, match=r"^frame 7: .*light"):
        fitting((4, 4), (2, 2)).light(frame, "frame 7")


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((0, 4), "width: must be at least 1 px, got 0"),
        ((4, 70_000), "height: must be at most 65536 px, got 70000"),
        ((60_000, 60_000), "width: 60000x60000 are 3,600,000,000 pixels; at most 33,554,432"),
    ],
)
def test_sensors_that_cannot_be_are_refused(size, message):
    with pytest.raises(ConfigError, match=f"^{message}"):
        Sensor(width=size[0], height=size[1])
