"""FireNet with weights as they are published, under either names; and how alike images are."""

from __future__ import annotations

import numpy as np
import pytest
from experiments.images import similarity
from networks.firenet import NETWORKS, Network, firenet

from adv2e.errors import DataError
from adv2e.events import make_events

SIZE = WIDTH, HEIGHT = 24, 16
WEIGHTS_NEEDED = "needs PyTorch"
RNG = np.random.default_rng(0)
EVENTS = make_events(
    t=np.sort(RNG.integers(0, 10**5, 400)), x=RNG.integers(0, WIDTH, 400),
    y=RNG.integers(0, HEIGHT, 400), p=RNG.integers(0, 2, 400),
)  # fmt: skip


def test_similarity_is_that_of_its_definition():
    assert similarity(np.full((20, 30), 0.5), np.full((20, 30), 0.5)) == 1.0
    apart = similarity(np.full((20, 30), 0.5), np.full((20, 30), 0.6))
    assert apart == pytest.approx((2 * 0.5 * 0.6 + 1e-4) / (0.5**2 + 0.6**2 + 1e-4))
    noise = np.random.default_rng(0).random((2, 40, 50))
    assert similarity(*noise) == pytest.approx(similarity(*noise[::-1]))
    assert similarity(*noise) < 0.2
    assert similarity(noise[0], 1 - noise[0]) < 0


def checkpoint(folder, name, state):
    torch = pytest.importorskip("torch", reason=WEIGHTS_NEEDED)
    torch.save({"state_dict": state}, folder / NETWORKS[name])


def of_chance():
    torch = pytest.importorskip("torch", reason=WEIGHTS_NEEDED)
    torch.manual_seed(0)
    state = firenet().state_dict()
    state["pred.bias"] += 0.5  # so that images are grey, not clipped
    return state


PARTS = {
    "head.": "net.head.conv.conv2d.", "G1.": "net.head.recurrent_block.",
    "R1.": "net.resblocks.0.conv.", "G2.": "net.resblocks.0.recurrent_block.",
    "R2.": "net.resblocks.1.", "pred.": "net.pred.conv2d.",
}  # fmt: skip


def test_both_ways_to_name_the_layers_give_the_same_net(tmp_path):
    state = of_chance()
    begins = {key: key[: key.index(".") + 1] for key in state}
    checkpoint(tmp_path, "FireNet", {PARTS[b] + k[len(b) :]: state[k] for k, b in begins.items()})
    checkpoint(tmp_path, "FireNet+", state)
    first, second = (Network(name, tmp_path) for name in NETWORKS)
    first.grid = second.grid
    made = first.images([EVENTS[:50], EVENTS[50:]], SIZE)
    assert np.array_equal(made, second.images([EVENTS[:50], EVENTS[50:]], SIZE))
    assert not np.array_equal(made[0], made[1])
    assert made.shape == (2, HEIGHT, WIDTH)


def test_weights_of_another_net_are_an_error(tmp_path):
    state = of_chance()
    checkpoint(tmp_path, "FireNet+", {key: state[key] for key in list(state)[1:]})
    with pytest.raises(DataError, match="not the weights of FireNet"):
        Network("FireNet+", tmp_path)


@pytest.mark.parametrize("raw", [b"something else", b"", b"\x80\x02]q\x00."])
def test_a_file_without_weights_is_an_error(raw, tmp_path):
    checkpoint(tmp_path, "FireNet", of_chance())
    (path,) = tmp_path.iterdir()
    path.write_bytes(raw)
    with pytest.raises(DataError, match=r"no checkpoint of PyTorch \("):
        Network("FireNet", tmp_path)


def test_firenet_sees_no_gain_of_the_events(tmp_path):
    state = of_chance()
    for name in NETWORKS:
        checkpoint(tmp_path, name, state)
    double = np.sort(np.concatenate([EVENTS, EVENTS]), order="t")
    first, second = (Network(name, tmp_path) for name in NETWORKS)
    assert np.allclose(first.grid(EVENTS, SIZE), first.grid(double, SIZE), atol=1e-6)
    assert np.allclose(2 * second.grid(EVENTS, SIZE), second.grid(double, SIZE))
