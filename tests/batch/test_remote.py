"""Batches whose SOURCE or DEST is a URL: fetched, converted here, put there whole or not at all."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import trees_of_batch as trees
from trees_of_batch import clip, made_in

from adv2e.batch import remote, transfer
from adv2e.batch.sequences import find_sequences
from adv2e.batch.transfer import files_below, open_url
from adv2e.errors import DataError

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def store():
    """A file system in memory, empty again afterwards."""
    system = fsspec.filesystem("memory")
    yield system
    system.rm("/", recursive=True)


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "source"
    clip(root / "a.avi")
    clip(root / "deep" / "b.avi", start=2)
    trees.gopro(root)
    trees.davis240c(root / "camera")
    return root


NAMES = ["GOPR0384_11_00", "a", "camera", "deep/b"]


def upload(store, folder, target):
    for file in folder.rglob("*"):
        if file.is_file():
            store.pipe_file(f"{target}/{file.relative_to(folder).as_posix()}", file.read_bytes())


def made_there(store, folder):
    """Return the bytes of all files but the manifests, by their names."""
    return {
        name[len(folder) + 1 :]: store.cat_file(name)
        for name in sorted(store.find(folder))
        if not name.rpartition("/")[2].startswith("manifest")
    }


def last_there(store, folder):
    lines = store.cat_file(f"{folder}/manifest.jsonl").decode("ascii").splitlines()
    return {one["name"]: one for one in map(json.loads, lines)}


URLS = ("memory://from", "memory://to")


@pytest.mark.parametrize("format", ["h5", "txt", "folder"])
@pytest.mark.quick_cases(1)
def test_the_bytes_are_those_of_a_local_batch_and_they_are_kept(
    batch, store, source, tmp_path, format
):
    upload(store, source, "/from")
    done = batch(*URLS, "--format", format)
    assert done.status == 0, done.err
    assert done.out.startswith("4 sequences: 4 made (")
    assert batch(source, tmp_path / "to", "--format", format).status == 0
    assert made_there(store, "/to") == made_in(tmp_path / "to")
    assert sorted(last_there(store, "/to")) == NAMES
    again = batch(*URLS, "--format", format)
    assert again.out == "4 sequences: 0 made (0 events), 4 kept, 0 failed\n"


def test_what_changed_there_is_made_again(batch, store, source):
    upload(store, source, "/from")
    assert batch(*URLS).status == 0
    whole = made_there(store, "/to")
    store.pipe_file("/to/a.h5", b"spoiled")
    store.rm("/to/camera.h5")
    store.pipe_file("/from/deep/b.avi", (source / "a.avi").read_bytes())
    planned = batch(*URLS, "--dry-run")
    told = {"1 its file changed", "1 its file is gone", "1 its source changed", "1 kept"}
    assert set(planned.out.strip().split(", ")) == told
    assert batch(*URLS).status == 0
    now = made_there(store, "/to")
    assert {name for name in now if now[name] != whole[name]} == {"deep/b.h5"}
    assert "4 kept" in batch(*URLS).out


def test_a_sequence_that_fails_names_its_url(batch, store, source):
    store.pipe_file("/from/bad.avi", b"no video")
    store.pipe_file("/from/a.avi", (source / "a.avi").read_bytes())
    done = batch(*URLS)
    assert done.status == 1
    assert "memory://from/bad.avi" in last_there(store, "/to")["bad"]["error"]
    assert sorted(made_there(store, "/to")) == ["a.h5"]


def test_a_file_of_others_is_not_replaced(batch, store, source):
    store.pipe_file("/to/a.h5", b"mine")
    done = batch(source, "memory://to")
    assert done.status == 1
    assert "a.h5: exists and was not made by this batch" in done.err
    assert made_there(store, "/to") == {"a.h5": b"mine"}


def test_what_a_store_says_is_one_line_that_names_the_url(batch, store, source, monkeypatch):
    def refuse(*_, **__):
        raise RuntimeError("no\ncredentials")

    with monkeypatch.context() as patch:
        patch.setattr(type(store), "find", refuse)
        done = batch(source, "memory://to")
    assert done.status == 1
    assert done.err.endswith("error: memory://to: RuntimeError: no credentials\n")


def test_a_url_and_a_folder_go_together(batch, store, source, tmp_path):
    assert batch(source, "memory://to").status == 0
    upload(store, source, "/from")
    assert batch("memory://from", tmp_path / "to").status == 0
    assert made_there(store, "/to") == made_in(tmp_path / "to")


def test_a_file_that_is_not_whole_has_no_name_yet(batch, source, tmp_path, monkeypatch):
    (target := tmp_path / "there").mkdir()
    system, _ = open_url(f"file://{target}")
    whole = type(system).put_file

    def half(self, here, there, **rest):
        if ".h5" in there:
            Path(there).write_bytes(Path(here).read_bytes()[:1000])
            raise OSError(28, "No space left on device", there)
        whole(self, here, there, **rest)

    with monkeypatch.context() as patch:
        patch.setattr(type(system), "put_file", half)
        done = batch(source, f"file://{target}")
    assert done.status == 1
    assert "No space left on device" in done.err
    assert not [*target.rglob("*.h5")]
    done = batch(source, f"file://{target}")
    assert done.status == 0, done.err
    assert "4 it failed" in done.err
    assert not [*target.rglob(".*")]
    assert batch(source, tmp_path / "to").status == 0
    assert made_in(target) == made_in(tmp_path / "to")


def test_the_manifest_is_there_while_the_batch_runs(batch, store, source, monkeypatch):
    upload(store, source, "/from")
    seen = []
    whole = remote.put

    def put(system, here, there):
        seen.append(here.read_text("ascii").count("\n"))
        whole(system, here, there)

    monkeypatch.setattr(remote, "put", put)
    monkeypatch.setattr(remote, "COPY_S", 0.0)
    assert batch(*URLS).status == 0
    assert seen == [4, 5, 6, 7, 8, 8]


def test_temporary_folders_are_removed(batch, store, source, tmp_path, monkeypatch):
    (here := tmp_path / "temporary").mkdir()
    monkeypatch.setattr(transfer.tempfile, "tempdir", str(here))
    upload(store, source, "/from")
    assert batch(*URLS).status == 0
    assert not [*here.iterdir()]


def test_what_a_killed_process_left_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(transfer.tempfile, "tempdir", str(tmp_path))
    script = (
        "import os; from adv2e.batch.transfer import Scratch\n"
        "with Scratch() as folder: (folder / 'source').mkdir(); os._exit(1)"
    )
    subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, "TMPDIR": str(tmp_path)}, check=False
    )
    assert len([*tmp_path.iterdir()]) == 1
    with transfer.Scratch() as folder:
        assert [*tmp_path.iterdir()] == [folder.parent]
    assert not [*tmp_path.iterdir()]


def test_recordings_are_told_by_the_layout_where_they_cannot_be_read(tmp_path):
    for name in ("a.hdf5", "b.zip", "c.mp4"):
        (tmp_path / name).write_bytes(bytes(10))

    def names(layout):
        return [one.name for one in find_sequences(tmp_path, layout, by_name=True).sequences]

    assert names("ddd17") == ["a"]
    assert names("davis240c") == ["b"]
    assert names("auto") == ["c"]


@pytest.mark.parametrize(
    "name", ["bucket/../out", "bucket/deep/../../out", "bucket/./x", "/etc/out", "bucketed/x"]
)
def test_names_that_lead_out_are_refused(name):
    class Store:
        def invalidate_cache(self):
            pass

        def find(self, path, detail):
            return {name: {"size": 1}}

    with pytest.raises(DataError, match="must not lead out of their folder"):
        files_below(Store(), "bucket")


def test_urls_that_cannot_be_opened(batch, store, source, monkeypatch):
    done = batch("nonesuch://a", "memory://to")
    assert done.status == 2
    assert "nonesuch://a: Protocol not known: nonesuch" in done.err
    done = batch("memory://nowhere", "memory://to")
    assert done.status == 1
    assert "memory://nowhere: no such file or folder" in done.err
    done = batch(source, "memory://to", "--export", "voxel", "--window", "20ms")
    assert done.status == 2
    assert "DEST must be a folder" in done.err
    monkeypatch.setattr(transfer, "find_spec", lambda name: None)
    done = batch(source, "memory://to")
    assert done.status == 1
    assert "pip install 'adv2e[remote]'" in done.err
    assert not store.exists("/to")
