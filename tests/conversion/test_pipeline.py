"""Whole conversions through the command line: formats, the record of their making, bad input."""

import errno
import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import zlib
from functools import partial
from pathlib import Path

import cv2
import h5py
import numpy as np
import onnx_models
import pytest
import tqdm
from pictures import picture

from adv2e.config import load_config, names_of
from adv2e.conversion import pipeline as conversion
from adv2e.conversion.simulation import events_from_light
from adv2e.events import empty_events
from adv2e.files.regular import shown
from adv2e.formats.reading import read_events


@pytest.fixture
def folder(tmp_path):
    """A small DAVIS240C recording with frames only."""
    root = tmp_path / "recording"
    (root / "images").mkdir(parents=True)
    lines = []
    for k in range(5):
        name = f"images/frame_{k:08d}.png"
        cv2.imwrite(str(root / name), picture(k))
        lines.append(f"{100 + k * 0.04:.9f} {name}\n")
    (root / "images.txt").write_text("".join(lines))
    return root


@pytest.fixture
def video(tmp_path):
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 30, (32, 24))
    for k in range(6):
        writer.write(cv2.cvtColor(picture(k), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def test_the_same_events_in_every_format(adv2e, folder, tmp_path):
    outputs = [tmp_path / name for name in ("a.txt", "a.h5", "a.zip", "a")]
    for output in outputs:
        outcome = adv2e("convert", folder, "-o", output, "--seed", "3")
        assert outcome.status == 0, outcome.err
        assert "events" in outcome.out
    events = [read_events(path).events for path in outputs]
    assert len(events[0]) > 300
    # on the recording's own clock
    assert events[0]["t"][0] > 100_000_000
    for other in events[1:]:
        assert other.tobytes() == events[0].tobytes()
    # the whole recording: frames at their times
    for path in outputs[2:]:
        times = read_events(path).frame_times_ns
        assert list(times) == [100_000_000_000 + 40_000_000 * k for k in range(5)]


def test_files_say_how_they_were_made(adv2e, folder, tmp_path):
    for name in ("a.txt", "a.h5", "a.zip", "a"):
        adv2e("convert", folder, "-o", tmp_path / name, "--seed", "7", "--set", "pixel.leak=null")
    metadata = [read_events(tmp_path / name).metadata for name in ("a.h5", "a.zip", "a")]
    metadata.append(json.loads((tmp_path / "a.txt.json").read_text()))
    for record in metadata:
        assert record["seed"] == 7
        assert record["config"]["pixel"]["leak"] is None
        assert record["versions"]["numpy"] == np.__version__
        assert record["versions"]["numba"] == importlib.metadata.version("numba")
        assert record["versions"]["opencv"].startswith(cv2.__version__)
        assert record["versions"]["zlib"] == zlib.ZLIB_RUNTIME_VERSION
        assert record["versions"]["deflate"] == importlib.metadata.version("deflate")
        assert "av" not in record["versions"]
        assert record["adv2e"]
        assert record["source"]["encoding"] == "linear"


def test_a_file_can_be_made_again_from_its_record(adv2e, folder, tmp_path):
    adv2e("convert", folder, "-o", tmp_path / "a.txt", "--set", "pixel.low_pass.cutoff_hz=80")
    record = json.loads((tmp_path / "a.txt.json").read_text())
    (tmp_path / "again.yaml").write_text(json.dumps(record["config"]))
    adv2e("convert", folder, "-o", tmp_path / "b.txt", "-c", tmp_path / "again.yaml")
    assert (tmp_path / "a.txt").read_bytes() == (tmp_path / "b.txt").read_bytes()


def test_video_gets_its_default_name_and_threads_change_nothing(
    adv2e,
    video,
    tmp_path,
    monkeypatch,
):
    monkeypatch.chdir(tmp_path)
    assert adv2e("convert", video, "--threads", "1").status == 0
    first = (tmp_path / "clip.events.h5").read_bytes()
    assert adv2e("convert", video, "--threads", "3", "--overwrite").status == 0
    assert (tmp_path / "clip.events.h5").read_bytes() == first
    with h5py.File(tmp_path / "clip.events.h5") as file:
        assert tuple(file.attrs["sensor_resolution"]) == (24, 32)


def test_start_and_stop_and_preview(adv2e, video, tmp_path):
    preview = tmp_path / "look.png"
    outcome = adv2e(
        "convert", video, "-o", tmp_path / "a.txt", "--start", "0.05", "--stop", "0.15",
        "--preview", preview,
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    t = read_events(tmp_path / "a.txt").events["t"]
    assert t.min() >= 66_000
    assert t.max() <= 134_000
    assert cv2.imread(str(preview)) is not None


@pytest.mark.thorough
def test_text_to_standard_output(adv2e, video, tmp_path):
    adv2e("convert", video, "-o", tmp_path / "a.txt")
    command = [sys.executable, "-m", "adv2e", "convert", str(video), "-o", "-"]
    outcome = subprocess.run(command, capture_output=True, check=True)
    assert outcome.stdout == (tmp_path / "a.txt").read_bytes()
    assert b"events" in outcome.stderr


def spoil_truncated(video):
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    return video


def spoil_single(video):
    single = video.with_name("single")
    single.mkdir()
    cv2.imwrite(str(single / "0.png"), picture(0))
    (single / "timestamps.txt").write_text("0.0\n")
    return single


def spoil_nan(video):
    path = video.with_name("nan.npy")
    stack = np.full((4, 6, 8), 0.5, np.float32)
    stack[2, 3, 3] = np.nan
    np.save(path, stack)
    (video.with_name("nan.timestamps.txt")).write_text("0.0\n0.1\n0.2\n0.3\n")
    return path


def spoil_sizes(video):
    folder = video.with_name("sizes")
    folder.mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), picture(k, (24, 32 + (k == 2))))
    (folder / "timestamps.txt").write_text("0\n0.1\n0.2\n")
    return folder


def spoil_order(video):
    folder = video.with_name("order")
    folder.mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), picture(k))
    (folder / "timestamps.txt").write_text("0\n0.2\n0.1\n")
    return folder


