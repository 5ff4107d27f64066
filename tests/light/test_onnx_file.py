"""Files of networks: what is taken, what each is given, and what is refused."""

import hashlib

import numpy as np
import onnx_models
import pytest
from damage import damages
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper
from onnx_models import image, number

from adv2e.config.model import Sampling
from adv2e.errors import ConfigError, DataError, MissingExtraError
from adv2e.light.interpolation import make_upsampler, network_of
from adv2e.light.interpolation.onnx_file import Network, open_network


def values(shape=(32, 64), seed=1):
    return np.random.default_rng(seed).random((2, *shape)).astype(np.float32)


def srgb_light(value):
    """Return DN of values, in plain float64."""
    value = value.astype(float)
    low = value / 12.92
    return 255 * np.where(value <= 0.04045, low, ((value + 0.055) / 1.055) ** 2.4)


MAKERS = {
    "grey": onnx_models.blend,
    "colour": lambda path: onnx_models.blend(path, channels=3),
    "scalar time": lambda path: onnx_models.blend(path, time=()),
    "time of any length": lambda path: onnx_models.blend(path, time=("n",)),
    "plane of time": lambda path: onnx_models.blend(path, time=(1, 1, "rows", "columns")),
    "grey, four axes of time": lambda path: onnx_models.blend(path, time=(1, 1, 1, 1)),
    "colour, plane": lambda path: onnx_models.blend(path, 3, time=(1, 1, "rows", "columns")),
    "half precision": lambda path: onnx_models.blend(path, kind=TensorProto.FLOAT16),
    "double precision": lambda path: onnx_models.blend(path, kind=TensorProto.DOUBLE),
    "one size": lambda path: onnx_models.blend(path, size=(32, 64)),
    "film": onnx_models.blend_film,
    "rife_v2": onnx_models.blend_stacked,
}


@pytest.mark.parametrize("kind", MAKERS)
def test_each_form_gets_first_second_and_time(tmp_path, kind):
    network = open_network(MAKERS[kind](tmp_path / "a.onnx"))
    assert network.knows_time
    assert network.encoding == "srgb"
    assert network.multiple == 64
    assert network.size == ((32, 64) if kind == "one size" else (None, None))
    a, b = values()
    made = network.ask(a, b, 0.25)
    assert made.dtype == np.float32
    tolerance = 2e-3 if kind == "half precision" else 2e-6
    np.testing.assert_allclose(made, srgb_light(a + 0.25 * (b - a)), rtol=0, atol=255 * tolerance)


@pytest.mark.parametrize("maker", [onnx_models.middle, lambda p: onnx_models.blend_stacked(p, 6)])
def test_networks_without_time_make_the_middle(tmp_path, maker):
    network = open_network(maker(tmp_path / "a.onnx"))
    assert not network.knows_time
    a, b = values()
    np.testing.assert_allclose(network.ask(a, b, 0.5), srgb_light((a + b) / 2), atol=1e-3)
    assert "in the middle of two" in network.text


@pytest.mark.parametrize(
    ("first", "second", "inputs"),
    [
        ("frame0", "frame1", [number("timestep"), image("frame1"), image("frame0")]),
        ("left", "right", [image("left"), image("right"), number("timestep")]),
    ],
    ids=["by the number of its name", "by the order of the file"],
)
def test_the_first_image_is_told(tmp_path, first, second, inputs):
    nodes = onnx_models.blend_nodes(first, second)
    path = onnx_models.save(tmp_path / "a.onnx", nodes, inputs, [image("output")])
    a, b = values()
    np.testing.assert_allclose(
        open_network(path).ask(a, b, 0.1), srgb_light(a + 0.1 * (b - a)), atol=1e-3
    )


