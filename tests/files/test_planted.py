"""Hidden folders that an archive from elsewhere may hold: nothing in them is obeyed."""

import json
import os
import subprocess
import warnings

import pytest

from adv2e.errors import Adv2eWarning
from adv2e.files.staging import Staging

POSIX = pytest.mark.skipif(os.name == "nt", reason="needs links and pipes")


@pytest.fixture
def data(tmp_path):
    """A folder from elsewhere, beside one of the user's own with two files."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "keys").write_text("mine")
    (home / "folder").mkdir()
    (home / "folder" / "thesis.tex").write_text("mine")
    folder = tmp_path / "data"
    folder.mkdir()
    yield folder
    assert (home / "keys").read_text() == "mine"
    assert (home / "folder" / "thesis.tex").read_text() == "mine"
    assert sorted(one.name for one in home.iterdir()) == ["folder", "keys"]


def written(folder):
    """Write a file there; return what was warned of."""
    with warnings.catch_warnings(record=True) as told, Staging(overwrite=False) as staging:
        warnings.simplefilter("always")
        file = staging.file(folder / "e.txt")
        staging.prepare()
        file.write_text("new")
    assert (folder / "e.txt").read_text() == "new"
    assert all(one.category is Adv2eWarning for one in told)
    assert all("\n" not in str(one.message) for one in told)
    return [str(one.message) for one in told]


def planted(data, lock=b""):
    folder = data / ".adv2e.deadbeef.part"
    folder.mkdir()
    if lock is not None:
        (folder / "lock").write_bytes(lock)
    return folder


def outputs(*names):
    return json.dumps({"first": ["/nowhere", 0, 0], "outputs": [names]})


@pytest.mark.parametrize(
    "journal",
    [
        outputs("x", "../../home/keys", "readme.txt"),
        outputs("x", "{home}/keys", "readme.txt"),
        outputs("x", "old1", ".bashrc"),
        outputs("x", "lock", "../../x"),
        outputs("lock", "lock", ".."),
        outputs("lock", "lock", "a\0b"),
        *("[]", "null", "7", '{"first": 3}', "[" * 10_000, "\ud800", "{}" * 1_000_000, ""),
    ],
)
def test_a_journal_as_earlier_versions_wrote_it_is_left_alone(data, journal):
    folder = planted(data)
    text = journal.replace("{home}", str(data.parent / "home"))
    (folder / "journal.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    (folder / "old1").write_text("planted")
    before = sorted(data.rglob("*"))
    (told,) = written(data)
    assert told.startswith(f"{folder}: left alone, as it holds ")
    assert sorted(data.rglob("*")) == sorted([*before, data / "e.txt"])


@POSIX
@pytest.mark.parametrize("kind", ["pipe", "zeros", "link", "folder", "dangling"])
def test_a_lock_that_is_no_file_is_not_opened(data, kind):
    folder = planted(data, lock=None)
    lock = folder / "lock"
    if kind == "pipe":
        os.mkfifo(lock)
    elif kind == "folder":
        lock.mkdir()
    else:
        where = {"zeros": "/dev/zero", "link": data.parent / "home" / "keys"}
        lock.symlink_to(where.get(kind, "nowhere"))
    (folder / "new0.txt").write_text("planted")
    (told,) = written(data)
    assert "holds a lock that is no file" in told
    assert (folder / "new0.txt").exists()


def test_of_a_long_lock_little_is_read(data):
    folder = planted(data, b"x\n" * 10_000_000)
    assert written(data) == []
    assert folder.exists()


@POSIX
def test_links_go_and_what_they_lead_to_stays(data):
    home = data.parent / "home"
    folder = planted(data)
    (folder / "new0").symlink_to(home / "folder")
    (folder / "new1.txt").symlink_to(home / "keys")
    os.link(home / "keys", folder / "new2.txt")
    (folder / "new3").mkdir()
    (folder / "new3" / "deep").symlink_to(home)
    assert written(data) == []
    assert not folder.exists()


@POSIX
def test_a_link_is_no_folder_of_a_run(data):
    home = data.parent / "home"
    (home / "lock").touch()
    (data / ".adv2e.deadbeef.part").symlink_to(home)
    assert written(data) == []
    (home / "lock").unlink()


@pytest.mark.parametrize("name", ["thesis.tex", "new", "newer", "old0", "new0é", "lock2"])
def test_what_no_run_writes_is_left_with_all_beside_it(data, name):
    folder = planted(data)
    (folder / name).write_text("mine")
    (folder / "new0.h5").write_text("left")
    (told,) = written(data)
    assert told == (
        f"{folder}: left alone, as it holds {name}, which no run writes: remove it if nobody needs"
        " it"
    )
    assert len(list(folder.iterdir())) == 3


@POSIX
def test_folders_in_one_another_beyond_all_measure_stay(data):
    folder = planted(data)
    deep = os.open(folder, os.O_RDONLY)
    for _ in range(3000):
        os.mkdir("new0", dir_fd=deep)
        below = os.open("new0", os.O_RDONLY, dir_fd=deep)
        os.close(deep)
        deep = below
    os.close(deep)
    try:
        assert len(written(data)) <= 1  # later versions of Python remove them
        assert (data / "e.txt").exists()
    finally:  # pytest would fail to, when it removes the files of an old run
        subprocess.run(["rm", "-rf", folder], check=True)