def spoil_missing_time(video):
    folder = video.with_name("untimed")
    folder.mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), picture(k))
    return folder


def spoil_empty(video):
    folder = video.with_name("empty")
    folder.mkdir()
    return folder


def spoil_gone(video):
    return video.with_name("gone.mp4")


@pytest.mark.parametrize(
    "spoil",
    [
        spoil_truncated, spoil_single, spoil_nan, spoil_sizes, spoil_order, spoil_missing_time,
        spoil_empty, spoil_gone,
    ],
)  # fmt: skip
@pytest.mark.parametrize("output", ["out.h5", "out.txt", "out"])
def test_bad_input_leaves_one_line_and_no_file(adv2e, video, tmp_path, spoil, output):
    source = spoil(video)
    target = tmp_path / "results"
    target.mkdir()
    outcome = adv2e("convert", source, "-o", target / output)
    assert outcome.status == 1
    lines = [line for line in outcome.err.splitlines() if "compiling" not in line]
    assert len(lines) == 1, outcome.err
    assert source.name.split(".")[0] in lines[0]
    assert list(target.iterdir()) == []


def test_existing_output_is_kept_without_overwrite(adv2e, video, tmp_path):
    target = tmp_path / "out.h5"
    target.write_text("mine")
    outcome = adv2e("convert", video, "-o", target)
    assert outcome.status == 1
    assert "--overwrite" in outcome.err
    assert target.read_text() == "mine"


def test_an_input_is_never_written_over(adv2e, folder, tmp_path):
    recording, stamps = tmp_path / "rec.zip", tmp_path / "stamps.txt"
    assert adv2e("convert", folder, "--fps", 100, "-o", recording).status == 0
    stamps.write_text("0\n.01\n.02\n.03\n.04\n")
    before = recording.read_bytes(), stamps.read_bytes()
    for arguments in (
        ("convert", recording, "-o", recording),
        ("convert", recording, "-o", tmp_path / "." / "rec.zip"),
        ("convert", folder, "--timestamps", stamps, "-o", stamps),
        ("convert", recording, "-o", tmp_path / "a.h5", "--preview", recording),
        ("render", recording, "-o", recording),
    ):
        outcome = adv2e(*arguments, "--overwrite")
        assert outcome.status in (1, 2), arguments
        assert "is read and would be lost" in outcome.err or "a film ends in" in outcome.err
    outcome = adv2e("convert", folder, "--fps", 100, "-o", folder.parent, "--overwrite")
    assert outcome.status == 1
    assert "holds the input" in outcome.err
    assert (recording.read_bytes(), stamps.read_bytes()) == before


