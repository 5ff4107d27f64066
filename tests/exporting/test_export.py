"""``adv2e export``: what lies in the folder, against loaders written out here."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from streams import random_events

import adv2e
from adv2e.errors import UsageError
from adv2e.formats.writing import open_sink

SIZE = WIDTH, HEIGHT = 30, 20
TIMES_MS = [0, 40, 80, 120, 160, 200, 240, 280, 320, 360]


def record(path, *, frames=True, seed=1, size=SIZE, colour=False):
    rng = np.random.default_rng(seed)
    events = random_events(seed, 4000, first=1, last=380_000, size=size)
    shape = (size[1], size[0], 3) if colour else (size[1], size[0])
    images = [rng.integers(0, 256, shape, dtype=np.uint8) for _ in TIMES_MS]
    with open_sink(
        path, width=size[0], height=size[1], metadata={"adv2e": "0.0.1"}, with_frames=frames
    ) as sink:
        for t_ms, image in zip(TIMES_MS, images, strict=True):
            sink.write_frame(t_ms * 1_000_000, image)
        sink.write_events(events)
    return events, images


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def grid_of(events, bins, size=SIZE):
    """E2VID's grid, event by event."""
    grid = np.zeros((bins, size[1], size[0]))
    first, last = int(events["t"][0]), int(events["t"][-1])
    for event in events:
        place = (bins - 1) * (int(event["t"]) - first) / ((last - first) or 1)
        for k in range(bins):
            weight = max(0.0, 1.0 - abs(k - place))
            grid[k, event["y"], event["x"]] += (1 if event["p"] else -1) * weight
    return grid


def test_voxel_grids_between_images_are_those_of_a_loop(adv2e):
    events, _ = record("a.h5")
    told = adv2e("export", "a.h5", "-o", "out", "--to", "voxel", "--at", "images", "--bins", "4")
    assert (told.status, told.err) == (0, "")
    assert told.out.startswith("out: 9 voxel grids of 1 recording")
    bounds = np.loadtxt("out/a/boundary_timestamps.txt")
    assert bounds[:, 1].tolist() == [t / 1000 for t in TIMES_MS[:-1]]
    assert np.loadtxt("out/a/timestamps.txt")[:, 1].tolist() == bounds[:, 2].tolist()
    for number, start, stop in bounds:
        grid = np.load(f"out/a/event_tensor_{int(number):010d}.npy")
        inside = (events["t"] >= start * 1e6) & (events["t"] < stop * 1e6)
        assert (grid.dtype, grid.shape) == (np.float32, (4, HEIGHT, WIDTH))
        np.testing.assert_allclose(grid, grid_of(events[inside], 4), atol=1e-5)


def test_e2vid_normalises_over_the_cells_that_are_not_zero(adv2e):
    record("a.h5")
    for name in ("none", "e2vid"):
        more = ("--count", "500", "--normalise", name)
        assert adv2e("export", "a.h5", "-o", name, "--to", "voxel", *more).status == 0
    assert len(list(Path("none/a").glob("*.npy"))) == 8
    raw, scored = (np.load(f"{name}/a/event_tensor_0000000003.npy") for name in ("none", "e2vid"))
    filled = raw[raw != 0]
    expected = np.where(raw != 0, (raw - filled.mean()) / filled.std(), 0)
    np.testing.assert_allclose(scored, expected, atol=1e-5)


def test_measured_and_simulated_files_of_other_formats_give_the_same(adv2e):
    record("a.h5")
    record("a.zip")
    record("a.txt")
    for path in ("a.h5", "a.zip", "a.txt"):
        out = f"of_{path[2:]}"
        assert adv2e("export", path, "-o", out, "--to", "voxel", "--window", "50ms").status == 0
    names = sorted(path.name for path in Path("of_h5/a").iterdir())
    assert len(names) == 7 + 2
    for name in names:
        for other in ("of_zip", "of_txt"):
            assert Path(other, "a", name).read_bytes() == Path("of_h5/a", name).read_bytes()


def loader_of_event_cnn_minimal(path):
    """Yield (events, image) of the items between frames, as its DynamicH5Dataset pairs them."""
    with h5py.File(path) as file:
        images = [file["images"][name] for name in file["images"]]
        before = 0
        pairs = []
        for image in images:
            pairs.append((before, int(image.attrs["event_idx"])))
            before = pairs[-1][1]
        assert len(images) == file.attrs["num_imgs"]
        for index in range(len(images) - 1):
            begin, end = pairs[index]
            p = file["events/ps"][begin:end] * 2.0 - 1.0
            yield (file["events/ts"][begin:end], p), images[index + 1][:]


def test_a_training_set_of_several_recordings(adv2e, tmp_path):
    for number in range(5):
        record(f"r{number}.zip", seed=number, colour=number == 2)
    told = adv2e("export", *(f"r{k}.zip" for k in range(5)), "-o", "set", "--to", "e2vid")
    assert told.status == 0
    assert "r0.zip: 10 images; a loader of 40 intervals" in told.err
    train = Path("set/train.txt").read_text().splitlines()
    valid = Path("set/valid.txt").read_text().splitlines()
    assert [Path(line).name for line in train] == ["r0.h5", "r1.h5", "r2.h5", "r3.h5"]
    assert [Path(line).name for line in valid] == ["r4.h5"]
    assert all(Path(line).is_absolute() and Path(line).is_file() for line in train + valid)
    items = list(loader_of_event_cnn_minimal(train[2]))
    assert len(items) == 9
    assert {image.shape for _, image in items} == {(HEIGHT, WIDTH)}  # grey, whatever it was
    assert set(np.concatenate([p for (_, p), _ in items]).tolist()) == {-1.0, 1.0}
    _, images = record("again.zip", seed=2, colour=True)
    expected = cv2.cvtColor(images[1], cv2.COLOR_RGB2GRAY).astype(int)
    assert np.abs(items[0][1].astype(int) - expected).max() <= 1


