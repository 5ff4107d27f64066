"""Sequences in parts: the same bytes, however they are divided, killed or damaged on the way."""

import os
import signal
import subprocess
import sys
import time

import pytest
import trees_of_batch as trees
from trees_of_batch import clip, last_of, made_in

from adv2e.batch import processes, work
from adv2e.batch.divided import Jobs, parts_folder
from adv2e.batch.work import Job
from adv2e.conversion import parts as stored
from adv2e.light import intervals

pytestmark = pytest.mark.thorough

SIZE = (96, 80)
"""Of the frames: of 7,680 pixels, four strips."""

READOUT = (
    *("--set", "readout.tick_us=20"),
    *("--set", "readout.arbiter={event_ns: 500, row_ns: 2000}"),
    *("--set", "readout.loss.fraction=0.2"),
    *("--set", "readout.frame_coupling={amplitude: 0.1, tau_us: 300}"),
    *("--set", "pixel.dead_pixels.fraction=0.1"),
)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    root = tmp_path_factory.mktemp("source")
    clip(root / "a.avi", 6, size=SIZE)
    clip(root / "deep" / "b.avi", 6, start=2, size=SIZE)
    return root


@pytest.fixture
def small_pieces(monkeypatch):
    """Blocks, and parts of time, of which there are many in small clips."""
    monkeypatch.setattr(stored, "BLOCK", 512)
    monkeypatch.setattr(intervals, "EVENTS", 2000)


def without_times(record):
    return {key: value for key, value in record.items() if key not in ("at", "seconds")}


@pytest.mark.parametrize(
    "options",
    [
        ("--causes", "--with-frames"),
        ("--format", "txt", "--causes", *READOUT),
        ("--set", "pixel.source_follower.cutoff_hz=900", "--threads", "1", *READOUT[:6]),
        ("--export", "voxel"),
    ],
)
@pytest.mark.usefixtures("small_pieces")
def test_the_bytes_do_not_depend_on_the_parts(batch, source, tmp_path, options):
    whole, split = tmp_path / "whole", tmp_path / "split"
    assert batch(source, whole, "--seed", 5, *options).status == 0
    done = batch(source, split, "--seed", 5, "--split", 3, *options)
    assert done.status == 0, done.err
    made = made_in(whole)
    assert made_in(split) == made
    assert all(record["events"] > 3000 for record in last_of(whole).values())
    for name, record in last_of(split).items():
        assert without_times(record) == without_times(last_of(whole)[name])
    assert sorted(path.name for path in split.iterdir()) == sorted(
        path.name for path in whole.iterdir()
    )
    assert "0 made (0 events), 2 kept" in batch(source, split, "--seed", 5, *options).out


def test_more_parts_than_strips_are_no_harm(batch, tmp_path):
    clip(tmp_path / "from" / "a.avi")
    for dest, options in (("whole", ()), ("split", ("--split", 5))):
        assert batch(tmp_path / "from", tmp_path / dest, *options).status == 0
    assert made_in(tmp_path / "split") == made_in(tmp_path / "whole")


def test_parts_that_are_there_are_kept_unless_they_are_damaged(
    batch, source, tmp_path, monkeypatch
):
    whole, dest = tmp_path / "whole", tmp_path / "to"
    assert batch(source, whole).status == 0
    made, stop_at = [], 5

    def stopping(jobs, count):
        for number, job in enumerate(jobs):
            if number == stop_at:
                raise KeyboardInterrupt
            yield job, work.do(job)

    make = stored.make_part
    monkeypatch.setattr(stored, "make_part", lambda *a, **k: made.append(a[1]) or make(*a, **k))
    monkeypatch.setattr(processes, "run", stopping)
    # three parts, the merged sequence, and one part of the next
    assert batch(source, dest, "--split", 3).status == 130
    assert len(made) == 4
    (left,) = dest.rglob("*.part")
    assert sorted(set(made_in(dest)) - {left.relative_to(dest).as_posix()}) == ["a.h5"]
    stop_at = 100

    def again(*options):
        made.clear()
        done = batch(source, dest, "--split", 3, *options)
        assert done.status == 0, done.err
        assert not [*dest.rglob(".adv2e*")]
        return len(made)

    text = left.read_bytes()
    assert again() == 2
    assert made_in(dest) == made_in(whole)
    for wrong, options in ((text[:-1], ()), (text, ("--set", "pixel.refractory=null"))):
        (dest / "deep" / "b.h5").unlink()
        left.parent.mkdir(parents=True)
        left.write_bytes(wrong)
        assert again(*options) == (6 if options else 3)
        assert made_in(dest) == made_in(whole) or options


def test_what_fails_fails_once_and_the_others_go_on(batch, source, tmp_path):
    root, dest = tmp_path / "from", tmp_path / "to"
    clip(root / "a.avi", 6, size=SIZE)
    (root / "b.avi").write_bytes(b"no video")
    done = batch(root, dest, "--split", 3)
    assert done.status == 1
    assert done.out.startswith("2 sequences: 1 made (")
    assert done.err.count("b.avi") == 2  # in a line, and in the table
    assert [one["status"] for one in trees.lines_of(dest) if one["name"] == "b"] == [
        "started",
        "failed",
    ]
    assert not [*dest.rglob(".adv2e*")]
    # what is found when all is merged: the parts stay, and are good for the next call
    few = last_of(dest)["a"]["events"] - 1
    (dest / "a.h5").unlink()
    done = batch(root, dest, "--split", 3, "--set", f"max_events={few}")
    assert f"max_events: more than {few:,} events" in last_of(dest)["a"]["error"]
    assert len([*dest.rglob("*.part")]) == 3
    (root / "b.avi").unlink()
    assert batch(root, dest).status == 0
    assert not [*dest.rglob(".adv2e*")]


