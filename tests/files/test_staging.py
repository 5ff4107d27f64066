import errno
import json
import os
import re
import stat
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

from adv2e.errors import OutputError
from adv2e.files import staging as staging_module
from adv2e.files import workspace
from adv2e.files.staging import Staging
from adv2e.files.workspace import remove_abandoned


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
    first.write_text("new a")  # the second is never written
    assert not second.exists()

    with pytest.raises(OutputError, match="b: cannot be written: No such file"):
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


class Steps:
    """Does something before or after one of the steps that change names, counted from 0."""

    def __init__(self, monkeypatch, at, after, then):
        self.count, self.at, self.after, self.then = 0, at, after, then
        for name in ("rename", "replace", "unlink"):
            monkeypatch.setattr(Path, name, self.counted(getattr(Path, name)))
        monkeypatch.setattr(os, "link", self.counted(os.link))
        monkeypatch.setattr(staging_module, "exchange", self.counted(staging_module.exchange))

    def counted(self, step):
        def counting(*args, **kw):
            number, self.count = self.count, self.count + 1
            if number == self.at and not self.after:
                self.then()
            result = step(*args, **kw)
            if number == self.at and self.after:
                self.then()
            return result

        return counting


def pair(folder, overwrite):
    """Stage a file, one that tells about it, and a picture of it."""
    staging = Staging(overwrite)
    main = staging.file(folder / "e.txt")
    about = staging.file(folder / "e.txt.json")
    other = staging.file(folder / "e.gif")
    staging.prepare()
    for path in (main, about, other):
        path.write_text("new")
    return staging


def single(folder, overwrite):
    staging = Staging(overwrite)
    main = staging.file(folder / "e.txt")
    staging.prepare()
    main.write_text("new")
    return staging


def swapped(folder, overwrite):
    staging = Staging(overwrite)
    main = staging.folder(folder / "e", nothing_foreign)
    staging.prepare()
    main.mkdir()
    (main / "a").write_text("new")
    return staging


KINDS = {"pair": (pair, ["e.txt", "e.txt.json", "e.gif"]), "single": (single, ["e.txt"])}
KINDS["folder"] = (swapped, ["e/a"])


def lay_old(folder, kind):
    for name in KINDS[kind][1]:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("old")


def held(folder):
    """Return what visible files hold, by their names."""
    files = (path for path in folder.rglob("*") if path.is_file())
    texts = {path.relative_to(folder).as_posix(): path.read_text() for path in files}
    return {name: text for name, text in texts.items() if not name.startswith(".")}


def held_aside(folder):
    """Return what lies aside, by its final name."""
    found = (path for path in folder.glob(".adv2e.*/old/**/*") if path.is_file())
    return {"/".join(path.relative_to(folder).parts[2:]): path.read_text() for path in found}


@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_an_interrupt_leaves_the_old_or_the_new(tmp_path, monkeypatch, kind, overwrite, after):
    stage, wanted = KINDS[kind]

    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", lambda descriptor: None)  # it takes its time
    for at in range(100):
        folder = tmp_path / str(at)
        folder.mkdir()
        if overwrite:
            lay_old(folder, kind)
        old = held(folder)
        with monkeypatch.context() as patch:
            steps = Steps(patch, at, after, interrupt)
            staging = stage(folder, overwrite)
            try:
                staging.commit()
            except KeyboardInterrupt:
                staging.discard()
        assert held(folder) in (old, dict.fromkeys(wanted, "new")), f"step {at}"
        assert names(folder) == sorted({name.partition("/")[0] for name in held(folder)})
        if steps.count <= at:
            break
    assert at > 0


