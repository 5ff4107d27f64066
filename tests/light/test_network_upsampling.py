"""Frames by a network: light there and back, instants, halves, tiles, threads."""

import numpy as np
import onnx_models
import pytest
from onnx import TensorProto, helper
from onnx_models import image, number

from adv2e import Config, simulate
from adv2e.config.model import Frames, Sampling
from adv2e.errors import ConfigError, DataError
from adv2e.light.interpolation import make_upsampler, network


def frames(shape=(30, 50), dtype=np.float32, seed=3):
    a, b = np.random.default_rng(seed).random((2, *shape))
    return (255 * a).astype(dtype), (255 * b).astype(dtype)


def encoded(light):
    share = light.astype(float) / 255
    return np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)


def decoded(value):
    return 255 * np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def blended(a, b, share):
    return decoded(encoded(a) + (encoded(b) - encoded(a)) * share)


def asking(path, L=4, **options):
    return Sampling(interpolation="onnx", model=str(path), L=L, **options)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("L", [2, 3, 10])
def test_any_instant_is_what_the_network_makes_of_encoded_light(tmp_path, dtype, L):
    path = onnx_models.blend(tmp_path / "a.onnx")
    a, b = frames(dtype=dtype)
    upsampler = make_upsampler(asking(path, L))
    made = list(upsampler.between(a, b))
    assert len(made) == upsampler.count(a, b) == L
    assert made[-1] is b
    for step, light in enumerate(made[:-1], start=1):
        assert light.dtype == dtype
        np.testing.assert_allclose(light, blended(a, b, step / L), atol=2e-3)


@pytest.mark.parametrize("L", [2, 8])
def test_a_network_without_time_halves(tmp_path, L):
    path = onnx_models.middle(tmp_path / "a.onnx")
    a, b = frames()
    made = list(make_upsampler(asking(path, L)).between(a, b))
    assert len(made) == L
    assert made[-1] is b
    # halves of halves of what is blended in between are blended themselves
    for step, light in enumerate(made[:-1], start=1):
        np.testing.assert_allclose(light, blended(a, b, step / L), atol=5e-3)


def test_a_network_without_time_needs_a_power_of_two(tmp_path):
    path = onnx_models.middle(tmp_path / "a.onnx")
    with pytest.raises(ConfigError, match=r"sampling\.L: a\.onnx .* such as 8 or 16, got 10"):
        make_upsampler(asking(path, 10))


def test_tiles_and_padding_change_nothing_for_what_blends(tmp_path, monkeypatch):
    monkeypatch.setattr(network, "LARGEST", 64)
    a, b = frames((70, 150))
    for stated in ({"size": (32, 48)}, {"multiple": 16}):
        path = onnx_models.blend(tmp_path / "a.onnx", **stated)
        for step, light in enumerate(make_upsampler(asking(path)).between(a, b), start=1):
            np.testing.assert_allclose(light, blended(a, b, step / 4), atol=2e-3)


def test_threads_change_nothing(tmp_path):
    kernel = np.random.default_rng(5).normal(0, 0.2, (8, 2, 5, 5)).astype(np.float32)
    back = np.random.default_rng(6).normal(0, 0.2, (1, 8, 3, 3)).astype(np.float32)
    constants = [
        helper.make_tensor("kernel", TensorProto.FLOAT, kernel.shape, kernel.ravel()),
        helper.make_tensor("back", TensorProto.FLOAT, back.shape, back.ravel()),
    ]
    nodes = [
        helper.make_node("Concat", ["img0", "img1"], ["both"], axis=1),
        helper.make_node("Conv", ["both", "kernel"], ["deep"], pads=[2, 2, 2, 2]),
        helper.make_node("Mul", ["deep", "timestep"], ["timed"]),
        helper.make_node("Tanh", ["timed"], ["bent"]),
        helper.make_node("Conv", ["bent", "back"], ["output"], pads=[1, 1, 1, 1]),
    ]
    inputs = [image("img0"), image("img1"), number("timestep")]
    path = onnx_models.save(tmp_path / "a.onnx", nodes, inputs, [image("output")], constants)
    a, b = frames((90, 130))
    one = list(make_upsampler(asking(path, 9)).between(a, b))
    assert not np.array_equal(one[0], one[4])
    for threads in (2, 3, 5):
        other = list(make_upsampler(asking(path, 9), threads=threads).between(a, b))
        assert all(np.array_equal(*pair) for pair in zip(one, other, strict=True))


def test_equal_frames_are_not_shown_to_it(tmp_path):
    nodes = [
        *onnx_models.blend_nodes(output="made"),
        helper.make_node("Sqrt", ["made"], ["output"]),
    ]
    inputs = [image("img0"), image("img1"), number("timestep")]
    path = onnx_models.save(tmp_path / "a.onnx", nodes, inputs, [image("output")])
    a, b = frames()
    upsampler = make_upsampler(asking(path))
    assert all(np.array_equal(light, a) for light in upsampler.between(a, a.copy()))
    assert not np.array_equal(next(upsampler.between(a, b)), a)


def test_what_is_no_number_is_refused_with_its_time(tmp_path):
    nodes = [*onnx_models.blend_nodes(output="made"), helper.make_node("Log", ["made"], ["log"])]
    nodes += [helper.make_node("Sqrt", ["log"], ["output"])]  # of negative numbers
    inputs = [image("img0"), image("img1"), number("timestep")]
    path = onnx_models.save(tmp_path / "a.onnx", nodes, inputs, [image("output")])
    config = Config(frames=Frames(full_scale=255.0), sampling=asking(path))
    with pytest.raises(DataError, match=r"a frame made 0\.0025"):
        list(simulate(frames(), [0.0, 0.01], config))


def test_events_are_those_of_the_frames_that_it_makes(tmp_path):
    path = onnx_models.blend(tmp_path / "a.onnx")
    shown = [*frames(), frames(seed=4)[0]]
    times = [0.0, 0.02, 0.05]
    frames_are = Frames(full_scale=255.0)
    config = Config(frames=frames_are, sampling=asking(path, 5))
    asked = np.concatenate(list(simulate(shown, times, config)))
    between, at = [shown[0]], [0.0]
    for k in (0, 1):
        a, b, start, stop = shown[k], shown[k + 1], times[k], times[k + 1]
        for step in range(1, 6):
            made = blended(a, b, step / 5).astype(np.float32) if step < 5 else b
            between.append(made)
            at.append(start + (stop - start) * step / 5)
    given = np.concatenate(
        list(simulate(between, at, Config(frames=frames_are, sampling=Sampling(L=1))))
    )
    assert len(asked) > 1000
    # rounding of light moves single events by a microsecond
    assert abs(len(asked) - len(given)) < 0.002 * len(given)
    same = np.isin(asked, given).mean()
    assert same > 0.99