OWN = """
import numpy as np
from adv2e.effects.hooks import Hooks

class Every(Hooks):
    '''Drops events, and may do more.'''
    name = "every"
    stage = "readout"
    def events(self, chunks):
        count = 0
        for events in chunks:
            number = count + np.arange(events.size)
            count += events.size
            yield events[number % 3 != 1]
"""
MORE = """
    def signal(self, times_s):
        return 0.0 * times_s
"""


def test_an_effect_on_events_alone_is_done_when_parts_are_merged(batch, source, tmp_path):
    effect = tmp_path / "every.py"
    options = ("--effect", effect, "--set", "user.every={}")
    effect.write_text(OWN)
    assert batch(source, tmp_path / "whole", *options).status == 0
    done = batch(source, tmp_path / "split", *options, "--split", 2)
    assert done.status == 0, done.err
    assert made_in(tmp_path / "split") == made_in(tmp_path / "whole")
    effect.write_text(OWN + MORE)
    done = batch(source, tmp_path / "refused", *options, "--split", 2)
    assert done.status == 2
    assert "--split: the effect every changes events and acts within the pixel" in done.err
    assert not (tmp_path / "refused").exists()
    assert batch(source, tmp_path / "refused", *options).status == 0


def test_links_lead_no_part_out_of_the_folder(batch, tmp_path):
    root, dest, other = (tmp_path / name for name in ("from", "to", "other"))
    clip(root / "a.avi")
    folder = parts_folder(dest, "a")
    other.mkdir()
    (other / "kept").touch()
    dest.mkdir()
    folder.symlink_to(other)
    done = batch(root, dest, "--split", 2)
    assert done.status == 1
    assert f"{folder.name}: a link leads out of" in done.err
    assert batch(root, dest).status == 1
    folder.unlink()
    folder.mkdir()
    (folder / "1-of-2.part").symlink_to(other / "part")
    (other / "part").write_bytes(b"mine")
    assert batch(root, dest, "--split", 2).status == 0
    assert (other / "part").read_bytes() == b"mine"
    assert (other / "kept").exists()


def test_urls_cannot_be_divided(batch, tmp_path):
    done = batch("memory://from", tmp_path / "to", "--split", 2)
    assert done.status == 2
    assert "--split: SOURCE and DEST must be folders, no URLs" in done.err


def job(name, **more):
    return Job(name, f"{name}.avi", f"{name}.h5", {}, {}, (), **more)


def test_parts_are_merged_as_soon_as_all_are_made(tmp_path):
    jobs = Jobs([job("a"), job("b"), job("c", only_export=True)], tmp_path, 2)
    flying = [next(jobs), next(jobs), next(jobs)]
    assert [(one.name, one.share) for one in flying] == [
        ("a", (1, 2)),
        ("a", (2, 2)),
        ("b", (1, 2)),
    ]
    assert len({one.output for one in flying}) == 3
    jobs.part_made(flying[1])
    assert next(jobs).share == (2, 2)
    jobs.part_made(flying[0])
    merging = next(jobs)
    assert (merging.name, merging.share) == ("a", None)
    assert merging.parts == (flying[0].output, flying[1].output)
    # its first part has failed: there is nothing to merge, and nobody has to wait
    assert jobs.give_up(flying[2])
    assert not jobs.give_up(flying[2])
    jobs.part_made(flying[2])
    assert next(jobs).name == "c"
    assert next(jobs, "no more") == "no more"
    assert {path.name for path in tmp_path.iterdir()} == {
        parts_folder(tmp_path, name).name for name in "ab"
    }
    jobs = Jobs([job("a")], tmp_path, 1)
    assert (next(jobs).parts, next(jobs, None)) == ((), None)


def test_an_engine_waits_for_what_is_to_be_merged(tmp_path):
    jobs = Jobs([job("a"), job("b")], tmp_path, 2)
    for _ in range(4):
        next(jobs)
    assert next(jobs, "no more") is None


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_killed_and_called_again_the_bytes_are_the_same(batch, tmp_path):
    root, dest = tmp_path / "from", tmp_path / "to"
    clip(root / "a.avi", 20, size=(240, 180))
    assert batch(root, tmp_path / "whole").status == 0
    args = (root, dest, "--split", 4, "--jobs", 2)
    process = subprocess.Popen(trees.command(*args, *trees.QUICK), start_new_session=True)
    until = time.monotonic() + 60
    while not any(dest.rglob("*-of-4.part")):
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    assert process.wait(30) == -signal.SIGKILL
    assert not (dest / "a.h5").exists()
    done = batch(*args)
    assert done.status == 0, done.err
    assert made_in(dest) == made_in(tmp_path / "whole")
    assert not [*dest.rglob(".adv2e*")]
