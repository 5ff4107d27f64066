"""Small networks that make the frame between two, written node by node."""

from __future__ import annotations

from pathlib import Path

import onnx
from onnx import TensorProto, helper

FLOAT = TensorProto.FLOAT


def image(name, channels=1, size=("rows", "columns"), kind=FLOAT, last=False):
    shape = [1, *size, channels] if last else [1, channels, *size]
    return helper.make_tensor_value_info(name, kind, shape)


def number(name, shape=(1,), kind=FLOAT):
    return helper.make_tensor_value_info(name, kind, list(shape))


def save(path: Path, nodes, inputs, outputs, constants=(), **stated) -> str:
    """Write a network; `stated` is its metadata."""
    graph = helper.make_graph(list(nodes), "between", inputs, outputs, list(constants))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    helper.set_model_props(model, {key: str(value) for key, value in stated.items()})
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return str(path)


def blend_nodes(first="img0", second="img1", time="timestep", output="output"):
    """Return a + (b - a) t."""
    return [
        helper.make_node("Sub", [second, first], ["difference"]),
        helper.make_node("Mul", ["difference", time], ["part"]),
        helper.make_node("Add", [first, "part"], [output]),
    ]


def blend(path, channels=1, size=("rows", "columns"), kind=FLOAT, time=(1,), **stated) -> str:
    """Write a network that blends."""
    return save(
        path,
        blend_nodes(),
        [
            image("img0", channels, size, kind),
            image("img1", channels, size, kind),
            number("timestep", time, kind),
        ],
        [image("output", channels, size, kind)],
        **stated,
    )


def blend_film(path) -> str:
    """Write a network as tf2onnx exports FILM: channels last, more outputs than the image."""
    nodes = [
        *blend_nodes("x0:0", "x1:0", "time:0", "image:0"),
        helper.make_node("Neg", ["x0:0"], ["flow_1:0"]),
    ]
    inputs = [
        number("time:0", ("n", 1)),
        helper.make_tensor_value_info("x1:0", FLOAT, ["n", "h", "w", 3]),
        helper.make_tensor_value_info("x0:0", FLOAT, ["n", "h", "w", 3]),
    ]
    outputs = [image(name, 3, ("h", "w"), last=True) for name in ("flow_1:0", "image:0")]
    return save(path, nodes, inputs, outputs)


def blend_stacked(path, channels=7) -> str:
    """Write a network as vs-mlrt publishes RIFE: one input of both images and a plane of time."""
    sizes = [3, 3, 1] if channels == 7 else [channels - 3, 3]
    parts = ["a", "b", "t"][: len(sizes)]
    split = helper.make_tensor("sizes", TensorProto.INT64, [len(sizes)], sizes)
    half = helper.make_tensor("half", FLOAT, [1], [0.5])
    nodes = [
        helper.make_node("Split", ["input", "sizes"], parts, axis=1),
        *blend_nodes("a", "b", "t" if channels == 7 else "half"),
    ]
    return save(path, nodes, [image("input", channels)], [image("output", 3)], [split, half])


def middle(path) -> str:
    """Write a network that takes no time."""
    half = helper.make_tensor("half", FLOAT, [1], [0.5])
    nodes = blend_nodes(time="half")
    return save(path, nodes, [image("img0"), image("img1")], [image("output")], [half])
