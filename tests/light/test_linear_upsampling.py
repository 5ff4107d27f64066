from __future__ import annotations

import numpy as np
import pytest

from adv2e.config.model import Sampling
from adv2e.errors import ConfigError
from adv2e.light.interpolation import make_upsampler


def frames(dtype=np.float32, shape=(24, 31)):
    rng = np.random.default_rng(5)
    a, b = (255.0 * rng.random(shape)).astype(dtype), (255.0 * rng.random(shape)).astype(dtype)
    b[:7] = a[:7]
    return a, b


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_light_is_linear_in_time(dtype):
    a, b = frames(dtype)
    made = list(make_upsampler(Sampling(L=7)).between(a, b))
    assert len(made) == 7
    for number, light in enumerate(made, start=1):
        expected = a.astype(float) + (b.astype(float) - a.astype(float)) * number / 7
        assert light.dtype == dtype
        np.testing.assert_allclose(light, expected, rtol=0, atol=512 * np.finfo(dtype).eps)


def test_the_last_frame_is_the_second_itself():
    a, b = frames()
    assert list(make_upsampler(Sampling(L=4)).between(a, b))[-1] is b


def test_one_frame_an_interval_is_the_second_frame_alone():
    a, b = frames()
    made = list(make_upsampler(Sampling(L=1)).between(a, b))
    assert len(made) == 1
    assert made[0] is b


def test_pixels_that_do_not_change_keep_every_bit():
    a, b = frames()
    for light in make_upsampler(Sampling(L=10)).between(a, b):
        assert np.array_equal(light[:7], a[:7])


def test_frames_given_are_left_as_they_are_and_each_result_is_its_own():
    a, b = frames()
    before = a.copy(), b.copy()
    made = list(make_upsampler(Sampling(L=3)).between(a, b))
    made[0][:] = -1
    assert np.array_equal(a, before[0])
    assert np.array_equal(b, before[1])
    assert not np.any(made[1] == -1)


@pytest.mark.parametrize("shape", [(1, 1), (4, 1), (1, 4), (3, 5)])
def test_frames_of_any_size(shape):
    a, b = frames(shape=shape)
    middle = next(make_upsampler(Sampling(L=2)).between(a, b))
    assert middle.shape == shape
    np.testing.assert_allclose(middle, (a.astype(float) + b) / 2, rtol=1e-6)


def test_views_of_larger_arrays():
    a, b = frames()
    middle = next(make_upsampler(Sampling(L=2)).between(a[::2, ::3], b[::2, ::3]))
    np.testing.assert_allclose(middle, (a[::2, ::3].astype(float) + b[::2, ::3]) / 2, rtol=1e-6)


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
def test_pairs_that_do_not_fit_are_refused(interpolation):
    a, b = frames()
    upsampler = make_upsampler(Sampling(interpolation=interpolation, L=2))
    with pytest.raises(ValueError, match="two frames"):
        next(upsampler.between(a, b[:5]))
    with pytest.raises(ValueError, match="two frames"):
        next(upsampler.between(a, b.astype(np.float64)))
    with pytest.raises(ValueError, match="must be float32 or float64"):
        next(upsampler.between(a.astype(np.uint8), b.astype(np.uint8)))


def test_unknown_interpolation_names_key_and_choices():
    with pytest.raises(
        ConfigError, match="interpolation: must be one of linear, flow, given, onnx, got 'cubic'"
    ):
        Sampling(interpolation="cubic")


def test_no_frames_an_interval_is_refused():
    with pytest.raises(ConfigError, match="L: must be at least 1, got 0"):
        Sampling(L=0)
