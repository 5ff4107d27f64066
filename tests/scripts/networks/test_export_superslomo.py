"""The script that writes Super SloMo as a file of ONNX, with random weights."""

from __future__ import annotations

import datetime
import hashlib

import export_superslomo
import numpy as np
import pytest
import superslomo_twin as twin
from click.testing import CliRunner

torch = pytest.importorskip("torch", reason="PyTorch (extra torch) is too large to install for all")
onnxruntime = pytest.importorskip("onnxruntime", reason="is of the extra torch")
pytest.importorskip("onnxscript", reason="is of the extra torch")


def run(*words):
    return CliRunner().invoke(export_superslomo.main, [*map(str, words)])


def states(channels):
    random = np.random.default_rng(channels)
    flow = twin.weights(2 * channels, 4, random, last=40.0)
    return flow, twin.weights(4 * channels + 8, 5, random, last=2.0)


def stored(path, flow, refinement, **others):
    """Write what training stores; all but the weights does not matter."""
    content = {
        "Detail": "End to end Super SloMo.", "epoch": 3, "loss": [[0.5, 0.25]],
        "timestamp": datetime.datetime(2019, 5, 27, 12, 0, 1),
    }  # fmt: skip
    for key, state in (("state_dictFC", flow), ("state_dictAT", refinement)):
        content[key] = {name: torch.from_numpy(values) for name, values in state.items()}
    torch.save(content | others, path, _use_new_zipfile_serialization=False)  # as long ago
    return path


def frames(channels, rows, columns):
    random = np.random.default_rng(rows)
    return random.random((2, channels, rows, columns), np.float32)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    return stored(tmp_path_factory.mktemp("grey") / "grey.ckpt", *states(1))


@pytest.fixture(scope="module")
def exported(checkpoint):
    path = checkpoint.with_name("grey.onnx")
    done = run(checkpoint, "-o", path)
    assert done.exit_code == 0, done.output
    assert done.output.startswith(f"{path}: grey, rows and columns are multiples of 32; ONNX and")
    assert sorted(checkpoint.parent.iterdir()) == [checkpoint, path]
    return path


@pytest.fixture(scope="module")
def session(exported):
    return onnxruntime.InferenceSession(exported, providers=["CPUExecutionProvider"])


@pytest.mark.parametrize(("rows", "columns", "instant"), [(32, 64, 0.2), (96, 32, 0.75)])
def test_file_and_pytorch_and_equations_agree(session, checkpoint, rows, columns, instant):
    from networks import superslomo

    img0, img1 = frames(1, rows, columns)
    given = {"img0": img0[None], "img1": img1[None], "timestep": np.array([instant], np.float32)}
    (found,) = session.run(None, given)
    with torch.no_grad():
        by_torch = superslomo.load(checkpoint, None).module(*map(torch.from_numpy, given.values()))
    wanted, flow = twin.interpolated(img0, img1, instant, *states(1), 0.428)
    assert found.shape == (1, 1, rows, columns)
    np.testing.assert_allclose(found, by_torch.numpy(), atol=1e-4)
    np.testing.assert_allclose(found[0], wanted, atol=3e-4)
    assert np.median(np.abs(flow)) > 1
    assert np.abs(wanted - (1 - instant) * img0 - instant * img1).mean() > 0.05


def test_colour_is_seen_from_the_shapes(tmp_path):
    from networks import superslomo

    instant = 0.4
    network = superslomo.load(stored(tmp_path / "colour.ckpt", *states(3)), None)
    img0, img1 = frames(3, 32, 32)
    given = (img0[None], img1[None], np.array([instant], np.float32))
    with torch.no_grad():
        found = network.module(*map(torch.from_numpy, given)).numpy()
    wanted, flow = twin.interpolated(img0, img1, instant, *states(3), (0.429, 0.431, 0.397))
    assert network.channels == 3
    np.testing.assert_allclose(found[0], wanted, atol=3e-4)
    assert np.median(np.abs(flow)) > 1


def test_another_mean(checkpoint):
    from networks import superslomo

    img0, img1 = frames(1, 32, 32)
    given = (img0[None], img1[None], np.array([0.5], np.float32))
    with torch.no_grad():
        found = superslomo.load(checkpoint, 0.0).module(*map(torch.from_numpy, given)).numpy()
    wanted = [twin.interpolated(img0, img1, 0.5, *states(1), mean)[0] for mean in (0.0, 0.428)]
    np.testing.assert_allclose(found[0], wanted[0], atol=3e-4)
    assert np.abs(wanted[1] - wanted[0]).max() > 0.01


