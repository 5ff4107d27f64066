"""Folders that trainers open: by their own loaders, or by readers of the layout written out here.

Readers know nothing of the package: they find files, fields and units as each trainer's code does.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from streams import random_events

import adv2e as package
from adv2e.errors import DataError
from adv2e.exporting.targets import Targets
from adv2e.formats.writing import open_sink

SIZE = WIDTH, HEIGHT = 40, 36
TIMES_US = [0, 40_000, 80_000, 120_000, 160_000, 200_000]
LAST_US = 210_000


def record(path, *, seed=1, size=SIZE, frames=True, shift=0):
    """Events at random, and images of a square that moves by two columns each."""
    rng = np.random.default_rng(seed)
    events = random_events(seed, 3000, first=1, last=LAST_US, size=size)
    # corners, which tell columns from rows and ON from OFF
    events[[0, 1, 2]] = [(1, size[0] - 1, 0, 1), (2, 0, size[1] - 1, 0), (3, 0, 0, 1)]
    scene = cv2.GaussianBlur(rng.integers(0, 256, (size[1], size[0] + 40), np.uint8), (5, 5), 1.5)
    images = [scene[:, 2 * k : 2 * k + size[0]].copy() for k in range(len(TIMES_US))]
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with open_sink(path, width=size[0], height=size[1], metadata={}, with_frames=frames) as sink:
        for t_us, image in zip(TIMES_US, images, strict=True):
            sink.write_frame(t_us * 1000, image)
        sink.write_events(events)
    return events, images


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def rows_of(folder):
    with Path(folder, "files.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def same_events(found, events):
    """Compare columns t, x, y, p, whatever their types."""
    for name in "txyp":
        np.testing.assert_array_equal(np.asarray(found[name], np.int64), events[name], name)


# ---- Classes: SpikingJelly, Tonic


def classes(*names):
    return {name: record(f"tree/{name}.h5", seed=k)[0] for k, name in enumerate(names, 1)}


CLASSES = ("train/cat/one", "train/cat/deep/two", "train/dog/three", "test/dog/four")


def test_spikingjelly_opens_its_folder(adv2e):
    base = pytest.importorskip("spikingjelly.datasets.base", reason="spikingjelly is not here")
    made = classes(*CLASSES)
    assert adv2e("export", "tree", "-o", "set", "--to", "spikingjelly").status == 0

    class Ours(base.NeuromorphicDatasetFolder):
        @classmethod
        def get_H_W(cls):
            return HEIGHT, WIDTH

        @classmethod
        def resource_url_md5(cls):
            return []

        @classmethod
        def downloadable(cls):
            return False

        @classmethod
        def extract_downloaded_files(cls, download_root, extract_root):
            raise AssertionError

        @classmethod
        def create_raw_from_extracted(cls, extract_root, raw_root):
            raise AssertionError

    train = Ours("set", train=True, data_type="event")
    assert (train.classes, len(train)) == (["cat", "dog"], 3)
    found = {Path(name).name: train.loader(name) for name, _ in train.samples}
    same_events(found["deep_two.npz"], made["train/cat/deep/two"])
    frames = Ours("set", train=False, data_type="frame", frames_number=4, split_by="time")
    picture, label = frames[0]
    assert (np.asarray(picture).shape, label) == ((4, 2, HEIGHT, WIDTH), 0)


def test_class_folders_hold_the_fields_of_the_events(adv2e):
    made = classes(*CLASSES)
    told = adv2e("export", "tree", "-o", "set", "--to", "spikingjelly")
    assert (told.status, told.err) == (0, "")
    assert rows_of("set") == [
        {"file": f"events_np/{name}.npz", "class": label, "split": split}
        for name, label, split in (
            ("test/dog/four", "dog", "test"),
            ("train/cat/deep_two", "cat", "train"),
            ("train/cat/one", "cat", "train"),
            ("train/dog/three", "dog", "train"),
        )
    ]
    with np.load("set/events_np/test/dog/four.npz") as found:
        assert sorted(found.files) == ["p", "t", "x", "y"]
        same_events(found, made["test/dog/four"])


def read_bin(path):
    """Read N-MNIST byte by byte."""
    data = Path(path).read_bytes()
    events = [data[k : k + 5] for k in range(0, len(data), 5)]
    return {
        "x": [e[0] for e in events],
        "y": [e[1] for e in events],
        "p": [e[2] >> 7 for e in events],
        "t": [(e[2] % 128) * 65536 + e[3] * 256 + e[4] for e in events],
    }


def test_bin_files_are_read_byte_by_byte(adv2e):
    made = classes(*CLASSES)
    assert adv2e("export", "tree", "-o", "set", "--to", "nmnist").status == 0
    same_events(read_bin("set/Train/cat/deep_two.bin"), made["train/cat/deep/two"])
    assert rows_of("set")[0] == {"file": "Test/dog/four.bin", "class": "dog", "split": "test"}
    files = sorted(str(path) for path in Path("set").rglob("*") if path.is_file())
    assert len(files) == 4 + 2


def test_tonic_opens_n_mnist(adv2e, monkeypatch):
    datasets = pytest.importorskip("tonic.datasets", reason="tonic is not here")
    made = {
        f"train/{k}/a": record(f"tree/train/{k}/a.h5", seed=k, size=(34, 34))[0] for k in (3, 7)
    }
    assert adv2e("export", "tree", "-o", "NMNIST", "--to", "nmnist").status == 0
    monkeypatch.setattr(datasets.NMNIST, "_check_exists", lambda self: True)
    found = datasets.NMNIST(save_to=".", train=True)
    assert sorted(found.targets) == [3, 7]
    for events, label in (found[k] for k in range(2)):
        same_events(events, made[f"train/{label}/a"])


def test_bin_has_its_limits(adv2e):
    record("wide/cat/a.h5", size=(300, 40))
    told = adv2e("export", "wide", "-o", "set", "--to", "nmnist")
    assert (told.status, "a sensor of 300x40 pixels does not fit" in told.err) == (1, True)
    assert not Path("set").exists()


def test_a_bin_is_read_again(adv2e):
    events, _ = record("a.h5")
    assert adv2e("convert", "a.h5", "-o", "a.bin", "--from", "events").status == 0
    recording = package.read_events("a.bin")
    assert (recording.width, recording.height) == SIZE
    same_events(recording.events, events)


def test_a_recording_without_a_class_is_refused(adv2e):
    record("tree/a.h5")
    for to in ("spikingjelly", "nmnist"):
        told = adv2e("export", "tree", "-o", "set", "--to", to)
        assert (told.status, "a: is in no folder named after its class" in told.err) == (1, True)


def test_a_share_is_held_out_by_names_alone(adv2e):
    for k in range(12):
        record(f"tree/cat/{k}.h5", seed=k, frames=False)
    adv2e("export", "tree", "-o", "set", "--to", "spikingjelly", "--valid", "0.5")
    held = {row["file"].rpartition("/")[2] for row in rows_of("set") if row["split"] == "test"}
    assert 0 < len(held) < 12
    for k in range(6):
        Path(f"tree/cat/{k}.h5").unlink()
    adv2e("export", "tree", "-o", "half", "--to", "spikingjelly", "--valid", "0.5")
    after = {row["file"].rpartition("/")[2] for row in rows_of("half") if row["split"] == "test"}
    assert after == held - {f"{k}.npz" for k in range(6)}


def test_two_that_would_be_one_file_are_refused(adv2e):
    record("tree/cat/a/b.h5")
    record("tree/cat/a_b.h5")
    told = adv2e("export", "tree", "-o", "set", "--to", "spikingjelly", "--valid", "0")
    assert "two inputs are called events_np/train/cat/a_b.npz: rename one" in told.err
    told = adv2e("export", "tree/cat", "-o", "set", "--to", "ev-segnet")
    assert "two inputs are called a_b: rename one" in told.err


# ---- A tree


def test_a_tree_is_kept(adv2e):
    record("tree/train/one.h5")
    record("tree/test/deep/two.h5")
    Path("tree/notes.txt").write_text("of mine")
    record("tree/.hidden/three.h5")
    call = ("export", "tree", "-o", "out", "--to", "voxel", "--window", "50ms")
    assert adv2e(*call).status == 0
    assert {str(path.relative_to("out").parent) for path in Path("out").rglob("*.npy")} == {
        "train/one",
        "test/deep/two",
    }
    assert rows_of("out") == [
        {"file": "test/deep/two", "class": "deep", "split": "test"},
        {"file": "train/one", "class": "", "split": "train"},
    ]
    assert "out: exists already" in adv2e(*call).err
    before = {path: path.read_bytes() for path in Path("out").rglob("*") if path.is_file()}
    assert adv2e(*call, "--overwrite").status == 0
    assert before == {path: path.read_bytes() for path in Path("out").rglob("*") if path.is_file()}
    told = adv2e("export", "out", "-o", "again", "--to", "voxel", "--count", "9")
    assert "out: holds no recordings or files of events" in told.err


# ---- EVREAL


def items_of_evreal(folder):
    """Yield events and image of each item, as its loader pairs them between frames."""
    names = ("events_ts", "events_xy", "events_p", "images")
    t, xy, p, images = (np.load(Path(folder, f"{name}.npy"), mmap_mode="r") for name in names)
    times = [one.item() for one in np.load(Path(folder, "images_ts.npy"))]
    ends = [row[0] for row in np.load(Path(folder, "image_event_indices.npy"))]
    assert len(t) == len(xy) == len(p)
    assert len(images) == len(times) == len(ends)
    for k in range(1, len(images)):
        begin, end = ends[k - 1], ends[k]
        assert 0 <= begin <= end <= len(t)
        yield t[begin:end], xy[begin:end], p[begin:end], images[k][:, :, 0], times[k]


def test_evreal_pairs_events_and_images(adv2e):
    events, images = record("one.h5")
    record("two.h5", seed=2)
    assert adv2e("export", "one.h5", "two.h5", "-o", "set", "--to", "evreal").status == 0
    assert json.loads(Path("set/one/metadata.json").read_text()) == {
        "sensor_resolution": [HEIGHT, WIDTH]
    }
    assert sorted(path.name for path in Path("set").iterdir() if path.is_dir()) == ["one", "two"]
    items = list(items_of_evreal("set/one"))
    assert len(items) == len(TIMES_US) - 1
    for k, (t, xy, p, image, time) in enumerate(items, 1):
        inside = events[(events["t"] >= TIMES_US[k - 1]) & (events["t"] < TIMES_US[k])]
        assert np.rint(t * 1e6).astype(int).tolist() == inside["t"].tolist()
        assert xy.tolist() == [[e["x"], e["y"]] for e in inside]
        assert p.tolist() == inside["p"].tolist()
        assert np.array_equal(image, images[k])
        assert time == TIMES_US[k] / 1e6


def test_evreal_takes_events_alone(adv2e):
    events, _ = record("one.h5", frames=False)
    assert adv2e("export", "one.h5", "-o", "set", "--to", "evreal").status == 0
    assert len(np.load("set/one/events_ts.npy")) == events.size
    assert not Path("set/one/images.npy").exists()


# ---- RVT


def boxes_at(times, *, width=10.0):
    rows = [(t, 3.0 + k, 4.0, width, 8.0, k % 2, k, 0.9) for k, t in enumerate(times)]
    fields = ["t", "x", "y", "w", "h", "class_id", "track_id", "class_confidence"]
    types = ["<i8", *["<f4"] * 4, "<u4", "<u4", "<f4"]
    return np.array(rows, np.dtype(list(zip(fields, types, strict=True))))


def sequence_of_rvt(folder, name="stacked_histogram_dt=20_nbins=5"):
    """Return what RVT's SequenceBase holds: data, ends, frames by window, labels by frame."""
    place = Path(folder, "event_representations_v2", name)
    with h5py.File(place / "event_representations.h5") as file:
        data = file["data"][:]
    frames = np.load(place / "objframe_idx_2_repr_idx.npy")
    with np.load(Path(folder, "labels_v2", "labels.npz")) as held:
        labels, first = held["labels"], held["objframe_idx_2_label_idx"]
    # as its ObjectLabelFactory asserts
    assert len(first) == len(frames) == np.unique(labels["t"]).size
    assert np.all(labels["w"] > 0)
    assert np.all(labels["h"] > 0)
    assert np.all(labels["x"] + labels["w"] <= WIDTH - 1)
    assert np.all(labels["y"] + labels["h"] <= HEIGHT - 1)
    by_frame = [labels[a:b] for a, b in zip(first, [*first[1:], len(labels)], strict=True)]
    times = np.load(Path(folder, "labels_v2", "timestamps_us.npy"))
    return (
        data,
        np.load(place / "timestamps_us.npy"),
        dict(zip(frames, by_frame, strict=True)),
        times,
    )


