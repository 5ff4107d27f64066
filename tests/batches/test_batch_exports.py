"""Batches that go on to training sets, and the files beside those of events."""

import json

import numpy as np
import pytest
from trees_of_batch import clip, last_of, lines_of, made_in

from adv2e.exporting import export


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "from"
    clip(root / "a.avi", count=4)
    clip(root / "deep" / "b.avi", count=4, start=2)
    return root


def below(dest, folder):
    return {name: data for name, data in made_in(dest).items() if name.startswith(folder)}


@pytest.mark.parametrize(
    ("words", "how"),
    [
        (
            ("voxel", "--window", "20ms", "--bins", 3),
            {"window_us": 20_000, "bins": 3},
        ),
        (
            ("voxel",),
            {"at": "images"},
        ),
        (("ev-segnet",), {}),
        (
            ("ev-segnet", "--window", "10ms"),
            {"window_us": 10_000},
        ),
    ],
    ids=["windows", "images", "ev-segnet", "10ms"],
)
@pytest.mark.quick_cases(1)
def test_an_export_is_what_the_command_of_its_own_makes(batch, source, tmp_path, words, how):
    dest = tmp_path / "to"
    done = batch(source, dest, "--export", *words)
    assert done.status == 0, done.err
    for name in ("a", "deep/b"):
        folder = f"{name}.{words[0]}"
        alone = tmp_path / "alone" / folder
        alone.parent.mkdir(parents=True, exist_ok=True)
        made = export.export(dest / f"{name}.h5", alone, words[0], **how)
        assert below(dest, folder) == below(tmp_path / "alone", folder) != {}
        assert last_of(dest)[name]["export"]["items"] == made.items > 0
    assert not list(dest.rglob(".*"))


def test_e2vid_gets_lists_of_all(batch, source, tmp_path):
    dest = tmp_path / "to"
    clip(source / "c.avi", count=4, start=1)
    assert batch(source, dest, "--export", "e2vid").status == 0
    train, valid = (
        (dest / f"e2vid-{part}.txt").read_text().splitlines() for part in ("train", "valid")
    )
    files = [dest / f"{name}.e2vid/sequences/{name[-1]}.h5" for name in ("a", "c", "deep/b")]
    assert sorted([*train, *valid]) == sorted(map(str, files))
    assert len(valid) == 1
    assert all(file.exists() for file in files)
    # called again for part of them, the lists are still of all
    (dest / "e2vid-train.txt").unlink()
    assert batch(source, dest, "--export", "e2vid", "--shard", "1/3").status == 0
    assert (dest / "e2vid-train.txt").read_text().splitlines() == train


def test_again_only_the_exports_that_are_missing_are_made(batch, source, tmp_path):
    dest = tmp_path / "to"
    assert batch(source, dest).status == 0
    events = {name: (dest / name).stat().st_mtime_ns for name in ("a.h5", "deep/b.h5")}
    before = last_of(dest)
    call = (source, dest, "--export", "voxel", "--window", "20ms")
    done = batch(*call)
    assert "2 to be exported" in done.err
    first = made_in(dest)
    assert "2 kept" in batch(*call).out
    assert events == {name: (dest / name).stat().st_mtime_ns for name in events}
    after = last_of(dest)
    for name in before:
        added = {key for key in after[name] if after[name][key] != before[name].get(key)}
        assert added == {"export", "at", "why"}
    next((dest / "deep" / "b.voxel").rglob("*.npy")).write_bytes(b"spoiled")
    assert batch(*call, "--dry-run").out == "1 its export changed, 1 kept\n"
    assert "1 its export changed, 1 kept" in batch(*call).err
    assert made_in(dest) == first
    assert "2 an option of the export changed" in batch(*call, "--bins", 7).err
    assert np.load(next((dest / "a.voxel").rglob("*.npy"))).shape[0] == 7
    assert json.loads((dest / "a.voxel" / "export.json").read_text())["bins"] == 7
    assert events == {name: (dest / name).stat().st_mtime_ns for name in events}


def test_an_export_that_fails_is_told_and_the_events_are_kept(batch, source, tmp_path, monkeypatch):
    dest = tmp_path / "to"
    call = (source, dest, "--export", "voxel", "--window", "20ms")

    def fails(*args, **kw):
        raise OSError(28, "No space left on device", "b.voxel")

    with monkeypatch.context() as patch:
        patch.setattr(export, "export", fails)
        done = batch(*call)
        assert done.status == 1
        assert "a: b.voxel: No space left on device" in done.err
        assert done.out.rstrip().endswith("0 kept, 2 failed")
        assert "export" not in last_of(dest)["a"]
        count = len(lines_of(dest))
        assert "2 to be exported" in batch(*call).err
        assert len(lines_of(dest)) == count + 2
    made = {name: data for name, data in made_in(dest).items() if name.endswith(".h5")}
    assert sorted(made) == ["a.h5", "deep/b.h5"]
    done = batch(*call)
    assert (done.status, "2 to be exported" in done.err) == (0, True)
    assert "export_error" not in last_of(dest)["a"]
    assert made.items() <= made_in(dest).items()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--export", "e2vid", "--window", "20ms"), "--window is for --export voxel, "),
        (("--window", "20ms"), "--window is for --export voxel, "),
        (("--export", "ev-segnet", "--bins", 3), "--bins is for --export voxel, "),
        (("--export", "voxel", "--format", "txt"), "--export voxel needs frames, and"),
        (("--export", "voxels"), "'voxels' is not one of"),
    ],
)
def test_options_that_do_not_fit(batch, source, tmp_path, words, said):
    done = batch(source, tmp_path / "to", *words)
    assert done.status == 2
    assert said in done.err
    assert not (tmp_path / "to").exists()


