"""Nets that segment: shapes, published numbers of parameters, and how they pad."""

from __future__ import annotations

import sys

import pytest
from networks.evsegnet import ENCODER_PARAMETERS, evsegnet, xception
from networks.unet import unet

from adv2e.errors import MissingExtraError

torch = pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")


pytestmark = pytest.mark.usefixtures("one_torch_thread")


def count(net):
    return sum(one.numel() for one in net.parameters())


def test_the_encoder_has_as_many_parameters_as_that_of_keras():
    assert count(xception(3)) == ENCODER_PARAMETERS


def test_the_encoder_has_the_sizes_of_that_of_keras():
    with torch.no_grad():
        found = xception().eval()(torch.zeros(1, 6, 224, 352))
    sizes = [tuple(one.shape[1:]) for one in found]
    assert sizes == [
        (128, 109, 173), (256, 55, 87), (728, 28, 44), (1024, 14, 22), (2048, 7, 11),
    ]  # fmt: skip


def test_the_small_net_has_as_many_parameters_as_it_says():
    assert count(unet(2)) == 489_154


@pytest.mark.parametrize(("build", "size"), [(evsegnet, (64, 96)), (unet, (16, 24))])
def test_every_pixel_has_a_score_for_each_class_and_all_parameters_learn(build, size):
    net = build(3)
    scores = net(torch.randn(2, 6, *size))
    assert scores.shape == (2, 3, *size)
    labels = torch.randint(3, (2, *size))
    torch.nn.functional.cross_entropy(scores, labels).backward()
    idle = [name for name, one in net.named_parameters() if not one.grad.abs().sum() > 0]
    assert not idle


@pytest.mark.parametrize("build", [evsegnet, unet, xception])
def test_without_pytorch_the_extra_is_named(monkeypatch, build):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtraError, match="experiments"):
        build(2)