def histogram_of_rvt(events, start, stop, bins, most):
    """Count one event after the other."""
    data = np.zeros((2 * bins, HEIGHT, WIDTH), int)
    inside = events[(events["t"] >= start) & (events["t"] <= stop)]
    first, last = int(inside["t"][0]), int(inside["t"][-1])
    for event in inside:
        share = np.float32(int(event["t"]) - first) / np.float32(max(last - first, 1))
        number = min(int(np.floor(share * np.float32(bins))), bins - 1)
        data[event["p"] * bins + number, event["y"], event["x"]] += 1
    return np.minimum(data, most)


def test_rvt_finds_windows_and_labels(adv2e):
    events, _ = record("tree/train/a.h5")
    # a step of 20 ms from the first on; one off by 1 ms, which is allowed, one by 7, which is not
    times = [60_000, 100_000, 101_000, 141_000, 168_000, 200_000]
    Path("tree/train/a.h5.side").mkdir()
    np.save("tree/train/a.h5.side/boxes_bbox.npy", boxes_at(times))
    call = ("--to", "rvt", "--window", "20ms", "--bins", "5", "--cutoff", "2")
    told = adv2e("export", "tree", "-o", "set", *call)
    assert told.status == 0, told.err
    assert "boxes at 2 of 6 times are left out: no window of 20 ms ends there" in told.err
    assert "40x36 pixels: RVT takes 304x240 (Gen1) or 1280x720 (1 Mpx)" in told.err
    data, ends, frames, label_times = sequence_of_rvt("set/train/a")
    assert label_times.tolist() == [60_000, 100_000, 141_000, 200_000]
    assert [int(ends[k]) for k in frames] == label_times.tolist()
    assert [one["t"].tolist() for one in frames.values()] == [[t] for t in label_times]
    assert (data.dtype, len(data)) == (np.uint8, len(ends))
    assert ends[:4].tolist() == [40_000, 60_000, 80_000, 100_000]
    assert set(np.diff(ends)) <= {19_666, 19_667, 20_000, 20_500}
    for number, end in enumerate(ends.tolist()):
        expected = histogram_of_rvt(events, end - 20_000, end, 5, 2)
        np.testing.assert_array_equal(data[number], expected)
    assert data.max() == 2