def test_the_file_says_what_it_takes(session, checkpoint):
    takes = {one.name: (one.type, one.shape) for one in session.get_inputs()}
    assert takes["timestep"] == ("tensor(float)", [1])
    assert takes["img0"] == takes["img1"]
    assert takes["img0"][0] == "tensor(float)"
    assert takes["img0"][1][:2] == [1, 1]
    assert all(isinstance(length, str) for length in takes["img0"][1][2:])
    assert [one.name for one in session.get_outputs()] == ["output"]
    assert session.get_modelmeta().custom_metadata_map == {
        "encoding": "srgb",
        "multiple": "32",
        "mean": "0.428",
        "source": "grey.ckpt",
        "sha256": hashlib.sha256(checkpoint.read_bytes()).hexdigest(),
    }


def test_the_file_tells_nothing_of_the_machine(exported):
    assert b"superslomo.py" not in exported.read_bytes()


def test_an_existing_file_stays(exported, checkpoint):
    before = exported.stat()
    done = run(checkpoint, "-o", exported)
    assert done.exit_code == 1
    assert "exists already; --overwrite replaces it" in done.output
    assert exported.stat() == before


def without(state, name):
    return {other: values for other, values in state.items() if other != name}


def changed(state, name, values):
    return state | {name: np.asarray(values, np.float32)}


WRONG = {
    "lacks weights": (
        lambda flow, refinement: (flow, without(refinement, "up3.conv2.bias"), {}),
        "state_dictAT: has no up3.conv2.bias",
    ),
    "is of another shape": (
        lambda flow, refinement: (changed(flow, "conv2.bias", np.zeros(31)), refinement, {}),
        "state_dictFC: conv2.bias is of shape (31,), not (32,)",
    ),
    "mixes grey and colour": (
        lambda flow, _: (flow, twin.weights(20, 5, np.random.default_rng(0), 1.0), {}),
        "state_dictAT: conv1.weight is of shape (32, 20, 7, 7), not (32, 12, 7, 7)",
    ),
    "has other channels": (
        lambda flow, refinement: (
            changed(flow, "conv1.weight", np.zeros((32, 8, 7, 7))), refinement, {},
        ),
        "state_dictFC: conv1.weight takes 8 channels, not 2 (grey) or 6 (colour)",
    ),
    "holds more": (
        lambda flow, refinement: (changed(flow, "up6.conv1.bias", [0]), refinement, {}),
        "state_dictFC: up6.conv1.bias does not belong to Super SloMo",
    ),
    "is not finite": (
        lambda flow, refinement: (changed(flow, "conv3.bias", [0, np.nan, 0, 0]), refinement, {}),
        "state_dictFC: conv3.bias has numbers that are not finite",
    ),
    "holds half": (
        lambda flow, refinement: (flow, refinement, {"state_dictAT": None}),
        "has no state_dictAT: is it a checkpoint of Super SloMo?",
    ),
    "holds code": (
        lambda flow, refinement: (flow, refinement, {"loss": print}),
        "is no checkpoint of PyTorch (",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("make", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_checkpoint_is_one_line(tmp_path, make, message):
    flow, refinement, others = make(*states(1))
    path = stored(tmp_path / "a.ckpt", flow, refinement, **others)
    refused(path, f"{path}: {message}")


@pytest.mark.parametrize(
    "raw", [b"", b"no checkpoint\n", b"PK\x03\x04" + bytes(40), b"\x80\x02}q\x00.", bytes(100)]
)
def test_another_file_is_one_line(tmp_path, raw):
    path = tmp_path / "a.ckpt"
    path.write_bytes(raw)
    refused(path, f"{path}: ")


@pytest.mark.parametrize("is_zip", [True, False])
def test_half_a_checkpoint_is_one_line(tmp_path, is_zip):
    path = tmp_path / "a.ckpt"
    torch.save(
        {"state_dictFC": {"a": torch.zeros(9999)}}, path, _use_new_zipfile_serialization=is_zip
    )
    path.write_bytes(path.read_bytes()[:20000])
    refused(path, f"{path}: is no checkpoint of PyTorch (")


def test_no_file_is_one_line(tmp_path):
    refused(tmp_path / "a.ckpt", f"{tmp_path / 'a.ckpt'}: No such file or directory")


def refused(path, message):
    before = sorted(path.parent.iterdir())
    done = run(path, "-o", path.with_name("made") / "a.onnx")
    assert done.exit_code == 1
    assert done.output.startswith(f"Error: {message}")
    assert done.output.count("\n") == 1
    assert sorted(path.parent.iterdir()) == before
