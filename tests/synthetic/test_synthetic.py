from __future__ import annotations

import cv2
import numpy as np
import pytest

from adv2e.errors import OutputError
from adv2e.synthetic import Scene
from adv2e.synthetic.scene import (
    BRIGHTEST,
    DARKEST,
    GO_S,
    PERIOD_S,
    RAMP_S,
    encode_srgb,
    write_video,
)

REST = 0.7  # a time at which the scene rests
MOTION = 0.3


def test_light_is_float32_of_the_size_asked_for_and_in_range():
    light = Scene(3).light(MOTION, 64, 48)
    assert light.shape == (48, 64)
    assert light.dtype == np.float32
    assert light.min() >= DARKEST
    assert light.max() <= BRIGHTEST


def test_contrast_is_about_50_to_1():
    light = Scene().light(MOTION, 173, 130)
    low, high = np.percentile(light, [0.5, 99.5])
    assert high / low > 35
    assert 45 < BRIGHTEST / DARKEST < 55


def test_same_seed_same_light_other_seed_other_light():
    first = Scene(1).light(MOTION, 40, 30)
    assert np.array_equal(first, Scene(1).light(MOTION, 40, 30))
    assert np.abs(first - Scene(2).light(MOTION, 40, 30)).mean() > 5


def test_nothing_changes_while_it_rests_and_much_while_it_moves():
    scene = Scene()
    assert scene.speed(REST) == scene.speed(REST + 0.2) == 0
    assert np.array_equal(scene.light(REST, 64, 48), scene.light(REST + 0.2, 64, 48))
    assert scene.speed(MOTION) == 1
    assert np.abs(scene.light(MOTION, 64, 48) - scene.light(MOTION + 0.05, 64, 48)).mean() > 1


def test_it_starts_and_goes_on_period_after_period():
    scene = Scene()
    assert scene.speed(0) == 0
    assert scene.speed(PERIOD_S + MOTION) == 1
    assert scene.path_s(3 * PERIOD_S) == pytest.approx(3 * (GO_S + RAMP_S))


def test_path_is_the_integral_of_the_speed():
    scene = Scene()
    times = np.linspace(0, 2.3 * PERIOD_S, 20001)
    speed = np.array([scene.speed(t) for t in times])
    path = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(times))])
    assert np.allclose([scene.path_s(t) for t in times], path, atol=1e-6)


def test_light_is_smooth_in_time_far_below_a_pixel():
    # a step of 0.1 ms moves the picture by about a thousandth of a pixel
    scene = Scene()
    steps = np.diff([scene.light(MOTION + k * 1e-4, 64, 48) for k in range(5)], axis=0)
    moving = np.abs(steps[0]) > 0.01
    assert moving.mean() > 0.3
    assert np.allclose(steps[1][moving], steps[0][moving], rtol=0.2, atol=2e-3)


def test_a_larger_picture_shows_the_same_finer():
    small = Scene().light(MOTION, 64, 48)
    large = Scene().light(MOTION, 256, 192)
    shrunk = large.reshape(48, 4, 64, 4).mean(axis=(1, 3))
    assert np.corrcoef(small.ravel(), shrunk.ravel())[0, 1] > 0.97


def test_srgb_codes():
    assert encode_srgb(np.array([0.0, 255.0, 300.0, -1.0])).tolist() == [0, 255, 255, 0]
    # computed by hand from IEC 61966-2-1: 0.18 is 0.4613 and, in the straight part, 0.002 is 0.0258
    assert encode_srgb(np.array([0.18 * 255, 0.002 * 255])).tolist() == [118, 7]


def test_avi_clip_holds_the_scene_without_loss(tmp_path):
    path = tmp_path / "clip.avi"
    write_video(Scene(), path, width=64, height=48, fps=25, duration_s=0.2)
    video = cv2.VideoCapture(str(path))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    assert video.get(cv2.CAP_PROP_FPS) == 25
    assert len(frames) == 5
    for k, frame in enumerate(frames):
        grey = encode_srgb(Scene().light(k / 25, 64, 48))
        assert np.array_equal(frame, np.repeat(grey[:, :, None], 3, axis=2))


def test_mp4_clip_is_close_to_the_scene(tmp_path):
    path = tmp_path / "clip.mp4"
    write_video(Scene(), path, width=64, height=48, fps=30, duration_s=0.1)
    frame = cv2.VideoCapture(str(path)).read()[1][:, :, 1]
    grey = encode_srgb(Scene().light(0, 64, 48))
    assert np.abs(frame.astype(int) - grey).mean() < 5


def test_a_clip_is_not_replaced_unless_asked(tmp_path):
    path = tmp_path / "clip.avi"
    path.write_text("mine")
    with pytest.raises(OutputError, match=r"clip\.avi: exists"):
        write_video(Scene(), path, width=16, height=12, duration_s=0.1)
    assert path.read_text() == "mine"
    write_video(Scene(), path, width=16, height=12, duration_s=0.1, overwrite=True)
    assert path.stat().st_size > 100
    assert list(tmp_path.iterdir()) == [path]