def test_an_export_of_others_is_not_replaced(batch, source, tmp_path):
    folder = tmp_path / "to" / "a.voxel"
    folder.mkdir(parents=True)
    (folder / "mine").write_text("mine")
    done = batch(source, tmp_path / "to", "--export", "voxel")
    assert done.status == 1
    assert "a.voxel: exists and was not made by this batch" in done.err
    assert made_in(tmp_path / "to") == {"a.voxel/mine": b"mine"}


def test_two_that_would_make_one_folder_are_refused(batch, source, tmp_path):
    clip(source / "a.voxel" / "c.avi")
    done = batch(source, tmp_path / "to", "--export", "voxel")
    assert done.status == 1
    assert "a.voxel/c: its folder would lie in that of a" in done.err
    assert not (tmp_path / "to").exists()


@pytest.mark.thorough
def test_files_beside_those_of_events_are_compared_too(batch, source, tmp_path):
    dest = tmp_path / "to"
    call = (source, dest, "--format", "txt", "--causes")
    assert batch(*call).status == 0
    assert sorted(last_of(dest)["a"]["beside"]) == ["a.txt.causes.txt", "a.txt.json"]
    whole = made_in(dest)
    assert "2 kept" in batch(*call).out
    (dest / "a.txt.json").write_text("{}")
    (dest / "deep" / "b.txt.causes.txt").unlink()
    assert "2 a file beside its own changed" in batch(*call).err
    assert made_in(dest) == whole
    assert last_of(dest)["a"]["beside"].keys() == {"a.txt.causes.txt", "a.txt.json"}


def arrays_below(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [("voxel", "--window", "7ms", "--bins", "3"), ("voxel",), ("surface",), ("histogram",)],
    ids=" ".join,
)
def test_without_events_the_windows_are_the_same(batch, source, tmp_path, words):
    kept, alone = tmp_path / "kept", tmp_path / "alone"
    assert batch(source, kept, "--export", *words).status == 0
    call = (source, alone, "--export", *words, "--no-events")
    done = batch(*call)
    assert done.status == 0, done.err
    for name in ("a", "deep/b"):
        made = arrays_below(alone / f"{name}.{words[0]}" / name[-1])
        assert made == arrays_below(kept / f"{name}.{words[0]}" / name[-1])
        assert len(made) > 3
    assert not list(alone.rglob("*.h5"))
    assert not list(alone.rglob(".*"))
    told = json.loads((alone / f"a.{words[0]}" / "export.json").read_text())
    assert told["simulated"]["seed"] == last_of(alone)["a"]["seed"]
    # called again, all is kept; what is changed is made anew
    assert "2 kept" in batch(*call).err
    before = made_in(alone)
    next((alone / f"a.{words[0]}").rglob("*0.npy")).write_bytes(b"spoiled")
    assert "1 its file changed, 1 kept" in batch(*call).err
    assert made_in(alone) == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "--no-events is for --export voxel, histogram, surface and picture"),
        (("--export", "e2vid"), "--no-events is for --export voxel, histogram"),
        (("--export", "voxel", "--causes"), "--no-events keeps no --causes and --with-frames"),
    ],
)
def test_no_events_needs_something_else_to_keep(batch, source, tmp_path, words, said):
    done = batch(source, tmp_path / "to", "--no-events", *words)
    assert (done.status, said in done.err) == (2, True), done.err


def test_a_set_lies_in_one_folder(batch, source, tmp_path):
    dest, alone = tmp_path / "to", tmp_path / "alone"
    clip(source / "cat" / "c.avi", count=4)
    (source / "a.avi").unlink()
    call = (source, dest, "--export", "nmnist")
    assert batch(*call).status == 0
    made = sorted(str(path.relative_to(dest)) for path in (dest / "nmnist").rglob("*.*"))
    assert made[-1] == "nmnist/files.csv"
    export.export(dest, alone, "nmnist")
    for path in (dest / "nmnist").rglob("*.*"):
        assert path.read_bytes() == (alone / path.relative_to(dest / "nmnist")).read_bytes()
    assert "2 kept" in batch(*call).err
    (dest / made[0]).write_bytes(b"")
    assert "1 its export changed, 1 kept" in batch(*call).err
    clip(source / "loose.avi", count=4)
    assert "loose: is in no folder named after its class" in batch(*call).err


def test_sets_for_reconstruction_hold_the_frames(batch, source, tmp_path):
    dest = tmp_path / "to"
    (source / "deep" / "b.avi").rename(source / "deep" / "b.v1.avi")
    for _ in range(2):
        assert batch(source, dest, "--export", "evreal", "--overwrite").status == 0
    assert np.load(dest / "evreal" / "deep_b.v1" / "images.npy").shape == (4, 24, 32, 1)
    assert not list(dest.rglob(".*"))