@pytest.mark.parametrize("encoding", ["linear", "srgb", "bt709", "gamma:2.2"])
def test_metadata_says_the_light_that_it_was_trained_on(tmp_path, encoding):
    path = onnx_models.blend(tmp_path / "a.onnx", encoding=encoding, multiple=16)
    network = open_network(path)
    assert (network.encoding, network.multiple) == (encoding, 16)
    light = np.linspace(0, 400, 64, dtype=np.float32).reshape(8, 8)
    value = network.value(light)
    if encoding == "gamma:2.2":
        np.testing.assert_allclose(value, (light / 255.0) ** (1 / 2.2), rtol=1e-5)
    # there and back, above white, too
    np.testing.assert_allclose(network.ask(value, value, 0.5), light, rtol=1e-5, atol=1e-4)
    assert np.array_equal(network.value(-light), np.zeros((8, 8)))


def test_colour_is_weighed_in_linear_light(tmp_path):
    scale = helper.make_tensor("scale", TensorProto.FLOAT, [1, 3, 1, 1], [1.0, 0.5, 0.25])
    nodes = [
        *onnx_models.blend_nodes(output="grey"),
        helper.make_node("Mul", ["grey", "scale"], ["output"]),
    ]
    path = onnx_models.save(
        tmp_path / "a.onnx",
        nodes,
        [image("img0", 3), image("img1", 3), number("timestep")],
        [image("output", 3)],
        [scale],
    )
    a, b = values()
    blended = a + 0.5 * (b - a)
    expected = (
        0.2126 * srgb_light(blended)
        + 0.7152 * srgb_light(0.5 * blended)
        + 0.0722 * srgb_light(0.25 * blended)
    )
    np.testing.assert_allclose(open_network(path).ask(a, b, 0.5), expected, atol=1e-3)


def test_what_comes_below_black_is_black(tmp_path):
    nodes = [
        *onnx_models.blend_nodes(output="made"),
        helper.make_node("Neg", ["made"], ["output"]),
    ]
    inputs = [image("img0"), image("img1"), number("timestep")]
    path = onnx_models.save(tmp_path / "a.onnx", nodes, inputs, [image("output")])
    a, b = values()
    assert np.all(open_network(path).ask(a, b, 0.5) == 0.0)


def test_its_digest_is_that_of_the_file_and_a_changed_file_is_read_anew(tmp_path):
    path = tmp_path / "a.onnx"
    onnx_models.blend(path)
    first = open_network(str(path))
    assert first.source == {
        "file": "a.onnx",
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }
    assert open_network(str(path)) is first
    onnx_models.middle(path)
    assert not open_network(str(path)).knows_time


def refusal(path, kind=ConfigError):
    with pytest.raises(kind) as caught:
        open_network(str(path))
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"sampling.model: {path}: ")
    return text


def test_files_that_are_none(tmp_path):
    assert "No such file" in refusal(tmp_path / "none.onnx")
    refusal(tmp_path)
    empty, text = tmp_path / "empty.onnx", tmp_path / "text.onnx"
    empty.write_bytes(b"")
    text.write_text("a network\n" * 100)
    assert "is no network that can be run" in refusal(empty)
    assert "is no network that can be run" in refusal(text)
    whole = tmp_path / "whole.onnx"
    onnx_models.blend(whole)
    torn = tmp_path / "torn.onnx"
    torn.write_bytes(whole.read_bytes()[:-60])
    assert "is no network that can be run" in refusal(torn)


NODES = onnx_models.blend_nodes()


@pytest.mark.parametrize(
    ("inputs", "nodes", "outputs", "why"),
    [
        ([image("img0", 3), image("img1", 1), number("timestep")], NODES, 3, "differ in shape"),
        ([image("img0", 4), image("img1", 4), number("timestep")], NODES, 4, "not two images"),
        (
            [image("img0"), image("img1"), number("timestep"), number("scale")],
            [*NODES, helper.make_node("Neg", ["scale"], ["unused"])],
            1,
            "not two images and a time",
        ),
        ([image("img0"), image("img1"), number("timestep", (4,))], NODES, 1, "more than one"),
        (
            [image("img0")],
            onnx_models.blend_nodes(second="img0", time="img0"),
            1,
            "a single input must have 7 channels",
        ),
        (
            [image("img0", 11)],
            onnx_models.blend_nodes(second="img0", time="img0"),
            11,
            "of the folder rife_v2",
        ),
    ],
)
def test_inputs_that_do_not_fit_are_named(tmp_path, inputs, nodes, outputs, why):
    path = tmp_path / "a.onnx"
    onnx_models.save(path, nodes, inputs, [image("output", outputs)])
    text = refusal(path)
    assert why in text
    assert "takes img0 [1, " in text


