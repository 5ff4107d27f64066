"""``adv2e.torch.EventDataset``: with torch where it is here, else with arrays in its place."""

import pickle
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from streams import random_events

from adv2e import torch as module
from adv2e.errors import DataError, MissingExtraError, UsageError
from adv2e.exporting.export import export
from adv2e.formats.writing import write_events
from adv2e.torch import EventDataset

SIZE = WIDTH, HEIGHT = 12, 9
NAMES = ("train/cat/a", "train/cat/b", "train/dog/a", "test/dog/b")


@pytest.fixture
def tree(tmp_path):
    made = {}
    for number, name in enumerate(NAMES):
        path = tmp_path / "tree" / f"{name}.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        made[name] = random_events(number, 400, first=7, last=100_000)
        write_events(path, made[name], SIZE)
    return tmp_path / "tree", made


@pytest.fixture
def arrays(monkeypatch):
    """Put arrays in the place of tensors."""
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(from_numpy=lambda array: array))
    monkeypatch.setattr(module, "find_spec", lambda name: name)


def test_without_torch_it_says_what_is_missing(tree, monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"adv2e\[torch\]"):
        EventDataset(tree[0])


@pytest.mark.usefixtures("arrays")
def test_windows_are_those_of_an_export(tree, tmp_path):
    root, _ = tree
    for how, words in (
        ({"window_us": 20_000, "bins": 3}, "time"),
        ({"count": 90, "polarity": "split", "normalise": "e2vid"}, "count"),
    ):
        export(root, tmp_path / words, "voxel", **how)
        data = EventDataset(root, **how, labels=False)
        files = [
            path
            for name in data.names
            for path in sorted((tmp_path / words / name).glob("event_tensor_*.npy"))
        ]
        assert len(data) == len(files) > 10
        for number, path in enumerate(files):
            np.testing.assert_array_equal(data[number], np.load(path))


@pytest.mark.usefixtures("arrays")
def test_raw_events_and_labels(tree):
    root, made = tree
    data = EventDataset(root, "raw", count=150)
    assert (data.classes, len(data)) == (["cat", "dog"], 4 * 2)
    for number, name in enumerate(sorted(NAMES)):
        for half in range(2):
            found, label = data[2 * number + half]
            part = made[name][150 * half : 150 * half + 150]
            expected = [[e["t"] - part["t"][0], e["x"], e["y"], e["p"]] for e in part]
            assert found.tolist() == np.array(expected, int).tolist()
            assert label == ("dog" in name)
    assert np.array_equal(data[-1][0], data[7][0])
    for outside in (8, -9):
        with pytest.raises(IndexError):
            data[outside]


@pytest.mark.usefixtures("arrays")
def test_counts_are_in_order_of_time(tree):
    root, made = tree
    data = EventDataset(root / "test", "counts", bins=4)
    counts, _ = data[0]
    events = made["test/dog/b"]
    first, last = int(events["t"][0]), int(events["t"][-1])
    expected = np.zeros((4, 2, HEIGHT, WIDTH))
    for e in events:
        number = min(int((int(e["t"]) - first) / (last - first) * 4), 3)
        expected[number, e["p"], e["y"], e["x"]] += 1
    np.testing.assert_array_equal(counts, expected)
    assert counts.dtype == np.float32
    write_events(root / "many.h5", np.repeat(events[:1], 300), SIZE)
    assert EventDataset(root / "many.h5", "counts", bins=1)[0].max() == 300


@pytest.mark.usefixtures("arrays")
def test_a_part_of_the_set(tree):
    root, _ = tree
    names = {split: EventDataset(root, split=split).names for split in ("train", "test")}
    assert names == {"train": sorted(NAMES[:3]), "test": [NAMES[3]]}
    with pytest.raises(DataError, match="holds no recording of valid"):
        EventDataset(root, split="valid")
    for number in range(12):
        write_events(root / "more" / f"{number}.h5", random_events(number, 9), SIZE)
    held, rest = (
        EventDataset(root / "more", split=one, held_out=0.5).names for one in ("valid", "train")
    )
    assert sorted([*held, *rest], key=int) == [str(number) for number in range(12)]
    export(root / "more", root.parent / "out", "voxel", count=9, valid=0.5)
    rows = (root.parent / "out" / "files.csv").read_text().splitlines()[1:]
    assert sorted(held) == sorted(row.split(",")[0] for row in rows if row.endswith(",valid"))


@pytest.mark.usefixtures("arrays")
def test_nothing_is_read_before_it_is_asked_for_and_few_are_kept(tree, monkeypatch):
    root, _ = tree
    read = []
    own = module._read
    monkeypatch.setattr(module, "_read", lambda path: read.append(path) or own(path))
    data = EventDataset(root, kept=2)
    assert (len(data), read) == (4, [])
    for number in (0, 1, 0, 1, 2, 0):
        data[number]
    assert len(read) == 4
    again = pickle.loads(pickle.dumps(data))
    assert np.array_equal(again[3][0], data[3][0])


@pytest.mark.usefixtures("arrays")
def test_what_cannot_be(tree):
    root, _ = tree
    with pytest.raises(UsageError, match="give one of window_us and count"):
        EventDataset(root, window_us=5, count=3)
    with pytest.raises(UsageError, match="'voxels' and None are not known"):
        EventDataset(root, "voxels")
    with pytest.raises(UsageError, match="normalise: must be none, "):
        EventDataset(root, normalise="no")
    with pytest.raises(DataError, match="is in no folder named after its class"):
        EventDataset(root / "train" / "cat", labels=True)
    assert EventDataset(root / "train" / "cat")[0].shape == (5, HEIGHT, WIDTH)


def test_workers_of_torch_give_the_same(tree):
    torch = pytest.importorskip("torch", reason="torch is not here")
    data = EventDataset(tree[0], window_us=20_000, transform=torch.abs)
    loader = torch.utils.data.DataLoader(data, batch_size=3, num_workers=2)
    grids, labels = (torch.cat(parts) for parts in zip(*loader, strict=True))
    assert grids.shape == (len(data), 5, HEIGHT, WIDTH)
    for number, (grid, label) in enumerate(zip(grids, labels, strict=True)):
        assert torch.equal(grid, data[number][0])
        assert int(label) == data[number][1]
