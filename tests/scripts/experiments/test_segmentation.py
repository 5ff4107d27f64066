"""Segmentation of events: what networks are given, that they learn, measures, and the commands."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from adv2e.errors import DataError
from adv2e.events import cut, make_events
from adv2e.representations.voxel_grid import event_image

torch = pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")
pytest.importorskip("skimage", reason="scipy and scikit-image are of the extra experiments")
pytest.importorskip("matplotlib", reason="curves are drawn by Matplotlib (extra experiments)")

from experiments import labels as labelled  # noqa: E402
from experiments import segmentation  # noqa: E402
from experiments.scenes import shape_clip  # noqa: E402
from experiments.simulators import named  # noqa: E402
from networks.unet import unet  # noqa: E402

SIZE = 32, 24


pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture(scope="module")
def simulator():
    (one,) = named(["ideal"], threads=1)
    return one


def test_a_shape_is_what_is_dark_at_any_rate():
    clip, labels = shape_clip(2, 5, SIZE, 120)
    fast, finer = shape_clip(2, 9, SIZE, 240)
    np.testing.assert_allclose(clip.frames, fast.frames[::2], atol=1e-3)
    assert np.array_equal(labels, finer[::2])
    assert 0.02 < labels.mean() < 0.98
    assert np.mean((clip.frames < 90) == (labels == 1)) > 0.95
    assert np.abs(np.diff(fast.frames, axis=0)).max() > 1


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    output = tmp_path_factory.mktemp("shapes") / "ideal"
    call("shapes", output, "--clips", 2, "--side", 32, "--simulators", "ideal")
    return output


def test_rendered_pictures_belong_to_their_labels(shapes, simulator):
    train, test = (labelled.Folder.of(shapes, split, None) for split in ("train", "test"))
    assert (len(train), len(test)) == (16, 8)
    clip, labels = shape_clip(0, 97, (32, 32))
    events = simulator.events(clip, 0)
    for number in range(8):
        picture, label = train[number]
        assert np.array_equal(label, labels[12 * (number + 1)])
        window = cut(events, 50_000 * number, 50_000 * (number + 1))
        assert np.array_equal(picture[0] > -1, np.bincount(
            (window["y"].astype(int) * 32 + window["x"])[window["p"] == 1], minlength=32 * 32
        ).reshape(32, 32) > 0)  # fmt: skip


@pytest.mark.parametrize("changed", [False, True])
def test_a_picture_and_its_labels_are_changed_alike(changed):
    rng = np.random.default_rng(0)
    label = rng.integers(1, 5, (24, 32)).astype(np.uint8)
    picture = np.repeat(label[None].astype(np.float32), 6, 0)
    kinds = set()
    for _ in range(20):
        made, said = labelled.augmented((picture, label), rng, changed)
        known = said != labelled.IGNORED
        assert np.array_equal(made[3][known], said[known])
        assert not made[:, ~known].any()
        kinds.add(said.tobytes())
        assert known.all() or changed
    assert len(kinds) == (20 if changed else 2)


def test_scores_are_those_of_a_loop_over_pixels():
    rng = np.random.default_rng(1)
    labels = rng.integers(0, 4, (5, 8, 8)).astype(np.uint8)
    labels[labels == 3] = labelled.IGNORED
    pictures = rng.normal(size=(5, 4, 8, 8)).astype(np.float32)
    samples = list(zip(pictures, labels, strict=True))
    counts = labelled.confusion(lambda x: x, samples, 4, "cpu")
    wanted = np.zeros((4, 4), int)
    for picture, label in samples:
        for y in range(8):
            for x in range(8):
                if label[y, x] != labelled.IGNORED:
                    wanted[label[y, x], np.argmax(picture[:, y, x])] += 1
    assert np.array_equal(counts, wanted)
    scores = labelled.scores_of(counts)
    shares = [
        wanted[k, k] / (wanted[k].sum() + wanted[:, k].sum() - wanted[k, k]) for k in range(4)
    ]
    assert scores["mIoU"] == pytest.approx(np.mean(shares))
    assert scores["accuracy"] == pytest.approx(np.trace(wanted) / wanted.sum())
    assert labelled.scores_of(np.diag([3, 0])) == {"accuracy": 1, "mIoU": 0.5}


def test_one_class_for_all_pixels_is_scored_as_a_network_that_says_it():
    labels = np.full((2, 4, 4), labelled.IGNORED, np.uint8)
    labels[0], labels[1, 0] = 1, (0, 0, 1, 2)
    samples = [(np.zeros((3, 4, 4), np.float32), label) for label in labels]
    says_one = np.zeros((1, 3, 4, 4), np.float32)
    says_one[0, 1] = 1
    counts = labelled.confusion(lambda _: torch.from_numpy(says_one), samples, 3, "cpu")
    found = labelled.of_one_class(samples, 3)
    assert found == labelled.scores_of(counts)
    assert found["accuracy"] == 17 / 20


def test_pixels_of_no_class_teach_nothing():
    scores = torch.randn(1, 3, 4, 4, requires_grad=True)
    labels = torch.full((1, 4, 4), labelled.IGNORED, dtype=torch.uint8)
    labels[0, 1, 2] = 1
    labelled.loss_of(scores, labels).backward()
    assert (scores.grad.abs().sum(1)[0] > 0).sum() == 1


def test_the_small_net_learns(shapes):
    samples = labelled.Folder.of(shapes, "train", None)
    net, rng = unet(2), np.random.default_rng(0)
    step = labelled.update_of(samples, 2, "cpu", False)
    optimiser = torch.optim.Adam(net.parameters(), lr=2e-3)
    losses = [step(net, optimiser, rng) for _ in range(60)]
    assert np.mean(losses[-10:]) < 0.6 * np.mean(losses[:5])


def test_last_and_best_are_both_told():
    checks = [{"step": k, "accuracy": a, "mIoU": m} for k, a, m in ((1, 0.5, 0.4), (2, 0.6, 0.3))]
    assert labelled.last_and_best(checks) == {"last": checks[1], "best": checks[0]}


def data_set(folder, order="events/{}", count=3):
    rng = np.random.default_rng(0)
    for split in ("train", "test"):
        events = folder / order.format(split)
        labels = folder / order.format(split).replace("events", "labels")
        for place in (events, labels):
            place.mkdir(parents=True)
        for k in range(count):
            label = rng.integers(0, 6, (20, 34)).astype(np.uint8)
            np.save(events / f"rec_{k}.npy", np.repeat(label[..., None], 6, 2).astype(np.float32))
            cv2.imwrite(str(labels / f"rec_{k}.png"), label)
    return folder


@pytest.mark.parametrize("order", ["events/{}", "{}/events"])
def test_a_data_set_is_read_in_both_orders_of_folders(tmp_path, order):
    found = labelled.Folder.of(data_set(tmp_path / "set", order), "train", (68, 40))
    picture, label = found[1]
    assert len(found) == 3
    assert picture.shape == (6, 40, 68)
    assert np.array_equal(picture[5], label)
    assert np.array_equal(label[::2, ::2], cv2.imread(str(found.pairs[1][1]), 0))


def test_a_data_set_that_is_not_whole_is_one_line(tmp_path):
    with pytest.raises(DataError, match="no events/train"):
        labelled.Folder.of(tmp_path, "train", SIZE)
    folder = data_set(tmp_path / "set")
    (folder / "labels" / "train" / "rec_2.png").unlink()
    with pytest.raises(DataError, match=r"rec_2\.png: not there"):
        labelled.Folder.of(folder, "train", SIZE)
    cv2.imwrite(str(folder / "labels" / "test" / "rec_0.png"), np.zeros((5, 5), np.uint8))
    with pytest.raises(DataError, match=r"rec_0\.png: \(5, 5\), but its events are \(20, 34\)"):
        labelled.Folder.of(folder, "test", SIZE)[0]


IMAGES, STEP_NS = 6, 40_000_000


@pytest.fixture(scope="module")
def ess(tmp_path_factory):
    """Write DDD17 as ESS has it: six images a folder, the fourth and the last one with labels."""
    folder = tmp_path_factory.mktemp("ess")
    times = 10**15 + STEP_NS * np.arange(IMAGES)
    rng = np.random.default_rng(0)
    for number in range(7):
        place = folder / f"dir{number}"
        for kind in ("index", "segmentation_masks", "imgs"):
            (place / kind).mkdir(parents=True)
        np.save(place / "index" / "index_50ms.npy", np.stack([times, 0 * times, 0 * times], 1))
        t = np.sort(rng.integers(times[0], times[-1], 3000))
        xyp = np.stack([rng.integers(0, most, 3000) for most in (346, 260, 2)], 1)
        t.astype(np.int64).tofile(place / "events.dat.t")
        xyp.astype(np.int16).tofile(place / "events.dat.xyp")
        x = np.arange(346)[None] - 4 * np.arange(IMAGES)[:, None, None]
        frames = np.broadcast_to(np.where(x % 40 < 20, 180, 60), (IMAGES, 260, 346))
        for k, frame in enumerate(frames, 1):
            cv2.imwrite(str(place / "imgs" / f"img_{k:08d}.png"), frame.astype(np.uint8))
        for k in (4, IMAGES):
            mask = np.full((200, 346), number % 6, np.uint8)
            cv2.imwrite(str(place / "segmentation_masks" / f"segmentation_{k:08d}.png"), mask)
    return folder


def test_measured_events_of_ess_become_pictures(tmp_path, ess):
    counts = labelled.from_ess(ess, tmp_path, None, 0)
    assert counts == {"train": 10, "valid": 2, "test": 2}
    found = labelled.Folder.of(tmp_path, "test", (346, 200))
    assert [path.stem for path, _ in found.pairs] == ["dir4_00000004", "dir4_00000006"]
    picture, label = found[0]
    assert np.unique(label).tolist() == [4]
    t = np.fromfile(ess / "dir4" / "events.dat.t", np.int64) // 1000
    x, y, p = np.fromfile(ess / "dir4" / "events.dat.xyp", np.int16).reshape(-1, 3).T
    end = (10**15 + 3 * STEP_NS) // 1000
    chosen = (t >= end - 50_000) & (t < end) & (y < 200)
    events = make_events(t=t[chosen], x=x[chosen], y=y[chosen], p=p[chosen])
    wanted = event_image(events, (346, 200), (end - 50_000, end))
    np.testing.assert_allclose(picture, wanted.transpose(2, 0, 1), atol=1e-6)


def test_simulated_events_of_ess_become_pictures_once(tmp_path, ess, simulator):
    labelled.from_ess(ess, tmp_path, simulator, 0)
    files = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/*/*")}
    assert len(files) == 28
    picture, _ = labelled.Folder.of(tmp_path, "train", (346, 200))[0]
    assert (picture[:2] > -1).any(0).mean() > 0.1
    labelled.from_ess(ess, tmp_path, simulator, 0)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/*/*")} == files


def test_numbers_go_in_pieces_of_a_clip():
    numbers = [*range(1, 400, 3), 900]
    found = list(labelled.pieces(numbers))
    assert [number for piece in found for number in piece] == numbers
    assert all(piece[-1] - piece[0] <= 195 for piece in found)
    assert len(found) == 4


def test_another_folder_is_not_that_of_ess(tmp_path):
    with pytest.raises(DataError, match="0 folders dir"):
        labelled.from_ess(tmp_path, tmp_path / "out", None, 0)


def call(*words):
    done = CliRunner().invoke(segmentation.main, [*map(str, words)])
    assert done.exit_code == 0, done.output
    return done


def test_prepare_and_train(tmp_path, ess, monkeypatch):
    fast = {"evsegnet": (unet, 6, (352, 224))}  # a hundredth of the time
    monkeypatch.setattr(segmentation, "NETWORKS", fast)
    assert "train: 10 pictures" in call("prepare", ess, tmp_path / "real").output
    data = data_set(tmp_path / "set")
    call("train", tmp_path / "run", data, "--epochs", 1, "--batch", 2)
    first = json.loads((tmp_path / "run" / "curve.json").read_text())
    assert len(first["losses"]) == 2
    words = ("--test", tmp_path / "real", "--epochs", 2, "--batch", 2)
    call("train", tmp_path / "other", data, *words, "-o", tmp_path / "out.md")
    numbers = json.loads((tmp_path / "out.json").read_text())
    curve = json.loads((tmp_path / "other" / "curve.json").read_text())
    assert [one["step"] for one in curve["checks"]] == [2, 4]
    assert numbers["measures"]["last"]["mIoU"] == curve["checks"][-1]["mIoU"]
    assert numbers["measures"]["best"]["mIoU"] == max(one["mIoU"] for one in curve["checks"])
    assert numbers["settings"]["test"] == "real"


def test_a_small_net_is_trained_on_shapes(tmp_path, shapes):
    words = ("--network", "unet", "--epochs", 1, "-o", tmp_path / "out.md")
    done = call("train", tmp_path / "run", shapes, *words)
    numbers = json.loads((tmp_path / "out.json").read_text())
    assert set(numbers["measures"]) == {"last", "best", "one class"}
    assert "| one class | 0." in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("shapes", "out", "--side", 20), "--side 20: must be a multiple of 8"),
        (("prepare", ".", "out", "--simulators", "ideal,v2e"), "ideal,v2e: must be one"),
    ],
)
def test_wrong_words(tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(segmentation.main, [*map(str, words)])
    assert done.exit_code == 2
    assert message in done.output
    assert not list(tmp_path.iterdir())
