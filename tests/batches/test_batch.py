"""Whole batches: what is made, kept, changed, refused, and shared among shards."""

import os

import pytest
import trees_of_batch as trees
from trees_of_batch import clip, last_of, lines_of, made_in

from adv2e.batches.plan import seed_of
from adv2e.formats.reading import read_events


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    root = tmp_path_factory.mktemp("source")
    clip(root / "a.avi")
    clip(root / "deep" / "b.avi", start=2)
    trees.gopro(root)
    return root


NAMES = ["GOPR0384_11_00", "a", "deep/b"]


@pytest.fixture
def undisturbed(batch, source, tmp_path):
    """What one batch makes, in one go."""
    assert batch(source, tmp_path / "undisturbed", "--seed", 5).status == 0
    return made_in(tmp_path / "undisturbed")


def test_the_tree_is_mirrored_and_each_has_its_seed(batch, source, tmp_path):
    dest = tmp_path / "to"
    done = batch(source, dest, "--seed", 5)
    assert done.out.startswith("3 sequences: 3 made (")
    assert done.out.rstrip().endswith("0 kept, 0 failed")
    assert sorted(made_in(dest)) == [f"{name}.h5" for name in NAMES]
    for name in NAMES:
        record = last_of(dest)[name]
        assert record["seed"] == seed_of(5, name)
        assert record["status"] == "done"
        found = read_events(dest / record["output"])
        assert found.metadata["seed"] == record["seed"]
        assert found.events.size == record["events"]


def test_again_it_keeps_what_is_there_and_makes_what_changed(batch, source, tmp_path):
    root, dest = tmp_path / "from", tmp_path / "to"
    clip(root / "a.avi")
    clip(root / "b.avi", start=2)
    call = (root, dest)
    assert batch(*call).status == 0
    count = len(lines_of(dest))
    done = batch(*call)
    assert (done.status, done.out) == (
        0,
        "2 sequences: 0 made (0 events), 2 kept, 0 failed\n",
    )
    assert len(lines_of(dest)) == count
    # touched only
    os.utime(root / "a.avi")
    assert "2 kept" in batch(*call).out
    clip(root / "a.avi", start=4)
    assert "1 its source changed, 1 kept" in batch(*call).err
    (dest / "b.h5").unlink()
    assert "1 its file is gone, 1 kept" in batch(*call).err
    (dest / "b.h5").write_bytes(b"spoiled")
    assert "1 its file changed, 1 kept" in batch(*call).err
    changed = batch(*call, "--set", "pixel.refractory=null")
    assert "2 the configuration or an option changed" in changed.err
    assert "2 the seed changed" in batch(*call, "--set", "pixel.leak=null", "--seed", 3).err
    clip(root / "c.avi")
    planned = batch(*call, "--set", "pixel.leak=null", "--seed", 3, "--dry-run")
    assert planned.out == "1 new, 2 kept\n"
    assert not (dest / "c.h5").exists()


def test_a_bad_sequence_does_not_stop_the_others(batch, tmp_path):
    root, dest = tmp_path / "from", tmp_path / "to"
    clip(root / "a.avi")
    clip(root / "c.avi")
    (root / "b.avi").write_bytes(b"no video")
    done = batch(root, dest)
    assert done.status == 1
    assert done.out.startswith("3 sequences: 2 made (")
    told = done.err.splitlines()
    assert any(line.startswith("  b  ") and "b.avi" in line for line in told)
    assert sorted(made_in(dest)) == ["a.h5", "c.h5"]
    assert last_of(dest)["b"]["status"] == "failed"
    clip(root / "b.avi")
    assert "1 it failed, 2 kept" in batch(root, dest).err


def test_shards_together_are_the_whole(batch, source, undisturbed, tmp_path):
    dest = tmp_path / "to"
    for number in (1, 2):
        done = batch(source, dest, "--seed", 5, "--shard", f"{number}/2")
        assert done.status == 0, done.err
    assert made_in(dest) == undisturbed
    done = batch(source, dest, "--seed", 5)
    assert "0 made (0 events), 3 kept" in done.out


def test_a_file_of_others_is_not_replaced(batch, source, tmp_path):
    dest = tmp_path / "to"
    dest.mkdir()
    (dest / "a.h5").write_bytes(b"mine")
    done = batch(source, dest)
    assert done.status == 1
    assert "a.h5: exists and was not made by this batch" in done.err
    assert made_in(dest) == {"a.h5": b"mine"}
    assert lines_of(dest) == []
    assert batch(source, dest, "--overwrite").status == 0
    assert made_in(dest)["a.h5"] != b"mine"


