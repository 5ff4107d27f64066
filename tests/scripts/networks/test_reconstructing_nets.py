"""Nets that reconstruct images: shapes, published numbers of parameters, and what they are."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from experiments import images
from networks.e2vid import PARAMETERS, e2vid
from networks.firenet import PARAMETERS as OF_FIRENET
from networks.firenet import firenet, grid_of, reconstructed
from networks.image_loss import BACKBONE, LAYERS, LINEAR, Lpips, similarity, structural_loss

from adv2e.errors import DataError, MissingExtraError
from adv2e.events import make_events

torch = pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")


pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.mark.parametrize(("build", "count"), [(firenet, OF_FIRENET), (e2vid, PARAMETERS)])
def test_parameters_are_as_many_as_published(build, count):
    assert sum(one.numel() for one in build().parameters()) == count


@pytest.mark.parametrize("build", [firenet, e2vid])
@pytest.mark.parametrize("size", [(16, 24), (13, 18)])
def test_an_image_has_the_size_of_the_grid_and_hangs_on_what_was_before(build, size):
    net = build().eval()
    grids = torch.randn(2, 3, 5, *size)
    with torch.no_grad():
        first, state = net(grids[0])
        second, _ = net(grids[1], state)
        alone, _ = net(grids[1])
    assert first.shape == second.shape == (3, 1, *size)
    assert not torch.allclose(second, alone)


@pytest.mark.parametrize("build", [firenet, e2vid])
def test_all_parameters_learn(build):
    net, state = build(), None
    for grid in torch.randn(2, 2, 5, 16, 16):
        image, state = net(grid, state)
    structural_loss(image, torch.rand(2, 1, 16, 16)).backward()
    idle = [name for name, one in net.named_parameters() if not one.grad.abs().sum() > 0]
    assert not idle


def test_an_lstm_of_e2vid_is_that_of_its_equations():
    encoder = e2vid().eval().encoders[0]
    x, (hidden, cell) = torch.randn(1, 32, 8, 8), torch.randn(2, 1, 64, 4, 4)
    with torch.no_grad():
        seen = torch.relu(encoder.conv(x))
        gates = encoder.gates(torch.cat([seen, hidden], 1)).reshape(4, 64, 4, 4)
        shown, kept = encoder(x, (hidden, cell))
    enter, remember, leave = (1 / (1 + np.exp(-one.numpy())) for one in gates[:3])
    wanted = remember * cell[0].numpy() + enter * np.tanh(gates[3].numpy())
    np.testing.assert_allclose(kept[0].numpy(), wanted, atol=1e-5)
    np.testing.assert_allclose(shown[0].numpy(), leave * np.tanh(wanted), atol=1e-5)


def test_images_of_a_run_of_windows_are_clipped():
    events = make_events(t=[0, 5, 9, 20], x=[0, 3, 3, 2], y=[1, 1, 2, 0], p=[1, 0, 1, 1])
    grids = [grid_of(part, (8, 6)) for part in (events[:2], events[2:], events[:0])]
    net = firenet()
    with torch.no_grad():
        net.pred.bias += 3
    made = reconstructed(net, grids)
    assert made.shape == (3, 6, 8)
    assert made.max() == 1


def test_similarity_is_that_of_the_measure():
    a, b = np.random.default_rng(0).random((2, 20, 30))
    b = 0.7 * a + 0.3 * b
    found = similarity(*(torch.from_numpy(one)[None, None] for one in (a, b)))
    assert float(found) == pytest.approx(images.similarity(a, b), abs=1e-9)
    assert (
        float(structural_loss(torch.full((1, 1, 9, 9), 0.5), torch.full((1, 1, 9, 9), 0.5))) < 1e-6
    )


@pytest.fixture
def features(tmp_path):
    """Write weights by chance under the names that are published."""
    backbone = {}
    for at, (before, after, size, *_) in LAYERS.items():
        backbone[f"features.{at}.weight"] = 0.1 * torch.randn(after, before, size, size)
        backbone[f"features.{at}.bias"] = 0.1 * torch.randn(after)
    linear = {
        f"lin{k}.model.1.weight": torch.rand(1, after, 1, 1)
        for k, (_, after, *_) in enumerate(LAYERS.values())
    }
    torch.save(backbone, tmp_path / BACKBONE)
    torch.save(linear, tmp_path / LINEAR)
    return tmp_path


def test_lpips_is_a_distance_that_can_be_learnt_from(features):
    lpips = Lpips(features)
    a, b = torch.rand(2, 2, 1, 64, 70)
    b.requires_grad_()
    assert lpips(a, a).tolist() == [0, 0]
    apart = lpips(a, b)
    assert apart.shape == (2,)
    assert (apart > 0).all()
    assert torch.allclose(apart, lpips(b, a))
    assert torch.allclose(lpips(a[1:], b[1:])[0], apart[1])
    apart.sum().backward()
    assert b.grad.abs().sum() > 0


def test_lpips_of_the_first_layer_is_that_of_its_definition(features):
    linear = torch.load(features / LINEAR)
    for k in range(1, 5):
        linear[f"lin{k}.model.1.weight"] *= 0
    torch.save(linear, features / LINEAR)
    images = np.random.default_rng(1).random((2, 64, 64)).astype(np.float32)
    found = Lpips(features)(*(torch.from_numpy(one)[None, None] for one in images))
    backbone = torch.load(features / BACKBONE)
    weight, bias = (backbone[f"features.0.{one}"].numpy() for one in ("weight", "bias"))
    shift, scale = np.array([-0.03, -0.088, -0.188]), np.array([0.458, 0.448, 0.45])
    unit = []
    for image in images:
        colour = (2 * image - 1 - shift[:, None, None]) / scale[:, None, None]
        padded = np.pad(colour, ((0, 0), (2, 2), (2, 2)))
        parts = np.lib.stride_tricks.sliding_window_view(padded, (11, 11), (1, 2))[:, ::4, ::4]
        at = np.maximum(np.einsum("cyxij,ocij->oyx", parts, weight) + bias[:, None, None], 0)
        unit.append(at / (np.sqrt((at**2).sum(0)) + 1e-10))
    weights = linear["lin0.model.1.weight"].numpy()[0]
    wanted = ((unit[0] - unit[1]) ** 2 * weights).sum(0).mean()
    assert float(found[0]) == pytest.approx(wanted, rel=1e-4)


def test_other_weights_are_one_line(features):
    torch.save({"features.0.weight": torch.zeros(3)}, features / BACKBONE)
    with pytest.raises(DataError, match="weight: needed in the shape"):
        Lpips(features)
    (features / BACKBONE).write_bytes(b"no weights")
    with pytest.raises(DataError, match="no weights of PyTorch"):
        Lpips(features)


@pytest.mark.parametrize("build", [firenet, e2vid])
def test_without_pytorch_the_extra_is_named(monkeypatch, build):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtraError, match="experiments"):
        build()
