"""Frames smeared along a known motion, and made sharp again."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e.config.active_effects import active_hooks
from adv2e.config.model import Config, Frames, Sampling
from adv2e.effects.frames.exposure_blur import ExposureBlurHooks
from adv2e.effects.frames.motion_blur import MotionBlurHooks, sharpened, smear, spread, velocity
from adv2e.effects.hooks import View
from adv2e.motion.estimate import Motion
from adv2e.motion.warping import ONE_SIDED, UNKNOWN

ROWS, COLUMNS = 64, 80


def texture(x, y, seed=3):
    """Return light about 80 DN, nothing in it finer than 8 pixels."""
    draw = np.random.default_rng(seed)
    waves, phases = draw.uniform(-0.085, 0.085, (30, 2)), draw.uniform(0.0, 1.0, 30)
    turns = np.multiply.outer(waves[:, 0], x) + np.multiply.outer(waves[:, 1], y)
    return 80.0 * np.exp(0.12 * np.sin(2.0 * np.pi * (turns + phases[:, None, None])).sum(axis=0))


def pixels():
    return np.meshgrid(np.arange(COLUMNS, dtype=float), np.arange(ROWS, dtype=float))


def pan(t, step=(8.0, -3.0)):
    x, y = pixels()
    return texture(x - step[0] * t, y - step[1] * t)


def disk(t, step=7.0):
    x, y = pixels()
    inside = np.clip(11.5 - np.hypot(x - 30.0 - step * t, y - 32.0), 0.0, 1.0)
    return (1.0 - inside) * texture(x, y) + inside * 0.2 * texture(x - step * t, y, 4)


def exposed(scene, t, share):
    """Return the mean of a scene over an exposure, a share of the frame interval long."""
    parts = [scene(t + share * ((k + 0.5) / 64 - 0.5)) for k in range(64)]
    return np.mean(parts, axis=0).astype(np.float32)


def restored(frames, times_us, exposure_us):
    hooks = MotionBlurHooks(exposure_us)
    hooks.begin(View(ROWS, COLUMNS, 0, 0.0))
    timed = [(round(1e3 * t), frame) for t, frame in zip(times_us, frames, strict=True)]
    found = list(hooks.light(iter(timed)))
    assert [t for t, _ in found] == [t for t, _ in timed]
    return [light for _, light in found]


def error(light, truth, border=10):
    inner = slice(border, -border), slice(border, -border)
    return float(np.sqrt(np.mean((np.log(light[inner]) - np.log(truth[inner])) ** 2)))


def flat(value, shape=(ROWS, COLUMNS)):
    return np.full(shape, value, np.float32)


def test_smear_is_the_mean_along_the_way():
    x, y = pixels()
    # of a parabola: x^2 + |w|^2 / 12 of the variance of the way
    light = (0.01 * x * x + 0.3 * y).astype(np.float64)
    out = np.empty_like(light)
    smear(light, flat(6.0), flat(-2.0), out)
    inner = slice(8, -8), slice(8, -8)
    np.testing.assert_allclose(out[inner], (light + 0.01 * 36.0 / 12.0)[inner], rtol=1e-3)
    smear(light, flat(0.0), flat(0.0), out)
    assert np.array_equal(out, light)


def test_a_smear_holds_wherever_it_reaches_and_the_longer_wins():
    u, v = flat(0.0, (7, 15)), flat(0.0, (7, 15))
    u[3, 7], v[3, 9] = 6.0, 4.0
    wide_u, wide_v = np.empty_like(u), np.empty_like(v)
    spread(u, v, wide_u, wide_v)
    assert np.flatnonzero(wide_u[3]).tolist() == list(range(4, 11))
    assert np.flatnonzero(wide_u.any(axis=1)).tolist() == [3]
    # the one that goes down is shorter: it keeps what the other does not pass over
    assert np.flatnonzero(wide_v[:, 9]).tolist() == [1, 2, 4, 5]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_known_smear_comes_back(dtype):
    truth, blurred = pan(0.0), exposed(pan, 0.0, 0.5).astype(dtype)
    light = sharpened(blurred, flat(4.0), flat(-1.5))
    assert light.dtype == dtype
    assert error(light, truth) < 0.2 * error(blurred, truth)


@pytest.mark.parametrize(("scene", "share"), [(pan, 0.4), (disk, 0.8)])
@pytest.mark.thorough
def test_what_moves_becomes_sharp(scene, share):
    times = np.arange(4.0)
    blurred = [exposed(scene, t, 0.5) for t in times]
    found = restored(blurred, 40_000.0 * times, 20_000.0)
    for t, before, after in zip(times, blurred, found, strict=True):
        assert error(after, scene(t)) < share * error(before, scene(t))


@pytest.mark.thorough
def test_uneven_times_count():
    times = np.array([0.0, 1.0, 1.5, 2.5])
    blurred = [exposed(pan, t, 0.5) for t in times]
    found = restored(blurred, 40_000.0 * times, 20_000.0)
    for t, before, after in zip(times, blurred, found, strict=True):
        assert error(after, pan(t)) < 0.4 * error(before, pan(t))


@pytest.mark.thorough
def test_pixels_at_rest_stay_to_the_bit():
    frames = [exposed(disk, t, 0.5) for t in (0.0, 1.0)]
    x, y = pixels()
    far = np.hypot(np.maximum(np.abs(x - 33.5) - 7.0, 0.0), y - 32.0) > 20.0
    for before, after in zip(frames, restored(frames, [0.0, 4e4], 2e4), strict=True):
        assert far.mean() > 0.5
        assert np.array_equal(before[far], after[far])


def test_frames_of_which_no_motion_is_known_stay_as_they_are():
    draw = np.random.default_rng(1)
    cut = [draw.uniform(1.0, 255.0, (ROWS, COLUMNS)).astype(np.float32) for _ in range(2)]
    for frames in (cut, [cut[0], cut[0].copy()], cut[:1], []):
        times = 4e4 * np.arange(len(frames))
        for before, after in zip(frames, restored(frames, times, 2e4), strict=True):
            assert after is before


@pytest.mark.thorough
def test_light_that_is_zero_is_allowed():
    def dark(t):
        light = disk(t)
        light[:, 60:] = 0.0
        return light

    frames = [exposed(dark, t, 0.5) for t in (0.0, 1.0, 2.0)]
    for light in restored(frames, [0.0, 4e4, 8e4], 2e4):
        assert np.isfinite(light).all()
        assert light.min() >= 0.0


def motion(u, v=0.0, score=0.1):
    return Motion(flat(u), flat(v), flat(score))


def test_velocity_is_the_slope_of_the_path_through_three_frames():
    # x = 3 t + 2 t^2: at t = 1 it is 5, at t = -0.5 it is -1
    u, v = velocity(motion(5.0), 1.0, motion(-1.0), 0.5)
    np.testing.assert_allclose(u, 3.0, rtol=1e-6)
    np.testing.assert_allclose(v, 0.0)


def test_velocity_of_what_was_hit_is_the_slower():
    for after, before in ((motion(9.0), motion(-2.0)), (motion(2.0), motion(-9.0))):
        u, _ = velocity(after, 1.0, before, 1.0)
        np.testing.assert_allclose(u, 2.0)


def test_velocity_comes_from_the_frame_that_shows_the_pixel():
    lost, none = motion(9.0, score=ONE_SIDED), motion(9.0, score=UNKNOWN)
    assert velocity(None, 1.0, None, 1.0) is None
    np.testing.assert_allclose(velocity(None, 1.0, motion(-3.0), 2.0)[0], 1.5)
    np.testing.assert_allclose(velocity(motion(4.0), 2.0, None, 1.0)[0], 2.0)
    np.testing.assert_allclose(velocity(lost, 1.0, motion(-3.0), 1.0)[0], 3.0)
    np.testing.assert_allclose(velocity(motion(4.0), 1.0, lost, 1.0)[0], 4.0)
    np.testing.assert_allclose(velocity(none, 1.0, none, 1.0)[0], 0.0)


def test_interpolation_tells_which_way_exposure_is_undone():
    for interpolation, wanted in (("flow", MotionBlurHooks), ("linear", ExposureBlurHooks)):
        config = Config(
            frames=Frames(exposure_us=9e3), sampling=Sampling(interpolation=interpolation)
        )
        hooks = active_hooks(config)
        assert [type(hook) for hook in hooks] == [wanted]
        assert hooks[0].name == "exposure_blur"
