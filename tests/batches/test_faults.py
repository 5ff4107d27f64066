"""What goes wrong around a batch: full disks, sources that vanish, links, and no memory."""

import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import trees_of_batch as trees
from trees_of_batch import QUICK, clip, last_of, lines_of, made_in

from adv2e.batches import processes
from adv2e.batches.work import do

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(sys.platform == "win32", reason="limits are those of POSIX"),
]


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "from"
    for k in range(3):
        clip(root / f"{k}.avi", count=6, start=k, size=(120, 90))
    return root


@pytest.fixture
def undisturbed(batch, source, tmp_path):
    assert batch(source, tmp_path / "undisturbed").status == 0
    return made_in(tmp_path / "undisturbed")


def limited(most):
    """Return a function that lets no file of the process grow beyond `most` bytes."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    return limit


@pytest.mark.parametrize("most", [300, 20_000])
def test_a_full_disk_and_then_room_again(batch, source, undisturbed, tmp_path, most):
    """The first leaves no room for a whole manifest, the second for some of the events."""
    dest = tmp_path / "to"
    done = subprocess.run(
        trees.command(source, dest, *QUICK, "--jobs", 2),
        capture_output=True, text=True, check=False, preexec_fn=limited(most),
    )  # fmt: skip
    assert done.returncode == 1
    assert "File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert set(made_in(dest).items()) <= set(undisturbed.items())
    lines_of(dest)  # each is whole
    assert not [*dest.rglob(".adv2e*")]
    done = batch(source, dest)
    assert done.status == 0, done.err
    assert made_in(dest) == undisturbed


def mount(*words):
    try:
        done = subprocess.run(["mount", *words], capture_output=True, text=True, check=False)
    except OSError as error:
        pytest.skip(str(error))
    if done.returncode:
        pytest.skip(done.stderr)


@pytest.fixture
def disk(tmp_path):
    """A disk of 300 kB, where one may be had."""
    place = tmp_path / "disk"
    place.mkdir()
    mount("-t", "tmpfs", "-o", "size=300k", "tmpfs", str(place))
    yield place
    subprocess.run(["umount", "-l", str(place)], check=True)


def test_a_disk_that_is_really_full(batch, source, undisturbed, disk):
    done = batch(source, disk / "to")
    assert done.status == 1
    assert "No space left on device" in done.err
    assert set(made_in(disk / "to").items()) < set(undisturbed.items())
    assert not [*disk.rglob(".adv2e*")]
    mount("-o", "remount,size=100m", str(disk))
    done = batch(source, disk / "to")
    assert done.status == 0, done.err
    assert made_in(disk / "to") == undisturbed
    mount("-o", "remount,ro", str(disk))
    done = batch(source, disk / "to", "--overwrite")
    assert done.status == 1
    assert "Read-only file system" in done.err
    assert done.err.count("\n") == 1


def test_a_source_that_vanishes_meanwhile_fails_alone(
    batch, source, undisturbed, tmp_path, monkeypatch
):
    vanishing = ["1"]

    def engine(jobs, count):
        for job in jobs:
            if job.name in vanishing:
                Path(job.source).unlink()
                vanishing.remove(job.name)
            yield job, do(job)

    monkeypatch.setattr(processes, "run", engine)
    dest = tmp_path / "to"
    done = batch(source, dest)
    assert done.status == 1
    assert "1.avi" in done.err
    assert sorted(made_in(dest)) == ["0.h5", "2.h5"]
    assert last_of(dest)["1"]["status"] == "failed"
    clip(source / "1.avi", count=6, start=1, size=(120, 90))
    assert batch(source, dest).status == 0
    assert made_in(dest) == undisturbed


def test_a_destination_that_cannot_be_made_is_one_line(batch, source, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    for dest in (tmp_path / "file" / "to", "/proc/adv2e-to"):
        done = batch(source, dest)
        assert done.status == 1
        assert done.err.count("\n") == 1
        assert str(dest).split("/to")[0] in done.err


@pytest.mark.skipif(os.geteuid() == 0 if hasattr(os, "geteuid") else True, reason="root may write")
def test_a_destination_that_is_read_only_is_one_line(batch, source, tmp_path):
    dest = tmp_path / "to"
    dest.mkdir(mode=0o500)
    done = batch(source, dest)
    assert done.status == 1
    assert done.err.count("\n") == 1


def address_space():
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmSize:")[1].split()[0])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks /proc")
def test_no_memory_fails_a_sequence_alone(batch, source, undisturbed, tmp_path, monkeypatch):
    large = source / "large" / "images"
    large.mkdir(parents=True)
    for k in range(2):
        cv2.imwrite(str(large / f"{k}.png"), np.full((4000, 5000), 100 * k, np.uint8))
    (large.parent / "images.txt").write_text("0 images/0.png\n1 images/1.png\n")

    def engine(jobs, count):
        limits = resource.getrlimit(resource.RLIMIT_AS)
        for job in jobs:
            resource.setrlimit(resource.RLIMIT_AS, (address_space() + (400 << 20), limits[1]))
            try:
                found = do(job)
            finally:
                resource.setrlimit(resource.RLIMIT_AS, limits)
            yield job, found

    monkeypatch.setattr(processes, "run", engine)
    dest = tmp_path / "to"
    done = batch(source, dest)
    assert done.status == 1
    assert sorted(made_in(dest)) == ["0.h5", "1.h5", "2.h5"]
    error = last_of(dest)["large"]["error"]
    assert "large: not enough memory (see ulimit -v)" in error
    assert "\n" not in error


@pytest.mark.parametrize("link", ["folder", "file", "export"])
def test_links_do_not_lead_out_of_dest(batch, tmp_path, link):
    root, dest, outside = tmp_path / "from", tmp_path / "to", tmp_path / "outside"
    clip(root / "deep" / "a.avi")
    for folder in (dest, outside):
        folder.mkdir()
    if link == "folder":
        (dest / "deep").symlink_to(outside)
    else:
        (dest / "deep").mkdir()
        name = "a.h5" if link == "file" else "a.voxel"
        (dest / "deep" / name).symlink_to(outside / name)
    done = batch(root, dest, "--overwrite", "--export", "voxel")
    assert done.status == 1
    assert f"a link leads out of {dest}: remove it" in done.err
    assert not [*outside.iterdir()]


def test_a_link_in_place_of_the_manifest_is_not_written_through(batch, source, tmp_path):
    dest = tmp_path / "to"
    dest.mkdir()
    (tmp_path / "elsewhere").write_bytes(b"mine")
    (dest / "manifest.jsonl").symlink_to(tmp_path / "elsewhere")
    done = batch(source, dest)
    assert done.status == 1
    assert (tmp_path / "elsewhere").read_bytes() == b"mine"


def test_dest_itself_may_be_a_link(batch, source, undisturbed, tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "to").symlink_to(tmp_path / "real")
    assert batch(source, tmp_path / "to").status == 0
    assert made_in(tmp_path / "real") == undisturbed
    shutil.rmtree(tmp_path / "real")
