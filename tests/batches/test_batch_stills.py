"""``adv2e batch --motion``: each picture below a folder is a sequence."""

import cv2
import numpy as np
import pytest
from pictures import picture
from trees_of_batch import last_of, made_in, pictures

import adv2e as package

MOVED = ("--motion", "saccade", "--extent", "3")


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "from"
    for number, name in enumerate(("train/cat/a", "train/cat/b", "test/dog/a"), 1):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(root / f"{name}.png"), picture(number))
    (root / "notes.txt").write_text("of mine")
    return root


def test_each_picture_is_that_of_the_command_for_one(batch, source, tmp_path):
    dest = tmp_path / "to"
    done = batch(source, dest, *MOVED, "--seed", 5)
    assert done.status == 0, done.err
    assert "3 sequences: 3 made" in done.out
    assert "notes.txt: no picture to move before" in done.err
    records = last_of(dest)
    assert sorted(records) == ["test/dog/a", "train/cat/a", "train/cat/b"]
    for name, record in records.items():
        config = {"sampling": {"L": 1}, "pixel": {"low_pass": None}, "seed": record["seed"]}
        how = {"motion": "saccade", "extent_px": 3, "overwrite": True}
        with pytest.warns(package.Adv2eWarning, match="frames are srgb"):
            package.convert(source / f"{name}.png", tmp_path / "alone.h5", config, **how)
        alone = package.read_events(tmp_path / "alone.h5").events
        assert alone.size > 0
        assert np.array_equal(package.read_events(dest / f"{name}.h5").events, alone)


def test_called_again_it_keeps_all_but_what_changed(batch, source, tmp_path):
    dest = tmp_path / "to"
    batch(source, dest, *MOVED)
    before = made_in(dest)
    assert "3 kept" in batch(source, dest, *MOVED).err
    assert made_in(dest) == before
    assert (
        "3 the configuration or an option changed"
        in batch(source, dest, "--motion", "saccade", "--extent", "4", "--dry-run").out
    )
    cv2.imwrite(str(source / "train/cat/a.png"), picture(7))
    assert "1 its source changed, 2 kept" in batch(source, dest, *MOVED).err


def test_on_to_a_set_of_classes(batch, source, tmp_path):
    dest = tmp_path / "to"
    assert batch(source, dest, *MOVED, "--export", "spikingjelly").status == 0
    rows = (dest / "spikingjelly" / "files.csv").read_text().splitlines()
    assert rows == [
        "file,class,split",
        "events_np/test/dog/a.npz,dog,test",
        "events_np/train/cat/a.npz,cat,train",
        "events_np/train/cat/b.npz,cat,train",
    ]
    for row in rows[1:]:
        assert (dest / "spikingjelly" / row.split(",")[0]).is_file()


def test_without_motion_single_pictures_are_passed_over(batch, source, tmp_path):
    pictures(source / "clip", times=True)
    done = batch(source, tmp_path / "to")
    assert list(last_of(tmp_path / "to")) == ["clip"]
    assert "a single picture" in done.err


def test_what_cannot_be(batch, source, tmp_path):
    (tmp_path / "empty").mkdir()
    done = batch(tmp_path / "empty", tmp_path / "to", *MOVED)
    assert (done.status, "holds no picture, before which --motion moves" in done.err) == (1, True)
    done = batch(source, tmp_path / "to", "--extent", "4")
    assert "--extent and --duration are of the path that --motion makes" in done.err
