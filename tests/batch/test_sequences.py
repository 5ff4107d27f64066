"""Which files and folders are sequences, and what they are called."""

import os

import pytest
import trees_of_batch as trees

from adv2e.batch import sequences as module
from adv2e.batch.sequences import LAYOUTS, find_sequences
from adv2e.cli import batch as command
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
    return [one.name for one in find_sequences(root, layout, **options)]


def test_layouts_are_those_of_the_command():
    assert command.LAYOUTS == LAYOUTS


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
    found = find_sequences(tree, "gopro")
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
    assert module.LAYOUTS[0] == "auto"