def test_wrong_settings_are_told_before_anything_is_written(batch, source, tmp_path):
    dest = tmp_path / "to"
    done = batch(source, dest, "--set", "pixel.leek=null")
    assert done.status == 2
    assert "did you mean" in done.err or "pixel.leak" in done.err
    done = batch(source, dest, "--shard", "3/2")
    assert done.status == 2
    done = batch(source, dest, "--with-frames", "--format", "evt3")
    assert done.status == 2
    assert "holds events alone; frames go to" in done.err
    assert not dest.exists()


ON = "pixel.thresholds.on"
RANDOM = (
    *("--set", f"{ON}={{uniform: [0.1, 0.5]}}"),
    *("--set", f"pixel.thresholds.off={{same_as: {ON}, times: {{normal: [1, 0.1]}}}}"),
)


def test_each_sequence_has_numbers_of_its_own(batch, source, tmp_path):
    dest = tmp_path / "to"
    assert batch(source, dest, "--seed", 5, *RANDOM).status == 0
    records = last_of(dest)
    for name in NAMES:
        drawn = records[name]["drawn"]
        thresholds = read_events(dest / f"{name}.h5").metadata["config"]["pixel"]["thresholds"]
        assert sorted(drawn) == ["pixel.thresholds.off", ON]
        assert (drawn[ON], drawn["pixel.thresholds.off"]) == (thresholds["on"], thresholds["off"])
        assert 0.1 < drawn[ON] < 0.5
    assert len({records[name]["drawn"][ON] for name in NAMES}) == 3
    assert len({records[name]["settings"] for name in NAMES}) == 1
    # in shards, in another order
    again = tmp_path / "again"
    for number in (2, 1):
        done = batch(source, again, "--seed", 5, *RANDOM[2:], *RANDOM[:2], "--shard", f"{number}/2")
        assert done.status == 0
    assert made_in(again) == made_in(dest)
    assert "0 made (0 events), 3 kept" in batch(source, dest, "--seed", 5, *RANDOM).out
    narrow = ("--set", f"{ON}={{uniform: [0.1, 0.4]}}")
    planned = batch(source, dest, "--seed", 5, *RANDOM, *narrow, "--dry-run")
    assert planned.out.startswith("3 the configuration or an option changed\n")


def test_what_cannot_be_drawn_is_told_before_anything_is_written(batch, source, tmp_path):
    dest = tmp_path / "to"
    done = batch(source, dest, "--set", f"{ON}={{uniform: [0.5, 0.1]}}")
    assert done.status == 2
    assert "pixel.thresholds.on.uniform: must be [a, b] with a below b" in done.err
    # below 1 there is no knee of a logarithm, as only the drawn number tells
    linear = "--set", "pixel.log_response.linear_below={uniform: [0.99, 1.03]}"
    done = batch(source, dest, *linear, "--seed", 2)
    assert done.status == 2
    assert "deep/b: --set pixel.log_response.linear_below: must be 0 (pure" in done.err
    assert not dest.exists()


def test_folders_that_would_lie_in_each_other_are_refused(batch, tmp_path):
    root, dest = tmp_path / "from", tmp_path / "to"
    clip(root / "a.avi")
    clip(root / "a" / "b.avi")
    done = batch(root, dest, "--format", "folder")
    assert done.status == 1
    assert "a/b: its folder would lie in that of a" in done.err
    assert not dest.exists()


def test_folders_of_pictures_are_converted_and_what_is_passed_over_is_told(batch, tmp_path):
    source, dest = tmp_path / "from", tmp_path / "to"
    trees.pictures(source / "walk")
    clip(source / "a.avi")
    for options, made, passed in (([], "1 made", ", 1 passed over"), (["--fps", 10], "2 made", "")):
        shown = batch(source, dest, *options, "--dry-run")
        done = batch(source, dest, *options)
        assert made in done.out
        assert done.out.rstrip().endswith(f"0 failed{passed}")
        for outcome in (shown, done):
            assert ("walk: pictures without times" in outcome.err) is bool(passed)
    assert sorted(made_in(dest)) == ["a.h5", "walk.h5"]
    assert read_events(dest / "walk.h5").frame_times_ns is None


def test_addresses_are_refused(batch, source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for pair in [("s3://bucket/videos", "to"), (source, "s3://bucket/events")]:
        done = batch(*pair)
        assert done.status == 2
        assert "s3://bucket/" in done.err
        assert "mount it as a folder" in done.err
    assert not list(tmp_path.iterdir())