def inputs_of_all_kinds(root, folder):
    """Return commands of conversions and what each reads beside its input."""
    stack, model, effect = root / "s.npy", root / "model.yaml", root / "effect.py"
    np.save(stack, np.array([picture(k) for k in range(4)]))
    np.save(root / "s_ts.npy", np.arange(4) * 0.01)
    model.write_text("pixel: {leak: null}\n")
    effect.write_text(
        "from adv2e.effects.hooks import Hooks\n"
        "class Nothing(Hooks):\n    def events(self, chunks):\n        yield from chunks\n"
    )
    images = root / "images"
    shutil.copytree(folder / "images", images)
    (images / "timestamps.txt").write_text("0\n.01\n.02\n.03\n.04\n")
    (folder / "events.txt").write_text("100.0 1 1 1\n")
    frame = "frame_00000002.png"
    yield ("convert", stack), root / "s_ts.npy"
    yield ("convert", stack, "-c", model), model
    yield ("convert", stack, "--effect", effect), effect
    yield ("convert", images), images / frame
    yield ("convert", images), images / "timestamps.txt"
    for name in ("images.txt", "events.txt", f"images/{frame}"):
        yield ("convert", folder), folder / name
        yield ("render", folder), folder / name


@pytest.mark.parametrize("linked", ["", "hard", "symbolic"])
@pytest.mark.quick_cases(1)
def test_nothing_that_is_read_beside_the_input_is_written_over(adv2e, folder, tmp_path, linked):
    for command, read in list(inputs_of_all_kinds(tmp_path, folder)):
        target, before = read, read.read_bytes()
        if linked:
            target = tmp_path / "linked"
            target.unlink(missing_ok=True)
            target.hardlink_to(read) if linked == "hard" else target.symlink_to(read)
        options = ["-o", target, "--overwrite"]
        outcome = adv2e(
            *command, *options, *(["--format", "h5"] if command[0] == "convert" else [])
        )
        if command[0] == "render" and target.suffix != ".png":
            assert outcome.status == 2
        else:
            assert outcome.status == 1
            assert "would be lost; choose another name" in outcome.err
        assert read.read_bytes() == before, (command, read)


@pytest.mark.thorough
def test_lists_and_texts_are_read_again_where_the_output_is_replaced(adv2e, folder, tmp_path):
    text, stamps = tmp_path / "ev.txt", tmp_path / "stamps.txt"
    text.write_text("0.1 1 2 1\n0.2 3 4 0\n")
    stamps.write_text("0\n.01\n.02\n.03\n.04\n")
    for command in (
        ("convert", text, "-o", tmp_path / "a.h5"),
        ("render", text, "-o", tmp_path / "a.png"),
        ("convert", folder, "--timestamps", stamps, "-o", tmp_path / "b.h5"),
        ("export", text, "-o", tmp_path / "c", "--to", "voxel", "--count", "1"),
    ):
        for _ in range(2):
            assert adv2e(*command, "--overwrite", "-q") == (0, "", "")


def test_what_lies_beside_events_is_not_written_over(adv2e, folder, tmp_path):
    events, causes = tmp_path / "a.txt", tmp_path / "a.txt.causes.txt"
    assert adv2e("convert", folder, "-o", events, "--causes").status == 0
    for read in (causes, tmp_path / "a.txt.json"):
        outcome = adv2e("convert", events, "-o", read, "--format", "txt", "--overwrite")
        assert "is read and would be lost" in outcome.err


def test_what_lies_beside_the_input_and_is_not_read_may_be_written_over(adv2e, folder):
    for name in ("events.h5", "preview.png"):
        (folder / name).write_bytes(b"of before")
    more = ["--preview", folder / "preview.png", "--overwrite"]
    assert adv2e("convert", folder, "-o", folder / "events.h5", *more).status == 0
    assert len(read_events(folder / "events.h5").events) > 300


