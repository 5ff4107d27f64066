"""Frames: integrals of the scene, their numbers, their clock."""

import numpy as np
import pytest

from camera.camera import Camera
from camera.helpers import QUIET, still
from camera.scene import Flat, Still
from camera.scenes import patchwork
from camera.shutter import encoded, exposed

pytestmark = pytest.mark.thorough


def frames(scene, hidden=None, **options):
    given = {"size": (6, 4), "duration_s": 0.1, "fps": 100.0, **options}
    return list(Camera(scene, QUIET, hidden={"frames": hidden or {}}, **given).frames())


def light(frame, white=65535):
    return 255.0 * frame.image / white


def swinging(t):
    return 100.0 + 80.0 * np.sin(2 * np.pi * 31.0 * t)


def test_frames_are_instants_at_their_rate_from_zero_to_the_end():
    found = frames(Flat(swinging))
    times = np.arange(11) / 100.0
    np.testing.assert_allclose([f.stamp for f in found], times)
    means = np.array([light(f).mean() for f in found])
    np.testing.assert_allclose(means, swinging(times), atol=0.003)


def test_exposure_integrates_the_scene():
    found = frames(Flat(swinging), {"exposure_us": 8000.0})
    w, half = 2 * np.pi * 31.0, 0.004
    times = np.arange(11) / 100.0
    whole = 100.0 + 80.0 * np.sin(w * times) * np.sin(w * half) / (w * half)
    np.testing.assert_allclose([light(f).mean() for f in found], whole, atol=0.005)


def test_exposure_of_a_moving_scene_is_its_mean_picture():
    scene = patchwork((16, 12), seed=5, speed=3.0)
    view = scene.view(np.arange(16.0), np.arange(12.0))
    fine = view.light(0.05 + 0.006 * ((np.arange(4000) + 0.5) / 4000 - 0.5)).mean(axis=0)
    sharp = view.light(np.array([0.05]))[0]
    found = exposed(view, 0.05, 0.006, np.ones_like)
    assert np.abs(fine - sharp).max() > 1.0
    np.testing.assert_allclose(found, fine, atol=0.01)


@pytest.mark.parametrize(
    ("encoding", "decode"),
    [
        ("linear", lambda v: v),
        ("gamma:2.2", lambda v: v**2.2),
        ("srgb", lambda v: np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)),
    ],
)
def test_numbers_decode_to_the_light(encoding, decode):
    values = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(decode(encoded(values, encoding)), values, atol=2e-5)
    image = frames(still(60.0), {"encoding": encoding})[0].image
    assert 255 * decode(image[0, 0] / 65535) == pytest.approx(60.0, abs=0.01)


def test_black_level_is_missing_in_the_frames():
    found = frames(Still(lambda x, y: 2.0 + 10.0 * x + 0 * y), {"black_level_dn": 5.0})
    np.testing.assert_allclose(light(found[0])[0], [0.0, 7.0, 17.0, 27.0, 37.0, 47.0], atol=0.003)


def test_frames_of_eight_bits():
    image = frames(still(61.3), {"full_scale": 255})[0].image
    assert image.dtype == np.uint8
    assert np.all(image == 61)


def test_shift_moves_the_picture_in_the_frames_right_and_down():
    scene = Still(lambda x, y: 50.0 + 10.0 * x + 3.0 * y)
    straight = light(frames(scene)[0])
    moved = light(frames(scene, {"shift_px": [0.5, -1.0]})[0])
    np.testing.assert_allclose(moved, straight - 5.0 + 3.0, atol=0.01)


def test_clock_of_the_frames_runs_late_and_slow():
    found = frames(still(60.0), {"clock_offset_us": 15000.0, "clock_drift_ppm": 500.0})
    assert len(found) == 9  # those at 0 and 10 ms would have negative stamps
    for frame in found:
        assert frame.stamp * (1 + 500e-6) + 0.015 == pytest.approx(frame.time, abs=1e-12)
    early = frames(still(60.0), {"clock_offset_us": -3000.0})
    assert early[0].stamp == pytest.approx(0.003)


def test_frames_see_of_the_flicker_what_the_exposure_leaves():
    lamp = {"frequency_hz": 120.0, "depth": 0.3, "in_frames": "shutter"}
    deep = np.ptp([light(f).mean() for f in frames(still(100.0), {"flicker": lamp})])
    given = {"flicker": lamp, "exposure_us": 5000.0}
    shallow = np.ptp([light(f).mean() for f in frames(still(100.0), given)])
    x = np.pi * 120.0 * 0.005
    assert shallow / deep == pytest.approx(np.sin(x) / x, rel=1e-3)
    averaged = frames(still(100.0), {"flicker": {**lamp, "in_frames": "averaged"}})
    assert np.ptp([f.image for f in averaged]) == 0
