"""A training that is stopped and taken up again comes to the numbers of one that is not."""

from __future__ import annotations

import json

import numpy as np
import pytest
from experiments.training import BEST, CHECKPOINT, CURVE, Training, identity, one_anew

from adv2e.errors import DataError

torch = pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")
pytest.importorskip("matplotlib", reason="curves are drawn by Matplotlib (extra experiments)")
SETTINGS = {"seed": 3, "rate": 0.01, "of": ["a", 1]}


pytestmark = pytest.mark.usefixtures("one_torch_thread")


def build():
    """Return a net in which all that has a state takes part."""
    nn = torch.nn
    layers = nn.Linear(4, 8), nn.BatchNorm1d(8), nn.ReLU(), nn.Dropout(0.1), nn.Linear(8, 1)
    return nn.Sequential(*layers)


def update(net, optimiser, rng):
    """Fit the sum of four numbers by chance."""
    x = torch.from_numpy(rng.random((16, 4), np.float32))
    optimiser.zero_grad()
    loss = ((net(x) - x.sum(1, keepdim=True)) ** 2).mean()
    loss.backward()
    optimiser.step()
    return float(loss.detach())


def check(net):
    x = torch.linspace(0, 1, 40).reshape(10, 4)
    with torch.no_grad():
        return {"score": -float(((net(x) - x.sum(1, keepdim=True)) ** 2).mean())}


def training(every=2, **others):
    settings = {**SETTINGS, **others}
    return Training(build, update, settings, every, check, best_by="score")


def weights(net):
    return torch.cat([one.flatten().float() for one in net.state_dict().values()])


def test_a_stopped_training_comes_to_the_same(tmp_path):
    whole, curve = training().run(tmp_path / "whole", 9)
    training().run(tmp_path / "parts", 2)
    torch.manual_seed(99)  # chance goes elsewhere meanwhile
    training().run(tmp_path / "parts", 5)
    torch.rand(7)
    net, again = training().run(tmp_path / "parts", 9)
    assert again.losses == curve.losses
    assert torch.equal(weights(net), weights(whole))
    assert len(set(curve.losses)) == 9
    assert [one["step"] for one in curve.checks] == [2, 4, 6, 8, 9]


def test_a_training_that_broke_off_goes_on_from_its_last_checkpoint(tmp_path):
    def broken(net, optimiser, rng):
        if (tmp_path / "parts" / CHECKPOINT).exists():
            raise KeyboardInterrupt
        return update(net, optimiser, rng)

    whole, _ = training(every=3).run(tmp_path / "whole", 7)
    with pytest.raises(KeyboardInterrupt):
        Training(build, broken, SETTINGS, 3, check, "score").run(tmp_path / "parts", 7)
    net, curve = training(every=3).run(tmp_path / "parts", 7)
    assert len(curve.losses) == 7
    assert torch.equal(weights(net), weights(whole))


def test_it_learns_and_keeps_the_best(tmp_path):
    net, curve = training(every=50).run(tmp_path, 300)
    assert np.mean(curve.losses[-50:]) < 0.3 * np.mean(curve.losses[:10])
    kept = build()
    kept.load_state_dict(torch.load(tmp_path / BEST))
    assert check(kept.eval())["score"] == curve.best("score")["score"]
    assert check(net)["score"] == curve.checks[-1]["score"]
    written = json.loads((tmp_path / CURVE).read_text())
    assert written["losses"] == curve.losses
    assert written["settings"] == SETTINGS
    assert (tmp_path / "curve.png").stat().st_size > 1000
    assert not list(tmp_path.glob("unfinished*"))


def test_done_is_done(tmp_path):
    training().run(tmp_path, 4)
    _, curve = training().run(tmp_path, 4)
    assert len(curve.losses) == 4


def test_other_settings_need_another_folder(tmp_path):
    training().run(tmp_path, 2)
    with pytest.raises(DataError, match=r"checkpoint\.pt: rate: was 0\.01, now 0\.02"):
        training(rate=0.02).run(tmp_path, 4)


def test_a_longer_training_is_not_taken_for_a_shorter_one(tmp_path):
    training().run(tmp_path, 4)
    with pytest.raises(DataError, match="holds 4 steps, more than 2;"):
        training().run(tmp_path, 2)


def test_another_file_is_no_checkpoint(tmp_path):
    (tmp_path / CHECKPOINT).write_bytes(b"nothing")
    with pytest.raises(DataError, match="no checkpoint of a training"):
        training().run(tmp_path, 2)


def test_a_loss_that_is_not_finite_ends_it(tmp_path):
    wild = Training(build, lambda *_: float("nan"), SETTINGS)
    with pytest.raises(DataError, match="the loss of step 1 is nan"):
        wild.run(tmp_path, 2)
    assert not (tmp_path / CHECKPOINT).exists()


def test_a_simulator_is_known_by_all_it_is():
    plain, again, other = (
        identity(one_anew("ideal", sets, None)) for sets in ((), (), ("pixel.thresholds.on=0.3",))
    )
    assert plain == again
    assert plain["simulator"] == other["simulator"] == "ideal"
    assert plain["digest"] != other["digest"]
