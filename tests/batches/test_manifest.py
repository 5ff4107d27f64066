"""A manifest keeps every line that it was given, whatever happens to the last."""

import json
import multiprocessing
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.batches.manifest import Manifest, check_alone, manifest_path, read_records
from adv2e.errors import DataError, OutputError


def done(name, **more):
    told = dict.fromkeys(("adv2e", "settings", "source_sha256", "sha256"), "")
    return {
        **{"name": name, "status": "done", "output": f"{name}.h5", "source": {}, "seed": 0},
        **{**told, **more},
    }


def plain(records):
    return [{key: value for key, value in one.items() if key != "at"} for one in records]


def test_lines_stay_and_the_last_of_a_name_counts(tmp_path):
    dest = tmp_path / "to"
    with Manifest(manifest_path(dest, None)) as manifest:
        manifest.add({"name": "a", "status": "started"})
        manifest.add({"name": "b/\u00e4\udcff", "status": "failed", "error": "two\nlines"})
        manifest.add(done("a", seed=2**64 - 1))
    found = read_records(dest)
    assert plain([found["a"]]) == [done("a", seed=2**64 - 1)]
    assert found["b/\u00e4\udcff"]["error"] == "two\nlines"
    lines = manifest_path(dest, None).read_text("ascii").splitlines()
    assert [json.loads(line)["status"] for line in lines] == ["started", "failed", "done"]


@settings(max_examples=200, deadline=None)
@given(kept=st.integers(0, 1000))
@pytest.mark.thorough
def test_a_torn_line_is_cut_off_and_nothing_else(tmp_path_factory, kept):
    path = manifest_path(tmp_path_factory.mktemp("m"), None)
    records = [done(f"s{k}") for k in range(4)]
    with Manifest(path) as manifest:
        for record in records:
            manifest.add(record)
    whole = path.read_bytes()
    kept = min(kept, len(whole))
    path.write_bytes(whole[:kept])
    count = whole[:kept].count(b"\n")
    assert plain(read_records(path.parent).values()) == records[:count]
    with Manifest(path) as manifest:
        manifest.add(done("new"))
    assert plain(map(json.loads, path.read_text().splitlines())) == [*records[:count], done("new")]


@pytest.mark.parametrize("line", [b"no line", b"[]", b'{"name": 3}', b'{"name": "a"}', b"\xff"])
def test_a_wrong_line_before_the_last_is_named(tmp_path, line):
    path = manifest_path(tmp_path, None)
    with Manifest(path) as manifest:
        manifest.add(done("a"))
    whole = path.read_bytes() + line + b"\n"
    path.write_bytes(whole)
    with pytest.raises(DataError, match=r"manifest\.jsonl:2: is no line of a manifest"):
        Manifest(path)
    with pytest.raises(DataError, match=r"manifest\.jsonl:2: is no line of a manifest"):
        read_records(tmp_path)
    assert path.read_bytes() == whole


def test_only_one_writes(tmp_path):
    path = manifest_path(tmp_path, None)
    with Manifest(path), pytest.raises(OutputError, match="another batch writes here"):
        Manifest(path)
    with Manifest(path):
        pass


def test_shards_of_one_number_work_side_by_side_and_no_others(tmp_path):
    whole, first, second, other = (
        manifest_path(tmp_path, shard) for shard in (None, (1, 3), (2, 3), (1, 2))
    )
    with Manifest(first):
        check_alone(second)
        for path in (whole, other):
            with pytest.raises(OutputError, match=r"manifest-1-of-3\.jsonl: another batch"):
                check_alone(path)
    check_alone(whole)
    with Manifest(whole), pytest.raises(OutputError, match=r"manifest\.jsonl: another batch"):
        check_alone(first)


def test_what_all_shards_did_counts_the_later_first(tmp_path):
    for shard, seed in (((1, 2), 1), (None, 2), ((2, 2), 3)):
        with Manifest(manifest_path(tmp_path, shard)) as manifest:
            manifest.add(done("a", seed=seed))
    assert read_records(tmp_path)["a"]["seed"] == 3


def _killed_while_writing(path):
    manifest = Manifest(path)
    manifest.add(done("a"))
    manifest._file.write(b'{"name": "b", "sta')
    manifest._file.flush()
    os.kill(os.getpid(), 9)


def test_a_process_that_is_killed_leaves_its_lines_and_no_lock(tmp_path):
    path = manifest_path(tmp_path, None)
    spawned = multiprocessing.get_context("fork").Process(
        target=_killed_while_writing, args=(path,)
    )
    spawned.start()
    spawned.join()
    assert spawned.exitcode == -9
    assert list(read_records(tmp_path)) == ["a"]
    with Manifest(path) as manifest:
        manifest.add(done("c"))
    assert list(read_records(tmp_path)) == ["a", "c"]


def test_what_cannot_be_written_is_cut_off_again(tmp_path, monkeypatch):
    path = manifest_path(tmp_path, None)
    with Manifest(path) as manifest:
        manifest.add(done("a"))

        def full(descriptor):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            manifest.add(done("b"))
        monkeypatch.undo()
        manifest.add(done("c"))
    assert list(read_records(tmp_path)) == ["a", "c"]


WRONG = {
    "without a digest": {"sha256": None},
    "a seed that is text": {"seed": "0"},
    "a list beside": {"beside": ["a.json"]},
    "a list of exports": {"export": []},
    "a file of another folder": {"beside": {"../a.json": ""}},
    "a file anywhere": {"beside": {"/etc/passwd": ""}},
    "a folder": {"beside": {"..": "", ".": ""}},
    "a sequence of another folder": {"name": "a/../../b"},
    "a sequence anywhere": {"name": "/home/b"},
}


@pytest.mark.parametrize("what", WRONG)
def test_a_manifest_from_elsewhere_names_only_what_a_batch_does(tmp_path, what):
    record = {**done("a"), "at": "2026", **WRONG[what]}
    line = json.dumps({key: value for key, value in record.items() if value is not None})
    manifest_path(tmp_path, None).write_text(line + "\n")
    for read in (read_records, lambda dest: Manifest(manifest_path(dest, None))):
        with pytest.raises(DataError, match=r"manifest\.jsonl:1: is no line of a manifest"):
            read(tmp_path)


@pytest.mark.skipif(os.name == "nt", reason="needs pipes")
@pytest.mark.parametrize("shard", [None, (1, 2)])
def test_a_pipe_is_no_manifest(tmp_path, shard):
    path = manifest_path(tmp_path, shard)
    os.mkfifo(path)
    for read in (read_records, lambda dest: check_alone(manifest_path(dest, (1, 3)))):
        with pytest.raises((DataError, OutputError), match="is a pipe, a device or a socket"):
            read(tmp_path)
    with pytest.raises(OutputError, match="is a pipe"):
        Manifest(path)