def test_boxes_are_cut_to_the_sensor_as_rvt_demands():
    record("a.h5")
    boxes = boxes_at([60_000, 60_000, 60_000])
    boxes["x"], boxes["w"] = [30, 39.5, -20], [50, 5, 10]
    how = {"valid": 0.0, "window_us": 20_000, "doubt": lambda text: None}
    package.export("a.h5", "set", "rvt", targets=[Targets.of(boxes)], **how)
    _, _, frames, _ = sequence_of_rvt("set/train/a", "stacked_histogram_dt=20_nbins=10")
    (kept,) = frames.values()
    assert kept[["x", "w"]].tolist() == [(30, 9)]


@pytest.mark.parametrize(
    ("boxes", "told"),
    [(None, "no boxes, which RVT needs"), ([5], "no box 20 ms or more after the first event")],
)
def test_rvt_without_a_label_is_refused(boxes, told):
    record("a.h5")
    targets = None if boxes is None else [Targets.of(boxes_at(boxes))]
    with pytest.raises(DataError, match=told):
        package.export("a.h5", "set", "rvt", targets=targets, window_us=20_000)
    assert not Path("set").exists()


# ---- E2VID with flow


def item_of_event_cnn_minimal(path, index):
    """Return flow [px] between two frames, as its DynamicH5Dataset gives it, and the time."""
    with h5py.File(path) as file:
        assert len(file["flow"]) == file.attrs["num_flow"] == file.attrs["num_imgs"]
        names = sorted(file["images"])
        begin, end = (int(file["images"][names[k]].attrs["event_idx"]) for k in (index, index + 1))
        ts = file["events/ts"][begin:end]
        held = file[f"flow/flow{index + 1:09d}"]
        assert held.attrs["timestamp"] == file["images"][names[index + 1]].attrs["timestamp"]
        return held[:] * (ts[-1] - ts[0]), ts[-1] - ts[0]