KILLED = """
import json, os, signal, sys, warnings
from pathlib import Path
import pytest
from files import test_staging as t

kind, overwrite, after, exchanges = json.loads(sys.argv[2])
os.fsync = lambda descriptor: None  # it takes its time
for at in range(100):
    folder = Path(sys.argv[1], str(at))
    folder.mkdir()
    if overwrite:
        t.lay_old(folder, kind)
    patch = pytest.MonkeyPatch()
    if not exchanges:
        patch.setattr(t.staging_module, "exchange", lambda one, other: False)
    child = os.fork()
    if child == 0:
        t.Steps(patch, at, after, lambda: os.kill(os.getpid(), signal.SIGKILL))
        t.KINDS[kind][0](folder, overwrite).commit()
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if status == 0:
        break
    killed, aside = t.held(folder), t.held_aside(folder)
    with warnings.catch_warnings(record=True) as told:
        t.remove_abandoned(folder)
    assert t.held_aside(folder) == aside
    assert t.held(folder) == killed
    said = [str(one.message) for one in told]
    print(json.dumps([killed, aside, said, t.names(folder)]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize(
    ("kind", "exchanges"), [("single", True), *product(("pair", "folder"), (True, False))]
)
@pytest.mark.quick_cases(1)
def test_killed_at_any_step_it_leaves_the_old_or_the_new(
    tmp_path, kind, exchanges, overwrite, after
):
    """Outputs after the first may be missing; what they were to replace is told, and not lost."""
    tests = Path(__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tests), str(tests.parent)])}
    told = json.dumps([kind, overwrite, after, exchanges])
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path), told],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    new = dict.fromkeys(KINDS[kind][1], "new")
    old = dict.fromkeys(KINDS[kind][1], "old") if overwrite else {}
    lines = done.stdout.splitlines()
    assert len(lines) >= 1
    for line in lines:
        killed, aside, said, there = json.loads(line)
        first = KINDS[kind][1][0]
        state = set(killed.values())
        assert killed in (old, new) or len(state) < 2, line
        if kind == "single" or (kind == "folder" and exchanges):
            assert killed in (old, new), line
        if kind == "pair" and overwrite:
            assert first in killed, line
        for name in old:
            assert name in killed or aside[name] == "old", line
        assert [one for one in said if "what a run was replacing" not in one] == []
        assert len(said) == bool(aside), line
        hidden = [name for name in there if name.startswith(".")]
        assert len(hidden) == bool(aside), line
        assert sorted({*there} - {*hidden}) == sorted({name.partition("/")[0] for name in killed})


@pytest.fixture
def dead(tmp_path):
    """A folder where a run was killed while it wrote; and all that it left there."""
    code = (
        "import os, signal, sys; from pathlib import Path; from files.test_staging import pair;"
        "pair(Path(sys.argv[1]), True);"
        "os.kill(os.getpid(), getattr(signal, 'SIGKILL', signal.SIGTERM))"
    )
    tests = Path(__file__).parents[1]
    path = os.pathsep.join([str(tests), str(tests.parent)])
    environment = {**os.environ, "PYTHONPATH": path}
    folder = tmp_path / "dead"
    folder.mkdir()
    done = subprocess.run([sys.executable, "-c", code, str(folder)], env=environment, check=False)
    assert done.returncode != 0
    assert len(names(folder)) == 1
    return folder


def test_the_next_run_removes_what_a_killed_one_left(dead):
    (dead / ".mine.12345678.part.txt").write_text("nobody says whose it is")
    staged(dead / "f.txt").commit()
    assert names(dead) == [".mine.12345678.part.txt", "f.txt"]


def test_what_a_live_run_writes_stays(tmp_path):
    live = staged(tmp_path / "a.txt")
    staged(tmp_path / "b.txt").commit()
    live.commit()
    assert names(tmp_path) == ["a.txt", "b.txt"]
    assert (tmp_path / "a.txt").read_text() == "new"


@pytest.mark.parametrize("told", [b"elsewhere\n1", b"no locks here", b"\n"])
def test_what_another_machine_may_have_left_stays(dead, told):
    (lock,) = dead.glob(".*.part/lock")
    lock.write_bytes(told)
    before = list(dead.rglob("*"))
    remove_abandoned(dead)
    assert list(dead.rglob("*")) == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="gives a folder away")
def test_what_another_user_left_stays(dead):
    (folder,) = dead.glob(".*.part")
    os.chown(folder, 65534, 65534)
    before = list(dead.rglob("*"))
    remove_abandoned(dead)
    assert list(dead.rglob("*")) == before


@pytest.mark.parametrize("left", [[], ["lock"], ["lock", "new0.txt", "new1", "new10.h5"]])
def test_what_a_run_left_that_was_killed_as_it_began_or_ended_goes(tmp_path, left):
    (tmp_path / ".adv2e.01234567.part").mkdir()
    for name in left:
        (tmp_path / ".adv2e.01234567.part" / name).touch()
    remove_abandoned(tmp_path)
    assert names(tmp_path) == []


def test_without_locks_nothing_looks_dead(tmp_path, monkeypatch):
    def no_locks(*args, **options):
        raise OSError(errno.ENOLCK, "No locks available")

    with monkeypatch.context() as patch:
        patch.setattr(workspace.fcntl, "flock", no_locks)
        live = staged(tmp_path / "a.txt")
        assert len(names(tmp_path)) == 1
    remove_abandoned(tmp_path)
    live.commit()
    assert names(tmp_path) == ["a.txt"]


def test_without_hard_links_files_are_renamed(tmp_path, monkeypatch):
    def no_links(*args, **options):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    staged(tmp_path / "a.txt").commit()
    pair(tmp_path, True).commit()
    pair(tmp_path, True).commit()
    assert names(tmp_path) == ["a.txt", "e.gif", "e.txt", "e.txt.json"]


def test_what_appears_at_the_last_moment_is_kept(tmp_path, monkeypatch):
    link = os.link

    def late(one, other):
        Path(other).write_text("someone else's")
        link(one, other)

    staging = pair(tmp_path, False)
    monkeypatch.setattr(os, "link", late)
    with pytest.raises(OutputError, match=r"e\.txt: exists already"):
        staging.commit()
    staging.discard()
    assert held(tmp_path) == {"e.txt": "someone else's"}


def test_two_outputs_are_two_files(tmp_path):
    staging = Staging(overwrite=True)
    staging.file(tmp_path / "a.gif")
    with pytest.raises(OutputError, match=r"a\.gif: is to be two outputs"):
        staging.file(tmp_path / "b" / ".." / "a.gif")
    with pytest.raises(OutputError, match="one lies in the other"):
        staging.file(tmp_path / "a.gif" / "b")
    staging.folder(tmp_path / "out", nothing_foreign)
    with pytest.raises(OutputError, match="one lies in the other"):
        staging.file(tmp_path / "out" / "b.gif")


def test_a_block_decides_for_all_that_share_it(tmp_path):
    def write(name):
        file = staging.file(tmp_path / name)
        staging.prepare()
        file.write_text(name)

    with Staging(overwrite=False) as staging:
        write("a")
        write("b")
        assert held(tmp_path) == {}
    assert names(tmp_path) == ["a", "b"]
    with pytest.raises(ZeroDivisionError), Staging(overwrite=True) as staging:
        write("a")
        write("c")
        raise ZeroDivisionError
    assert held(tmp_path) == {"a": "a", "b": "b"}
    assert names(tmp_path) == ["a", "b"]


def test_all_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    synced = []
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda fd: synced.append(os.fstat(fd).st_ino) or fsync(fd))
    at_link = []
    link = os.link
    monkeypatch.setattr(os, "link", lambda a, b: at_link.extend(synced) or link(a, b))
    staging = staged(tmp_path / "out.txt")
    staging.commit()
    assert (tmp_path / "out.txt").stat().st_ino in at_link
    assert tmp_path.stat().st_ino in synced


@pytest.mark.parametrize("name", ["n" * 256, "n" * 300 + ".txt"])
def test_a_name_that_is_too_long_is_told_at_once(tmp_path, name):
    with pytest.raises(OutputError, match=r"File name too long|cannot find"):
        Staging(overwrite=False).file(tmp_path / name)


@pytest.mark.skipif(os.name == "nt", reason="names of POSIX")
@pytest.mark.parametrize(
    "name",
    ["a:b.txt", "x\xff\udcff.txt", "two\nlines.txt", "-o.txt", "100%d.txt", "e\u0301.t\u00e9"],
)
def test_while_it_is_written_a_file_has_a_plain_name(tmp_path, name):
    staging = Staging(overwrite=False)
    temporary = staging.file(tmp_path / name)
    for part in (temporary.parent.name, temporary.name):
        assert re.fullmatch(r"\.?\w[\w.-]+", part, re.ASCII)
    staging.prepare()
    temporary.write_text("new")
    staging.commit()
    assert names(tmp_path) == [name]