@pytest.mark.parametrize("existing", [False, True])
@pytest.mark.parametrize(
    ("output", "preview"), [("a.gif", "a.gif"), ("a.gif", "b/../a.gif"), ("a", "a/b.gif")]
)
def test_output_and_preview_are_two_files(adv2e, video, tmp_path, output, preview, existing):
    form = "folder" if output == "a" else "txt"
    if existing:
        assert adv2e("convert", video, "-o", tmp_path / output, "--format", form).status == 0
    (tmp_path / "b").mkdir()
    before = sorted(tmp_path.rglob("*"))
    outcome = adv2e(
        "convert", video, "-o", tmp_path / output, "--format", form,
        "--preview", tmp_path / preview, "--overwrite",
    )  # fmt: skip
    assert outcome.status == 1
    assert "choose another name" in outcome.err
    assert sorted(tmp_path.rglob("*")) == before


def test_a_preview_is_not_the_metadata_of_the_text(adv2e, video, tmp_path):
    (tmp_path / "a.gif.json").symlink_to("b.gif")
    options = ["--format", "txt", "--preview", tmp_path / "b.gif"]
    outcome = adv2e("convert", video, "-o", tmp_path / "a.gif", *options)
    assert (outcome.status, "is to be two outputs" in outcome.err) == (1, True)


def no_room(*args):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "fails",
    ["adv2e.formats.hdf5_writer.MonashWriter.finish", "adv2e.rendering.films.GifFile.finish"],
)
@pytest.mark.thorough
def test_events_and_preview_come_together_or_not_at_all(adv2e, video, tmp_path, monkeypatch, fails):
    target, preview = tmp_path / "out" / "a.h5", tmp_path / "out" / "a.gif"
    arguments = ("convert", video, "-o", target, "--preview", preview)
    with monkeypatch.context() as patch:
        patch.setattr(fails, no_room)
        outcome = adv2e(*arguments)
    assert outcome.status == 1
    assert "cannot be written: No space left on device" in outcome.err
    assert not target.parent.exists()
    assert adv2e(*arguments).status == 0
    before = target.read_bytes(), preview.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(fails, no_room)
        assert adv2e(*arguments, "--overwrite", "--seed", "2").status == 1
    assert (target.read_bytes(), preview.read_bytes()) == before
    assert sorted(path.name for path in target.parent.iterdir()) == ["a.gif", "a.h5"]


ODD = {
    "colon": "2024-05-01T12:30",
    "bytes": "\udcff\udce9x",
    "lines": "two\nlines",
    "pattern": "100%d",
    "long": "n" * 240,
    "spaces": " a b ",
    "marks": "e\u0301 \u00e9",
}


@pytest.mark.skipif(sys.platform != "linux", reason="file systems elsewhere refuse some names")
@pytest.mark.parametrize("name", ODD.values(), ids=ODD)
@pytest.mark.thorough
def test_any_name_that_the_system_takes(adv2e, video, tmp_path, name):
    folder = tmp_path / name[:40]
    folder.mkdir()
    clip = shutil.move(video, folder / f"{name}.avi")
    for suffix in ("", ".h5", ".zip", ".txt") if name == ODD["bytes"] else (".h5", ".txt"):
        target, preview = folder / f"{name}{suffix}", folder / f"{name}{suffix}.gif"
        outcome = adv2e("convert", clip, "-o", target, "--preview", preview)
        assert (outcome.status, len(outcome.out.splitlines())) == (0, 2), outcome.err
        recording = read_events(target)
        assert len(recording.events) > 300
        told = recording.metadata["source"]["name"]
        assert told == shown(clip.name)
        told.encode()  # fit for UTF-8
        beside = {f"{target.name}.json"} if suffix == ".txt" else set()
        made = {path.name for path in folder.iterdir()}
        assert made == {clip.name, target.name, preview.name} | beside
        for one in made - {clip.name}:
            shutil.rmtree(folder / one, ignore_errors=True)
            (folder / one).unlink(missing_ok=True)


