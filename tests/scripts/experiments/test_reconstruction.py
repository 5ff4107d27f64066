"""Networks trained on simulated events: what they are given, that they learn, and the commands."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from written_recordings import write_recording

from adv2e import simulate
from adv2e.config import load_config
from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.representations.voxel_grid import z_scored

torch = pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")
pytest.importorskip("skimage", reason="textures are of scikit-image (extra experiments)")
pytest.importorskip("matplotlib", reason="curves are drawn by Matplotlib (extra experiments)")

from experiments import images, reconstruction  # noqa: E402
from experiments.clip import Clip  # noqa: E402
from experiments.images import Batches, Pair, gopro_folders  # noqa: E402
from experiments.scenes import texture_clip  # noqa: E402
from experiments.simulators import named  # noqa: E402
from networks.firenet import firenet  # noqa: E402

SIZE = WIDTH, HEIGHT = 24, 16
CONFIG = load_config("ideal", "frames.encoding=linear")


pytestmark = pytest.mark.usefixtures("one_torch_thread")


def call(*words):
    done = CliRunner().invoke(reconstruction.main, [*map(str, words)])
    assert done.exit_code == 0, done.output
    return done


def test_a_texture_is_the_same_light_at_any_rate():
    slow, fast = (texture_clip(5, count, SIZE, hz) for count, hz in ((4, 120), (7, 240)))
    np.testing.assert_allclose(slow.frames, fast.frames[::2], atol=1e-3)
    assert slow.times_ns.tolist() == fast.times_ns[::2].tolist()
    assert np.abs(np.diff(fast.frames, axis=0)).mean() > 0.1
    assert 0 <= fast.frames.min() <= fast.frames.max() <= 255


def test_textures_differ_by_seed_alone():
    first, again, other = (texture_clip(seed, 2, SIZE).frames for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def pair_of(seed, frames=33, size=SIZE):
    (simulator,) = named(["ideal"], threads=1)
    return Pair.simulated(texture_clip(seed, frames, size), simulator, 0, 8)


def test_a_grid_of_a_part_is_that_of_a_loop_over_events():
    pair, (corner, size) = pair_of(3), ((5, 2), (12, 9))
    start, stop = pair.times_us[1:3]
    chosen = [
        e for e in pair.events
        if start <= e["t"] < stop and 5 <= e["x"] < 17 and 2 <= e["y"] < 11
    ]  # fmt: skip
    assert len(chosen) > 20
    first, last = chosen[0]["t"], chosen[-1]["t"]
    grid = np.zeros((5, 9, 12))
    for e in chosen:
        place = 4 * (int(e["t"]) - int(first)) / int(last - first)
        for k in range(5):
            weight = max(0.0, 1 - abs(k - place))
            grid[k, e["y"] - 2, e["x"] - 5] += weight * (1 if e["p"] else -1)
    np.testing.assert_allclose(pair.grid(1, corner, size), z_scored(grid), atol=1e-5)


def test_what_is_drawn_belongs_together():
    """An event is where the image after it is bright, wherever both are cut and mirrored."""
    images = np.zeros((4, HEIGHT, WIDTH), np.float32)
    t, x, y = [], [], []
    for k, (column, row) in enumerate([(9, 7), (10, 8), (11, 6)]):
        images[k + 1, row, column] = 1
        t, x, y = [*t, 10 * k + 5], [*x, column], [*y, row]
    events = make_events(t=t, x=x, y=y, p=[1] * 3)
    pair = Pair(events, images, np.arange(0, 40, 10))
    rng, places = np.random.default_rng(0), set()
    for _ in range(20):
        grids, drawn = Batches([pair], 2, 3, (20, 14)).draw(rng)
        assert grids.shape == (3, 2, 5, 14, 20)
        assert drawn.shape == (3, 2, 1, 14, 20)
        filled = (grids != 0).any(2)
        # a lone event is z-scored to zero, and told by nothing
        assert not filled.any()
        places |= {tuple(place) for place in np.argwhere(drawn[0, :, 0])[:, 1:].tolist()}
    assert len(places) > 5
    twice = np.concatenate([events, events])
    twice["t"][3:] += 2
    twice["p"][3:] = 0
    twice = twice[np.argsort(twice["t"])]
    grids, drawn = Batches([Pair(twice, images, pair.times_us)], 4, 3, (20, 14)).draw(rng)
    assert np.array_equal((grids != 0).any(2), drawn[:, :, 0] > 0)


def test_too_short_a_sequence_is_one_line():
    with pytest.raises(DataError, match="4 images of 24x16 pixels is too small for runs of 4"):
        Batches([pair_of(1, 25)], 1, 4, SIZE)


def test_firenet_learns(tmp_path):
    batches = Batches([pair_of(7, 33, (16, 16))], 1, 4, (16, 16))
    net, rng = firenet(), np.random.default_rng(0)
    step = images.update_of(batches, 4, "cpu")
    optimiser = torch.optim.Adam(net.parameters(), lr=3e-3)
    losses = [step(net, optimiser, rng) for _ in range(60)]
    assert np.mean(losses[-10:]) < 0.75 * np.mean(losses[:5])


def test_a_gradient_spans_as_many_windows_as_it_is_told():
    batches = Batches([pair_of(7, 33, (16, 16))], 1, 4, (16, 16))

    class Counted(torch.optim.SGD):
        steps = 0

        def step(self):
            self.steps += 1
            super().step()

    for truncate, steps in ((4, 1), (3, 2), (1, 4)):
        net = firenet()
        optimiser = Counted(net.parameters(), lr=1e-3)
        images.update_of(batches, truncate, "cpu")(net, optimiser, np.random.default_rng(0))
        assert optimiser.steps == steps


def test_a_state_that_is_detached_has_its_values():
    held = torch.ones(2, requires_grad=True)
    inner = images.detached([(held * 2, held), held * 3])
    assert inner[0][0].tolist() == [2, 2]
    assert not any(one.requires_grad for one in (inner[0][0], inner[0][1], inner[1]))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    frames = np.rint(texture_clip(11, 7, SIZE, 20).frames).astype(np.uint8)
    times = 1.2 + np.arange(7) / 20
    events = np.concatenate(list(simulate(frames, times, CONFIG, threads=1)))
    place = tmp_path_factory.mktemp("data") / "slider_depth"
    return write_recording(place, times, frames, events)


def test_measures_are_those_of_their_definitions():
    frames = np.random.default_rng(0).random((2, 20, 30)).astype(np.float32)
    same = images.measures_of(frames, frames, None)
    assert same["MSE"] == same["equalised MSE"] == 0
    assert same["SSIM"] == same["equalised SSIM"] == pytest.approx(1)
    darker = images.measures_of(0.5 * frames, frames, None)
    assert darker["MSE"] == pytest.approx(np.mean((0.5 * frames) ** 2), rel=1e-6)
    assert darker["equalised MSE"] < 0.001


def test_sequences_of_davis240c_are_cut(recording):
    (whole,) = images.parts(recording)
    assert len(whole.spans) == 4
    assert whole.frames.shape == (4, HEIGHT, WIDTH)
    (cut_one,) = images.parts(recording.parent)
    assert (cut_one.name, len(cut_one.spans)) == ("slider_depth", 4)
    assert images.CUTS["slider_depth"] == (1.0, 2.5)
    # events begin after the first frame, so that it begins no interval
    first = cv2.imread(str(recording / "images" / "frame_00000002.png"), cv2.IMREAD_GRAYSCALE)
    np.testing.assert_allclose(whole.frames[0], first / 255, atol=1e-6)


def test_a_sequence_without_its_cut_is_one_line(tmp_path):
    frames = np.rint(texture_clip(11, 5, SIZE, 20).frames).astype(np.uint8)
    events = np.concatenate(list(simulate(frames, 20, CONFIG, threads=1)))
    write_recording(tmp_path / "boxes_6dof", np.arange(5) / 20, frames, events)
    with pytest.raises(DataError, match="no frame interval with events within"):
        list(images.parts(tmp_path))


TINY = ("--frames", 25, "--length", 2, "--batch", 1, "--size", "24x16", "--crop", "16x16")


def test_a_network_is_trained_and_tested(tmp_path, recording):
    run, words = tmp_path / "run", ("--textures", 2, "--network", "firenet", *TINY)
    call("train", run, *words, "--steps", 2)
    made = {path: path.stat().st_mtime_ns for path in (run / "sequences").glob("*.npz")}
    assert len(made) == 2
    call("train", run, *words, "--steps", 4)
    assert {path: path.stat().st_mtime_ns for path in (run / "sequences").glob("*.npz")} == made
    assert len(json.loads((run / "curve.json").read_text())["losses"]) == 4
    call("train", tmp_path / "whole", *words, "--steps", 4)
    curves = [json.loads((one / "curve.json").read_text()) for one in (run, tmp_path / "whole")]
    assert curves[0]["losses"] == curves[1]["losses"]
    out = tmp_path / "out.md"
    call("test", recording.parent, run, "-o", out, "--pictures", tmp_path / "pictures")
    found = json.loads(out.with_suffix(".json").read_text())["slider_depth"]
    assert set(found) == {str(run), "one grey"}
    assert found["one grey"]["MSE"] == pytest.approx(
        np.mean([frame.var() for frame in next(images.parts(recording)).frames]), rel=1e-3
    )
    assert cv2.imread(str(tmp_path / "pictures" / "slider_depth.png")).shape == (16, 48, 3)


def test_sequences_of_gopro_are_found_and_cut_in_pieces(tmp_path):
    folder = tmp_path / "GOPRO_Large_all" / "train" / "GOPR0001_11_00"
    folder.mkdir(parents=True)
    frames = texture_clip(4, 52, (48, 32)).frames
    for k, frame in enumerate(frames):
        coded = np.repeat(np.rint(frame).astype(np.uint8)[..., None], 3, 2)
        cv2.imwrite(str(folder / f"{k + 1:06d}.png"), coded)
    assert gopro_folders(tmp_path / "GOPRO_Large_all") == [folder]
    words = ("--gopro", tmp_path / "GOPRO_Large_all", "--network", "firenet", *TINY)
    call("train", tmp_path / "run", *words, "--steps", 1)
    pieces = sorted((tmp_path / "run" / "sequences").glob("*.npz"))
    assert [path.name for path in pieces] == [f"GOPR0001_11_00-{k:03d}.npz" for k in (1, 2)]
    second = Pair.load(pieces[1])
    assert second.images.shape == (4, HEIGHT, WIDTH)
    assert second.times_us[0] == pytest.approx(25e6 / 240, abs=1)
    decoded = ((np.rint(frames[25]) / 255 + 0.055) / 1.055) ** 2.4
    wanted = decoded.reshape(16, 2, 24, 2).mean((1, 3))
    bright = wanted > 0.05
    np.testing.assert_allclose(second.images[0][bright], wanted[bright], rtol=0.05)
    with pytest.raises(DataError, match="give GOPRO_Large_all"):
        gopro_folders(folder)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("train", "run"), "say --gopro FOLDER or --textures N"),
        (
            ("train", "run", "--textures", 1, "--simulators", "ideal,v2e"),
            "--simulators ideal,v2e: must be one",
        ),
        (("train", "run", "--textures", 1, "--size", "240"), "must be WxH"),
    ],
)
def test_wrong_words(tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(reconstruction.main, [*map(str, words)])
    assert done.exit_code == 2
    assert message in done.output
    assert not list(tmp_path.iterdir())


def test_a_folder_without_a_training_is_one_line(tmp_path, recording):
    done = CliRunner().invoke(reconstruction.main, ["test", str(recording), str(tmp_path)])
    assert done.exit_code == 1
    assert done.output.splitlines() == [
        f"Error: {tmp_path / 'checkpoint.pt'}: not there; give a folder that train made"
    ]


@pytest.mark.parametrize("raw", [b"something else", b"", b"PK\x03\x04", b"\x80\x02]q\x00."])
def test_a_file_that_is_no_checkpoint_is_one_line(raw, tmp_path, recording):
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(raw)
    done = CliRunner().invoke(reconstruction.main, ["test", str(recording), str(tmp_path)])
    assert done.exit_code == 1
    (line,) = done.output.splitlines()
    assert line.startswith(f"Error: {path}: no checkpoint of a training (")


def test_events_of_other_settings_need_another_folder(tmp_path):
    words = ("train", tmp_path, "--textures", 1, "--network", "firenet", *TINY, "--steps", 1)
    call(*words)
    done = CliRunner().invoke(reconstruction.main, [*map(str, words), "--simulators", "v2e"])
    assert done.exit_code == 1
    assert "take another folder" in done.output


def test_a_clip_is_given_in_full_and_kept_in_part():
    light = np.zeros((9, 4, 5), np.float32)

    class Noted:
        def events(self, clip, seed):
            assert len(clip.frames) == 9
            assert seed == 6
            return make_events(t=[1], x=[0], y=[0], p=[1])

    pair = Pair.simulated(Clip(light, np.arange(9) * 1000), Noted(), 6, 4)
    assert pair.times_us.tolist() == [0, 4, 8]
    assert pair.images.shape == (3, 4, 5)
