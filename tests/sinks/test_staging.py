import os
import stat
from pathlib import Path

import pytest

from adv2e.errors import OutputError
from adv2e.sinks.staging import Staging


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


def nothing_foreign(folder):
    return None


def staged(path, overwrite=False):
    staging = Staging(overwrite)
    temporary = staging.file(path)
    staging.prepare()
    temporary.write_text("new")
    return staging


def test_final_name_appears_only_on_commit(tmp_path):
    staging = staged(tmp_path / "out.txt")
    assert not (tmp_path / "out.txt").exists()

    staging.commit()

    assert names(tmp_path) == ["out.txt"]
    assert (tmp_path / "out.txt").read_text() == "new"


def test_discard_leaves_nothing(tmp_path):
    staged(tmp_path / "out.txt").discard()

    assert names(tmp_path) == []


def test_missing_folders_are_made_and_removed_again(tmp_path):
    staging = staged(tmp_path / "a" / "b" / "out.txt")
    assert (tmp_path / "a" / "b").is_dir()

    staging.discard()

    assert names(tmp_path) == []


def test_folders_made_stay_when_something_else_lies_in_them(tmp_path):
    staging = staged(tmp_path / "a" / "out.txt")
    (tmp_path / "a" / "other").write_text("mine")

    staging.discard()

    assert names(tmp_path / "a") == ["other"]


def test_existing_output_is_refused_before_anything_is_written(tmp_path):
    (tmp_path / "out.txt").write_text("old")

    with pytest.raises(OutputError, match=r"out\.txt: exists already; --overwrite replaces it"):
        Staging(overwrite=False).file(tmp_path / "out.txt")
    assert names(tmp_path) == ["out.txt"]


def test_overwriting_replaces_at_the_end_only(tmp_path):
    (tmp_path / "out.txt").write_text("old")
    staging = staged(tmp_path / "out.txt", overwrite=True)
    assert (tmp_path / "out.txt").read_text() == "old"

    staging.commit()

    assert names(tmp_path) == ["out.txt"]
    assert (tmp_path / "out.txt").read_text() == "new"


def test_discard_keeps_what_was_to_be_replaced(tmp_path):
    (tmp_path / "out.txt").write_text("old")

    staged(tmp_path / "out.txt", overwrite=True).discard()

    assert names(tmp_path) == ["out.txt"]
    assert (tmp_path / "out.txt").read_text() == "old"


def test_output_that_appeared_meanwhile_is_kept(tmp_path):
    staging = staged(tmp_path / "out.txt")
    (tmp_path / "out.txt").write_text("someone else's")

    with pytest.raises(OutputError, match="exists already"):
        staging.commit()
    staging.discard()

    assert names(tmp_path) == ["out.txt"]
    assert (tmp_path / "out.txt").read_text() == "someone else's"


def test_two_files_come_into_place_together_or_not_at_all(tmp_path):
    (tmp_path / "a").write_text("old a")
    (tmp_path / "b").write_text("old b")
    staging = Staging(overwrite=True)
    first, second = staging.file(tmp_path / "a"), staging.file(tmp_path / "b")
    staging.prepare()
    first.write_text("new a")  # the second is never written: its rename fails
    assert not second.exists()

    with pytest.raises(FileNotFoundError):
        staging.commit()
    staging.discard()

    assert names(tmp_path) == ["a", "b"]
    assert (tmp_path / "a").read_text() == "old a"
    assert (tmp_path / "b").read_text() == "old b"


def test_folder_is_swapped_as_a_whole(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_text("old")
    staging = Staging(overwrite=True)
    folder = staging.folder(tmp_path / "out", nothing_foreign)
    staging.prepare()
    folder.mkdir()
    (folder / "new").write_text("new")
    assert names(tmp_path / "out") == ["old"]

    staging.commit()

    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["new"]


def test_unfinished_folder_is_removed(tmp_path):
    staging = Staging(overwrite=False)
    folder = staging.folder(tmp_path / "out", nothing_foreign)
    staging.prepare()
    (folder / "images").mkdir(parents=True)
    (folder / "images" / "x.png").write_text("x")

    staging.discard()

    assert names(tmp_path) == []


def test_folder_with_other_content_is_not_replaced(tmp_path):
    (tmp_path / "out").mkdir()

    with pytest.raises(OutputError, match=r"out: holds thesis\.tex"):
        Staging(overwrite=True).folder(tmp_path / "out", lambda folder: "thesis.tex")


def test_a_folder_is_no_place_for_a_file(tmp_path):
    (tmp_path / "out.txt").mkdir()

    with pytest.raises(OutputError, match=r"out\.txt: is a folder"):
        Staging(overwrite=True).file(tmp_path / "out.txt")


def test_a_file_is_no_place_for_a_folder(tmp_path):
    (tmp_path / "out").write_text("file")

    with pytest.raises(OutputError, match="out: is a file"):
        Staging(overwrite=True).folder(tmp_path / "out", nothing_foreign)


def test_the_root_folder_is_no_output():
    with pytest.raises(OutputError, match="/: cannot be replaced"):
        Staging(overwrite=True).folder(Path("/"), nothing_foreign)


def test_nothing_lies_below_a_file(tmp_path):
    (tmp_path / "file").write_text("file")

    with pytest.raises(OutputError, match=r"out\.txt: .*file is not a folder"):
        Staging(overwrite=False).file(tmp_path / "file" / "sub" / "out.txt")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_special_files_are_never_replaced(tmp_path):
    os.mkfifo(tmp_path / "out.txt")

    with pytest.raises(OutputError, match="not a regular file"):
        Staging(overwrite=True).file(tmp_path / "out.txt")


@pytest.mark.skipif(os.name == "nt", reason="needs symbolic links")
def test_a_symbolic_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "data.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "data.txt")

    staged(tmp_path / "link.txt", overwrite=True).commit()

    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real" / "data.txt").read_text() == "new"
    assert names(tmp_path / "real") == ["data.txt"]


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX permissions")
def test_files_have_usual_permissions(tmp_path):
    before = os.umask(0o022)
    try:
        staged(tmp_path / "out.txt").commit()
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "out.txt").stat().st_mode) == 0o644


def test_long_names_fit(tmp_path):
    name = "n" * 240 + ".txt"

    staged(tmp_path / name).commit()

    assert names(tmp_path) == [name]


def test_interrupt_between_renames_restores_everything(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("old")
    staging = Staging(overwrite=True)
    staging.file(tmp_path / "a").write_text("new")
    rename = type(tmp_path).rename
    calls = []

    def interrupted(path, target):
        calls.append(path)
        result = rename(path, target)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return result

    monkeypatch.setattr(type(tmp_path), "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        staging.commit()
    staging.discard()

    assert names(tmp_path) == ["a"]
    assert (tmp_path / "a").read_text() == "old"