@pytest.mark.skipif(sys.platform != "linux", reason="file systems elsewhere refuse some names")
def test_names_of_effects_and_configurations_are_stored_as_text(adv2e, video, tmp_path):
    effect, model = tmp_path / "\udcff.py", tmp_path / "\udcff\n.yaml"
    effect.write_text(
        "from adv2e.effects.hooks import Hooks\n"
        "class Nothing(Hooks):\n    def events(self, chunks):\n        yield from chunks\n"
    )
    model.write_text("seed: 3\n")
    arguments = ["convert", video, "--effect", effect, "-c", model]
    assert adv2e(*arguments, "-o", tmp_path / "a.txt").status == 0
    stored = json.loads((tmp_path / "a.txt.json").read_bytes().decode())
    assert stored["effects"][0]["file"] == "\\xff.py"
    assert names_of([model]) == "\\xff\\n.yaml"


@pytest.mark.thorough
def test_a_name_that_begins_with_a_dash(adv2e, video, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    video.rename("-v.avi")
    outcome = adv2e("convert", "-o", "-o.h5", "--preview", "-p.gif", "--", "-v.avi")
    assert outcome.status == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["-o.h5", "-p.gif", "-v.avi"]


@pytest.mark.parametrize(("suffix", "length"), [(".h5", 253), (".txt", 248)])
def test_a_name_that_is_too_long_is_told_before_the_work(
    adv2e, video, tmp_path, monkeypatch, suffix, length
):
    monkeypatch.setattr(conversion, "events_from_light", None)
    outcome = adv2e("convert", video, "-o", tmp_path / ("n" * length + suffix))
    assert outcome.status == 1
    assert "name too long" in outcome.err
    assert list(tmp_path.iterdir()) == [video]


@pytest.mark.skipif(sys.platform == "win32", reason="files of POSIX")
@pytest.mark.parametrize("stderr", ["full", "closed"])
@pytest.mark.thorough
def test_what_is_written_is_done_though_nothing_can_be_said(video, tmp_path, stderr):
    if stderr == "full" and not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    target = tmp_path / "a.h5"
    code = "from adv2e.__main__ import main; main()"
    preview = ["--preview", f"{tmp_path}/a.gif"]
    arguments = ["convert", str(video), "-o", str(target), "-v", "--progress", *preview]
    with open("/dev/full" if stderr == "full" else os.devnull, "wb") as full:  # noqa: PTH123
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            stderr=full,
            stdout=subprocess.PIPE,
            preexec_fn=(lambda: os.close(2)) if stderr == "closed" else None,
            check=False,
        )
    assert done.returncode == 0
    assert b"events" in done.stdout
    assert len(read_events(target).events) > 300


def test_floats_far_above_white_are_told_before_any_work(adv2e, tmp_path):
    np.save(tmp_path / "a.npy", np.array([picture(k) for k in range(4)], np.float32))
    arguments = ("convert", tmp_path / "a.npy", "--fps", 100, "-o", tmp_path / "a.txt")
    outcome = adv2e(*arguments)
    assert outcome.status == 1
    assert "where 1 is white; say what is, with frames.full_scale=255" in outcome.err
    assert adv2e(*arguments, "--set", "frames.full_scale=255").status == 0


def test_info_and_compare_take_what_convert_makes(adv2e, folder, tmp_path):
    adv2e("convert", folder, "-o", tmp_path / "a.h5", "--with-frames")
    adv2e("convert", folder, "-o", tmp_path / "b.zip", "--seed", "1")
    shutil.rmtree(folder)
    info = json.loads(adv2e("info", tmp_path / "a.h5", "--json").out)
    assert info
    outcome = adv2e("compare", tmp_path / "b.zip", tmp_path / "a.h5", "--json")
    assert outcome.status == 0, outcome.err
    assert json.loads(outcome.out)