def test_flow_goes_to_e2vid_as_displacement(adv2e):
    record("a.h5")
    rng = np.random.default_rng(3)
    flow = rng.normal(0, 4, (len(TIMES_US) - 1, 2, HEIGHT, WIDTH)).astype(np.float32)
    flow[2, :, 5, 6] = np.nan
    spans = np.array([TIMES_US[:-1], TIMES_US[1:]]).T
    Path("a.h5.side/flow").mkdir(parents=True)
    lines = []
    for k, (start, stop) in enumerate(spans):
        np.save(f"a.h5.side/flow/{k}.npy", np.moveaxis(flow[k], 0, 2))
        lines.append(f"{start / 1e6:.9f} {stop / 1e6:.9f} flow/{k}.npy\n")
    Path("a.h5.side/flow.txt").write_text("".join(lines))
    told = adv2e("export", "a.h5", "-o", "set", "--to", "e2vid", "--valid", "0")
    assert told.status == 0, told.err
    share = 100 * 2 / flow.size
    assert f"{share:.1f} % of the flow is not known, and is written as 0" in told.err
    for k in range(len(TIMES_US) - 1):
        found, dt = item_of_event_cnn_minimal("set/sequences/a.h5", k)
        expected = np.nan_to_num(flow[k]) * dt / 0.04
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
    package.export(
        "a.h5",
        "python",
        "e2vid",
        targets=[Targets.of(flow=flow, flow_us=spans)],
        valid=0.0,
        doubt=lambda text: None,
    )
    same = (Path(f"{name}/sequences/a.h5").read_bytes() for name in ("set", "python"))
    assert next(same) == next(same)


