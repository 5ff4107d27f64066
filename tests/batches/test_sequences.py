"""Which files and folders are sequences, and what they are called."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import trees_of_batch as trees

from adv2e.batches.sequences import find_sequences
from adv2e.errors import DataError


@pytest.fixture
def tree(tmp_path):
    root = tmp_path / "all"
    for name in ("videos/b.avi", "videos/a.avi", "videos/deep/a.mp4", "videos/frame10.avi"):
        trees.clip(root / "videos" / name.removeprefix("videos/"))
    trees.clip(root / "videos" / "frame9.avi")
    trees.gopro(root / "GOPRO_Large" / "train")
    trees.davis240c(root / "davis" / "urban")
    (root / "notes.txt").write_text("no events\n")
    (root / "videos" / ".hidden.avi").write_bytes(b"")
    (root / ".git").mkdir()
    trees.clip(root / ".git" / "c.avi")
    return root


def names(root, layout="auto", **options):
    return [one.name for one in find_sequences(root, layout, **options).sequences]


def test_auto_takes_all_in_natural_order(tree):
    assert names(tree) == [
        "GOPRO_Large/train/GOPR0384_11_00",
        "davis/urban",
        "videos/a",
        "videos/b",
        "videos/deep/a",
        "videos/frame9",
        "videos/frame10",
    ]


def test_each_layout_takes_its_own(tree):
    assert names(tree, "gopro") == ["GOPRO_Large/train/GOPR0384_11_00"]
    assert names(tree, "davis240c") == ["davis/urban"]
    assert len(names(tree, "videos")) == 5
    with pytest.raises(DataError, match="holds no sequence of the layout ddd17"):
        names(tree, "ddd17")


def test_of_gopro_the_folder_of_the_sequence_is_taken_once(tree):
    found = find_sequences(tree, "gopro").sequences
    assert [one.source for one in found] == [tree / "GOPRO_Large/train/GOPR0384_11_00"]


def test_two_that_would_be_called_the_same_keep_their_suffixes(tmp_path):
    for name in ("a.avi", "a.mkv", "B.avi", "b.avi"):
        trees.clip(tmp_path / name)
    assert sorted(names(tmp_path)) == ["B.avi", "a.avi", "a.mkv", "b.avi"]


def test_a_single_file_or_sequence_is_one(tree):
    assert names(tree / "videos" / "a.avi") == ["a"]
    assert names(tree / "davis" / "urban") == ["urban"]


def test_results_and_links_to_folders_are_not_looked_into(tree):
    (tree / "videos" / "again").symlink_to(tree / "videos", target_is_directory=True)
    results = tree / "videos" / "deep"
    assert "videos/deep/a" not in names(tree, leave_out=results)
    assert len(names(tree)) == 7


def test_what_is_not_there_or_holds_nothing_is_told(tmp_path):
    with pytest.raises(DataError, match="no such file or folder"):
        names(tmp_path / "none")
    (tmp_path / "a.txt").write_text("0.1 2 3 1\n")
    with pytest.raises(DataError, match="holds no video, and no recording"):
        names(tmp_path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read all folders")
def test_a_folder_that_cannot_be_read_is_told(tree):
    (tree / "davis").chmod(0)
    try:
        with pytest.raises(DataError, match=r"davis: Permission denied"):
            names(tree)
    finally:
        (tree / "davis").chmod(0o755)


def test_a_recording_that_is_none_is_left_out(tmp_path):
    trees.clip(tmp_path / "a.avi")
    (tmp_path / "b.aedat4").write_bytes(b"no such thing")
    assert names(tmp_path) == ["a"]


def test_folders_of_pictures_count_where_their_times_are_known(tmp_path):
    trees.pictures(tmp_path / "walk")
    trees.pictures(tmp_path / "timed", times=True)
    trees.pictures(tmp_path / "walk" / "masks")
    assert names(tmp_path) == ["timed"]
    assert names(tmp_path, fps=10) == ["timed", "walk", "walk/masks"]
    assert names(tmp_path, "images", fps=10) == ["timed", "walk", "walk/masks"]
    assert names(tmp_path / "walk" / "masks", fps=10) == ["masks"]
    assert {one.layout for one in find_sequences(tmp_path, fps=10).sequences} == {"images"}


def test_stacks_count_where_their_times_are_known(tmp_path):
    trees.stack(tmp_path / "a.npy")
    trees.stack(tmp_path / "b.npy")
    np.save(tmp_path / "b_ts.npy", np.arange(3) * 0.1)
    cv2.imwritemulti(str(tmp_path / "c.tif"), [np.full((24, 32), k, np.uint8) for k in range(3)])
    assert names(tmp_path) == ["b"]
    assert names(tmp_path, fps=10) == ["a", "b", "c"]


def test_what_is_passed_over_is_listed_with_the_reason(tmp_path):
    trees.clip(tmp_path / "a.avi")
    trees.pictures(tmp_path)
    trees.pictures(tmp_path / "walk")
    trees.pictures(tmp_path / "run")
    trees.pictures(tmp_path / "single", count=1)
    trees.stack(tmp_path / "s.npy")
    np.save(tmp_path / "labels.npy", np.zeros(5))
    (tmp_path / "b.aedat4").write_bytes(b"no such thing")
    (tmp_path / "readme.txt").write_text("nothing\n")
    found = find_sequences(tmp_path)
    assert [one.name for one in found.sequences] == ["a"]
    reasons = {path.name: why for why, paths in found.passed.items() for path in paths}
    assert set(reasons) == {
        *("walk", "run", "single", "s.npy", "labels.npy", "b.aedat4", tmp_path.name)
    }
    assert "give --fps" in reasons["walk"]
    assert "give --fps" in reasons["s.npy"]
    assert reasons[tmp_path.name] == "pictures beside sequences"
    assert reasons["single"] == "a single picture"
    assert "array of shape (5,)" in reasons["labels.npy"]
    assert any("run and 1 more: pictures without times" in line for line in found.told())


def test_a_list_of_something_else_does_not_make_a_folder_a_sequence(tmp_path):
    trees.clip(tmp_path / "a.avi")
    (tmp_path / "info.txt").write_text("of this data set\n")
    assert names(tmp_path) == ["a"]


def test_pictures_with_a_list_beside_them_are_pictures_as_for_convert(tmp_path):
    trees.pictures(tmp_path / "walk")
    shown = sorted(path.name for path in (tmp_path / "walk").iterdir())
    lines = "".join(f"{0.01 * k:.2f} {name}\n" for k, name in enumerate(shown))
    (tmp_path / "walk" / "images.txt").write_text(lines)
    assert names(tmp_path, "images") == ["walk"]
    assert names(tmp_path) == ["walk"]
    (tmp_path / "walk" / "events.txt").write_text("0.001 1 1 1\n")
    assert names(tmp_path, "davis240c") == ["walk"]


def test_what_another_layout_would_take_is_told(tree):
    told = find_sequences(tree, "gopro").told()
    assert any("4 more: --layout videos takes that" in line for line in told)


def test_where_nothing_counts_what_was_passed_over_is_told(tmp_path):
    trees.pictures(tmp_path / "walk")
    with pytest.raises(DataError, match=r"passed over: .*walk: pictures without times: give --fps"):
        names(tmp_path)


def test_the_current_folder_has_its_name(tmp_path, monkeypatch):
    trees.pictures(tmp_path / "walk")
    monkeypatch.chdir(tmp_path / "walk")
    for here in (Path(), Path("../walk")):
        assert names(here, fps=10) == ["walk"]


def test_pictures_of_kinds_that_are_not_read_are_told(tmp_path):
    trees.clip(tmp_path / "a.avi")
    (tmp_path / "phone").mkdir()
    (tmp_path / "phone" / "1.heic").touch()
    assert "pictures of a kind that is not read" in find_sequences(tmp_path).passed