@pytest.mark.parametrize("begin_s", [5000, 1_700_000_000])  # beyond 2^31 us, and the time of day
@pytest.mark.parametrize("name", ["a.txt", "a.h5", "a.zip", "a"])
def test_late_times_stay_exact_to_the_microsecond(adv2e, tmp_path, begin_s, name):
    frames = [picture(k) for k in range(4)]
    times_ns = [begin_s * 10**9 + 33_333_333 * k for k in range(4)]
    np.save(tmp_path / "stack.npy", np.stack(frames))
    lines = [f"{t // 10**9}.{t % 10**9:09d}\n" for t in times_ns]
    (tmp_path / "times.txt").write_text("".join(lines))
    outcome = adv2e(
        "convert", tmp_path / "stack.npy", "--timestamps", tmp_path / "times.txt",
        "--set", "frames.encoding=linear", "-o", tmp_path / name,
    )  # fmt: skip
    assert outcome.status == 0, outcome.err

    light = [(t, frame.astype(np.float32)) for t, frame in zip(times_ns, frames, strict=True)]
    expected = np.concatenate(list(events_from_light(light, load_config(), threads=1)))
    assert expected["t"].min() >= begin_s * 10**6
    assert expected["t"].max() > begin_s * 10**6 + 60_000
    assert read_events(tmp_path / name).events.tobytes() == expected.tobytes()


@pytest.mark.parametrize("interpolation", ["linear", "flow"])
@pytest.mark.parametrize("L", [1, 3])
def test_grey_frames_make_the_events_of_their_light(adv2e, tmp_path, L, interpolation):
    """However the grey values are decoded: ahead of the pixel, or by the kernel."""
    frames = [picture(k, (48, 64)) for k in range(4)]
    np.save(tmp_path / "stack.npy", np.stack(frames))
    sets = [
        "frames.encoding=linear", f"sampling.L={L}", f"sampling.interpolation={interpolation}",
    ]  # fmt: skip
    options = [text for one in sets for text in ("--set", one)]
    outcome = adv2e(
        "convert", tmp_path / "stack.npy", "--fps", "10", "-o", tmp_path / "a.txt", *options
    )
    assert outcome.status == 0, outcome.err
    light = [(k * 10**8, frame.astype(np.float32)) for k, frame in enumerate(frames)]
    expected = np.concatenate(list(events_from_light(light, load_config([], sets), threads=1)))
    assert expected.size > 1000
    assert read_events(tmp_path / "a.txt").events.tobytes() == expected.tobytes()


@pytest.mark.parametrize("count", [0, 1, 100, 101, 1000])
def test_a_burst_is_written_in_pieces_that_hold_no_more_than_themselves(monkeypatch, count):
    events = empty_events(count)
    monkeypatch.setattr(conversion, "BEHIND_BYTES", 100 * events.itemsize)
    events["t"] = np.arange(count)
    pieces = list(conversion._pieces(events))
    assert np.concatenate(pieces).tobytes() == events.tobytes()
    if count > 100:
        assert max(piece.size for piece in pieces) == 25
        assert not any(np.shares_memory(piece, events) for piece in pieces)
    else:
        assert pieces[0] is events


@pytest.mark.parametrize("name", ["a.txt", "a.h5", "a.zip"])
def test_files_do_not_depend_on_the_size_of_the_pieces(adv2e, folder, tmp_path, monkeypatch, name):
    adv2e("convert", folder, "-o", tmp_path / name, "--threads", "2")
    whole = (tmp_path / name).read_bytes()
    monkeypatch.setattr(conversion, "BEHIND_BYTES", 2000)
    adv2e("convert", folder, "-o", tmp_path / name, "--threads", "2", "--overwrite")
    assert (tmp_path / name).read_bytes() == whole


@pytest.mark.parametrize(
    ("threads", "output", "expected"),
    [
        ("1", "a.h5", set()),
        ("1", "-", set()),
        ("2", "a.h5", {"adv2e-read", "adv2e-write"}),
        ("2", "-", {"adv2e-read"}),  # a write that blocks can be interrupted in the main thread
    ],
)
def test_one_thread_computes_where_one_is_asked_for(
    adv2e, video, tmp_path, monkeypatch, threads, output, expected
):
    names = set()
    start = threading.Thread.start

    def noted(thread):
        if thread.name != "import of Numba":
            names.add(thread.name.split("_")[0])
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", noted)
    monkeypatch.chdir(tmp_path)
    assert adv2e("convert", video, "-o", output, "--threads", threads, "--no-progress").status == 0
    ours = {name for name in names if name.startswith("adv2e-")}
    assert ours == expected
    if threads == "1":  # that of the pixel, as the main thread cannot be interrupted in its code
        assert len(names) == 1