def test_flow_that_is_estimated_follows_the_scene(adv2e):
    record("a.h5")
    more = ("--valid", "0", "--flow", "estimated")
    assert adv2e("export", "a.h5", "-o", "set", "--to", "e2vid", *more).status == 0
    found, dt = item_of_event_cnn_minimal("set/sequences/a.h5", 2)
    u, v = found[:, 8:-8, 8:-8] * 0.04 / dt
    assert np.median(u) == pytest.approx(-2, abs=0.2)
    assert np.median(v) == pytest.approx(0, abs=0.2)


def test_flow_at_other_times_is_refused():
    record("a.h5")
    flow = np.zeros((1, 2, HEIGHT, WIDTH), np.float32)
    targets = [Targets.of(flow=flow, flow_us=[[5, 40_000]])]
    with pytest.raises(DataError, match=r"no flow from 0\.000000 to 0\.040000 s"):
        package.export("a.h5", "set", "e2vid", targets=targets, doubt=lambda text: None)


def test_what_lies_beside_is_cut_and_turned_as_the_events_are(adv2e):
    record("a.h5")
    boxes = boxes_at([60_000, 110_000], width=20.0)
    boxes["h"] = 25
    np.save("a_bbox.npy", boxes)
    Path("a.h5.side/flow").mkdir(parents=True)
    flow = np.indices(SIZE[::-1]).transpose(1, 2, 0)[..., ::-1].astype(np.float32)  # its place
    np.save("a.h5.side/flow/0.npy", flow)
    Path("a.h5.side/flow.txt").write_text("0.04 0.08 flow/0.npy\n")
    for number, turned in enumerate((False, True)):
        how = ("--crop", "6,4,20,18", *(["--rotate180"] if turned else []))
        for kind in ("rvt", "dsec"):
            done = adv2e("export", "a.h5", "-o", f"{kind}{number}", "--to", kind, *how)
            assert (done.status, "not carried" in done.err) == (0, False)
        labels = np.load(next(Path(f"rvt{number}").rglob("labels.npz")))["labels"]
        for found, box in zip(labels, boxes, strict=True):
            x, y, w, h = (float(box[name]) for name in "xywh")
            if turned:
                x, y = WIDTH - x - w, HEIGHT - y - h
            left, right = np.clip((x - 6, x + w - 6), 0, 19)  # RVT ends at the last pixel
            top, low = np.clip((y - 4, y + h - 4), 0, 17)
            expected = left, top, right - left, low - top
            assert [float(found[name]) for name in "xywh"] == pytest.approx(expected)
        picture = cv2.imread(str(next(Path(f"dsec{number}").rglob("forward/*.png"))), -1)
        u, v = ((picture[..., at].astype(float) - 2**15) / 128 for at in (2, 1))
        assert picture.shape == (18, 20, 3)
        across, down = np.arange(6, 26), np.arange(4, 22)[:, np.newaxis]
        if turned:
            across, down = across - (WIDTH - 1), down - (HEIGHT - 1)  # the place, and its sign
        assert np.array_equal(u, np.broadcast_to(across, u.shape))
        assert np.array_equal(v, np.broadcast_to(down, v.shape))
    with pytest.raises(DataError, match="crop does not change targets that are given"):
        package.export("a.h5", "x", "rvt", targets=[Targets.of(boxes)], crop=(6, 4, 20, 18))