def test_a_training_set_of_one_recording_is_divided_in_time(adv2e):
    events, _ = record("a.zip")
    assert adv2e("export", "a.zip", "-o", "set", "--to", "e2vid", "--valid", "0.3").status == 0
    with (
        h5py.File("set/sequences/a_train.h5") as train,
        h5py.File("set/sequences/a_valid.h5") as valid,
    ):
        assert (train.attrs["num_imgs"], valid.attrs["num_imgs"]) == (8, 3)
        times = np.concatenate([train["events/ts"][:], valid["events/ts"][:]])
        np.testing.assert_allclose(times, events["t"] / 1e6, atol=1e-9)
        assert train["events/ts"][-1] < 0.28 <= valid["events/ts"][0]


def test_pictures_for_ev_segnet(adv2e):
    events, images = record("drive.h5", size=(346, 260))
    told = adv2e("export", "drive.h5", "-o", "seg", "--to", "ev-segnet", "--split", "test")
    assert told.status == 0, told.err
    names = sorted(path.name for path in Path("seg/events/test").iterdir())
    assert names == sorted(f"drive_export_{k}.npy" for k in range(10))
    picture = np.load("seg/events/test/drive_export_4.npy")
    assert (picture.shape, picture.dtype) == ((200, 346, 6), np.float32)
    inside = (events["t"] >= 110_000) & (events["t"] < 160_000) & (events["y"] < 200)
    chosen = events[inside]
    counts = np.zeros((2, 200, 346))
    for event in chosen:
        counts[1 - event["p"], event["y"], event["x"]] += 1
    np.testing.assert_allclose(picture[..., 0], counts[0] / counts.max() * 2 - 1, atol=1e-6)
    np.testing.assert_allclose(picture[..., 1], counts[1] / counts.max() * 2 - 1, atol=1e-6)
    image = cv2.imread("seg/images/test/drive_export_4.png", cv2.IMREAD_UNCHANGED)
    assert np.array_equal(image, images[4][:200])


def test_it_says_how_it_was_made(adv2e):
    record("a.h5")
    adv2e("export", "a.h5", "-o", "out", "--to", "voxel", "--count", "1000")
    told = json.loads(Path("out/export.json").read_text())
    assert told["to"] == "voxel"
    assert told["sequences"] == [{"name": "a", "size": [WIDTH, HEIGHT], "items": 4}]
    assert told["inputs"] == [{"name": "a", "file": "a.h5", "label": None}]


def test_an_export_is_replaced_only_if_nothing_else_is_in_it(adv2e):
    record("a.h5")
    again = ("export", "a.h5", "-o", "out", "--to", "voxel", "--count", "1000")
    assert adv2e(*again).status == 0
    assert "out: exists already" in adv2e(*again).err
    assert adv2e(*again, "--overwrite").status == 0
    Path("out/model.pt").write_text("mine")
    assert "out: holds model.pt, which would be lost" in adv2e(*again, "--overwrite").err
    assert Path("out/model.pt").read_text() == "mine"


@pytest.mark.parametrize(
    ("given", "status", "told"),
    [
        (("--to", "voxel"), 2, "--to voxel needs one of --window TIME, --count N and --at images"),
        (("--to", "voxel", "--count", "3", "--at", "images"), 2, "needs one of"),
        (("--to", "voxel", "--window", "33"), 2, "must be a time with its unit, such as 33ms"),
        (("--to", "e2vid", "--bins", "3"), 2, "--bins is not for --to e2vid: leave it out"),
        (("--to", "e2vid"), 1, "a.txt: holds no images"),
        (("--to", "voxel", "--at", "images"), 1, "a.txt: holds no images"),
    ],
)
def test_what_cannot_be(given, status, told, adv2e):
    record("a.txt", frames=False)
    found = adv2e("export", "a.txt", "-o", "out", *given)
    assert (found.status, told in found.err) == (status, True), found.err
    assert sorted(path.name for path in Path().iterdir()) == ["a.txt", "a.txt.json"]


@pytest.mark.parametrize(
    ("to", "given", "told"),
    [
        ("e2vid", {"valid": 0.95}, r"valid: must be a share from 0 to 0\.9, got 0\.95"),
        ("voxel", {"window_us": 0}, "window_us: must be a whole number from 1 on, got 0"),
        ("voxel", {"count": 3, "bins": 10_001}, "bins: must be at most 10000, got 10001"),
    ],
)
def test_values_are_checked_in_python_as_on_the_command_line(to, given, told):
    with pytest.raises(UsageError, match=told):
        adv2e.export("a.txt", "out", to, **given)


def test_recordings_of_one_name_take_that_of_their_folder(adv2e):
    for folder in ("one", "two"):
        Path(folder).mkdir()
        record(f"{folder}/a.h5")
    told = adv2e("export", "one/a.h5", "two/a.h5", "-o", "out", "--to", "voxel", "--count", "1000")
    assert told.status == 0, told.err
    assert sorted(path.name for path in Path("out").iterdir()) == ["export.json", "one_a", "two_a"]
    told = adv2e("export", "one/a.h5", "one/a.h5", "-o", "o", "--to", "voxel", "--count", "9")
    assert "two inputs are called one_a" in told.err