@pytest.mark.parametrize(("part", "total"), [([], 6), (["--start", "0.03", "--stop", "0.1"], 3)])
def test_progress_counts_the_frames_wanted(adv2e, video, tmp_path, part, total):
    outcome = adv2e("convert", video, "-o", tmp_path / "a.h5", "--progress", *part)
    assert outcome.status == 0
    assert f"/{total} [" in outcome.err


def test_progress_counts_the_events(adv2e, video, tmp_path, monkeypatch):
    monkeypatch.setattr("tqdm.tqdm", partial(tqdm.tqdm, mininterval=0))  # every frame is shown
    outcome = adv2e("convert", video, "-o", tmp_path / "a.txt", "--progress", "--threads", "1")
    told = [int(n.replace(",", "")) for n in re.findall(r" ([\d,]+) events\]", outcome.err)]
    assert told == sorted(told)
    assert 0 < told[-1] <= len((tmp_path / "a.txt").read_text().splitlines())


def test_a_failure_is_told_in_a_line_of_its_own(adv2e, tmp_path):
    frames = np.full((3, 6, 8), 0.5, np.float32)
    frames[2, 0, 0] = np.nan
    np.save(tmp_path / "a.npy", frames)
    outcome = adv2e("convert", tmp_path / "a.npy", "--fps", "30", "--progress", "-o", "-")
    assert outcome.status == 1
    # a bar of compiling, if there was one, is cleared by moving the cursor up
    last = re.split(r"[\r\n]|\x1b\[A", outcome.err.removesuffix("\n"))[-1]
    assert re.match(r"adv2e: error: .*frame 2", last), outcome.err


def test_the_summary_counts_in_sentences(adv2e, video, tmp_path):
    out = adv2e("convert", video, "-o", tmp_path / "a.txt").out
    assert re.fullmatch(
        r".*a\.txt: [\d,]+ events \(\d+\.\d % ON\) from 6 frames, on 32x24 pixels, over 0\.167 s\n"
        r"[\d.]+ events a pixel a second; made in \d+\.\d s\n",
        out,
    )


def asking(model, *more):
    sets = ("sampling.interpolation=onnx", f"sampling.model={model}", *more)
    return [word for one in sets for word in ("--set", one)]


def test_a_network_is_told_and_recorded(adv2e, video, tmp_path):
    model = onnx_models.blend(tmp_path / "blend.onnx", encoding="gamma:2.2")
    outcome = adv2e("convert", video, "-o", tmp_path / "a.txt", *asking(model))
    assert outcome.status == 0, outcome.err
    assert "frames in between are made by blend.onnx: grey, gamma:2.2, at any time" in outcome.err
    record = json.loads((tmp_path / "a.txt.json").read_text())
    digest = hashlib.sha256(Path(model).read_bytes()).hexdigest()
    assert record["network"] == {"file": "blend.onnx", "sha256": digest}
    assert record["versions"]["onnxruntime"] == importlib.metadata.version("onnxruntime")
    assert record["config"]["sampling"]["model"] == model
    adv2e("convert", video, "-o", tmp_path / "b.txt", *asking(model), "--threads", "1")
    assert (tmp_path / "b.txt").read_bytes() == (tmp_path / "a.txt").read_bytes()
    adv2e("convert", video, "-o", tmp_path / "linear.txt")
    assert "network" not in json.loads((tmp_path / "linear.txt.json").read_text())


def test_a_network_that_is_none_leaves_nothing(adv2e, video, tmp_path):
    model = tmp_path / "torn.onnx"
    model.write_bytes(b"\x08\x08 torn")
    outcome = adv2e("convert", video, "-o", tmp_path / "a.h5", *asking(model))
    assert outcome.status == 1
    assert outcome.err.strip().count("\n") == 0
    assert f"sampling.model: {model}: is no network that can be run" in outcome.err
    assert not (tmp_path / "a.h5").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clip.avi", "torn.onnx"]