# ---- DSEC


def test_dsec_is_cut_by_milliseconds(adv2e):
    events, images = record("tree/train/a.h5")
    flow = np.full((1, 2, HEIGHT, WIDTH), 1.5, np.float32)
    flow[0, 1], flow[0, :, 0, 0] = -2.25, np.nan
    record("b.h5")
    targets = [Targets.of(boxes_at([60_000]), flow, [[0, 40_000]])]
    package.export("tree", "set", "dsec", targets=targets)
    left = Path("set/train/a/events/left")
    with h5py.File(left / "events.h5") as file:
        offset, index = int(file["t_offset"][()]), file["ms_to_idx"][:]
        start, stop = 50_000, 100_000
        # as its EventSlicer: down to the millisecond by the index, then by the times
        begin, end = index[(start - offset) // 1000], index[-(-(stop - offset) // 1000)]
        t = file["events/t"][begin:end].astype(int) + offset
        chosen = (t >= start) & (t < stop)
        found = {name: file[f"events/{name}"][begin:end][chosen] for name in "xyp"}
    inside = events[(events["t"] >= start) & (events["t"] < stop)]
    same_events({"t": t[chosen], **found}, inside)
    with h5py.File(left / "rectify_map.h5") as file:
        rectified = file["rectify_map"][:][found["y"], found["x"]]
    assert rectified.tolist() == np.stack([inside["x"], inside["y"]], axis=1).tolist()
    place = Path("set/train/a")
    assert np.loadtxt(place / "images/timestamps.txt", dtype="int64").tolist() == TIMES_US
    picture = cv2.imread(str(place / "images/left/rectified/000003.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(picture, images[3])
    spans = np.genfromtxt(place / "flow/forward_timestamps.txt", delimiter=",", dtype="int64")
    assert spans.tolist() == [0, 40_000]
    raw = cv2.imread(str(place / "flow/forward/000000.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert raw.dtype == np.uint16
    u, v, known = (raw[..., k].astype(float) for k in range(3))
    assert known.sum() == HEIGHT * WIDTH - 1
    assert known[0, 0] == 0
    assert set(((u[known > 0] - 2**15) / 128).tolist()) == {1.5}
    assert set(((v[known > 0] - 2**15) / 128).tolist()) == {-2.25}
    assert np.load(place / "object_detections/left/tracks.npy")["track_id"].tolist() == [0]


# ---- Something for each window


def test_histograms_count(adv2e):
    events, _ = record("a.h5")
    more = ("--window", "50ms", "--bins", "3", "--cutoff", "1")
    assert adv2e("export", "a.h5", "-o", "out", "--to", "histogram", *more).status == 0
    bounds = np.loadtxt("out/a/boundary_timestamps.txt")
    assert len(bounds) == 4
    for number, start, stop in bounds:
        found = np.load(f"out/a/histogram_{int(number):010d}.npy")
        first, last = round(start * 1e6), round(stop * 1e6) - 1
        np.testing.assert_array_equal(found, histogram_of_rvt(events, first, last, 3, 1))


def surface_of(events, t_us, tau_us):
    surface = np.zeros((2, HEIGHT, WIDTH))
    for event in events[events["t"] < t_us]:
        age = t_us - int(event["t"])
        surface[event["p"], event["y"], event["x"]] = np.exp(-age / tau_us)
    return surface


def test_time_surfaces_remember_earlier_windows(adv2e):
    events, _ = record("a.h5")
    more = ("--window", "20ms", "--tau", "30ms")
    assert adv2e("export", "a.h5", "-o", "out", "--to", "surface", *more).status == 0
    for number, _, stop in np.loadtxt("out/a/boundary_timestamps.txt"):
        found = np.load(f"out/a/time_surface_{int(number):010d}.npy")
        assert (found.dtype, found.shape) == (np.float32, (2, HEIGHT, WIDTH))
        expected = surface_of(events, round(stop * 1e6), 30_000)
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_tonic_makes_the_same_time_surfaces(adv2e):
    transforms = pytest.importorskip("tonic.transforms", reason="tonic is not here")
    events, _ = record("a.h5")
    adv2e("export", "a.h5", "-o", "out", "--to", "surface", "--window", "50ms", "--tau", "30ms")
    fields = np.dtype([("x", int), ("y", int), ("t", int), ("p", int)])
    theirs = np.zeros(events.size, fields)
    for name in "txyp":
        theirs[name] = events[name]
    # of the same window; its surface is as old as its last event
    stop = int(events["t"][0]) + 50_000
    theirs = theirs[theirs["t"] < stop]
    surface = transforms.ToTimesurface((WIDTH, HEIGHT, 2), dt=50_000, tau=30_000)(theirs)
    found = np.load("out/a/time_surface_0000000000.npy")
    age = np.log(found.max()) - np.log(surface[0].max())
    np.testing.assert_allclose(found, surface[0] * np.exp(age), rtol=1e-4)


def test_pictures_show_the_last_event_of_each_pixel(adv2e):
    events, _ = record("a.h5")
    call = ("export", "a.h5", "-o", "out", "--to", "picture", "--at", "images")
    assert adv2e(*call, "--style", "black").status == 0
    assert len(list(Path("out/a").glob("*.png"))) == len(TIMES_US) - 1
    picture = cv2.imread("out/a/0000000001.png", cv2.IMREAD_UNCHANGED)
    last = np.full((HEIGHT, WIDTH), -1)
    for event in events[(events["t"] >= TIMES_US[1]) & (events["t"] < TIMES_US[2])]:
        last[event["y"], event["x"]] = event["p"]
    red, blue = picture[..., 2].astype(int), picture[..., 0].astype(int)
    assert np.array_equal(picture.any(axis=2), last >= 0)
    assert np.array_equal(red > blue, last == 1)
    assert np.array_equal(red < blue, last == 0)