def test_an_output_that_cannot_be_told_is_refused(tmp_path):
    path = tmp_path / "a.onnx"
    nodes = [*onnx_models.blend_nodes(output="one"), helper.make_node("Neg", ["one"], ["two"])]
    inputs = [image("img0"), image("img1"), number("timestep")]
    onnx_models.save(path, nodes, inputs, [image("one"), image("two")])
    assert "must be named output or image: ['one', 'two']" in refusal(path)


@pytest.mark.parametrize(
    ("stated", "why"),
    [
        ({"encoding": "hlg"}, "encoding: must be linear, srgb, bt709 or gamma:<g>, got 'hlg'"),
        ({"encoding": "auto"}, "encoding: must be linear, srgb, bt709 or gamma:<g>, got 'auto'"),
        ({"encoding": "gamma:0"}, "encoding: must be"),
        ({"multiple": "0"}, "multiple: must be a whole number from 1 to 1024, got '0'"),
        ({"multiple": "4096"}, "multiple: must be"),
        ({"multiple": "3.5"}, "multiple: must be"),
    ],
)
def test_metadata_that_means_nothing_is_refused(tmp_path, stated, why):
    path = tmp_path / "a.onnx"
    onnx_models.blend(path, **stated)
    text = refusal(path)
    assert "its metadata: " in text
    assert why in text


def test_a_network_that_fails_names_the_size_and_the_way_out(tmp_path):
    shape = helper.make_tensor("shape", TensorProto.INT64, [4], [1, 1, 128, 128])
    nodes = [
        *onnx_models.blend_nodes(output="made"),
        helper.make_node("Reshape", ["made", "shape"], ["output"]),
    ]
    inputs = [image("img0"), image("img1"), number("timestep")]
    outputs = [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, 1, "h", "w"])]
    path = onnx_models.save(tmp_path / "a.onnx", nodes, inputs, outputs, [shape])
    network = open_network(path)
    with pytest.raises(DataError, match=r"fails on images of 64x32: .*'multiple' in its metadata"):
        network.ask(*values(), 0.5)
    wide = values((64, 256))
    with pytest.raises(DataError, match=r"gives \(1, 1, 128, 128\) for images of \(64, 256\)"):
        network.ask(*wide, 0.5)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "a.onnx"
    onnx_models.blend_stacked(path)
    return path.read_bytes()


@settings(
    max_examples=200,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_a_damaged_file_is_refused_in_one_line_or_taken(whole, data, capfd):
    damaged = data.draw(damages(whole))
    try:
        Network("a.onnx", damaged).ask(*values((64, 64)), 0.5)
    except (ConfigError, DataError) as error:
        assert str(error).startswith("sampling.model: a.onnx: ")
        assert "\n" not in str(error)
    assert capfd.readouterr() == ("", "")


def test_without_the_extra_it_is_named(tmp_path, monkeypatch):
    path = onnx_models.blend(tmp_path / "a.onnx")
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'adv2e\[onnx\]'"):
        make_upsampler(Sampling(interpolation="onnx", model=path))


def test_one_frame_an_interval_asks_no_network():
    nowhere = Sampling(interpolation="onnx", model="nowhere.onnx", L=1)
    assert network_of(nowhere) is None
    a, b = values()
    assert next(make_upsampler(nowhere).between(a, b)) is b
