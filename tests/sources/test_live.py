"""Cameras and addresses as inputs: real times, ends by hand, and nothing that was not allowed."""

from __future__ import annotations

import functools
import http.server
import json
import shutil
import signal
import sys
import threading
import time

import av
import numpy as np
import pytest
from processes import running_python
from video_files import written

from adv2e import DataError, UsageError, convert, info, read_events
from adv2e.sources import is_live, live, open_source

RATE = 50
CAMERA = f"testsrc=size=64x48:rate={RATE},realtime"
"""A film of FFmpeg's that comes in its own time, as of a camera."""


@pytest.fixture
def camera(monkeypatch):
    """Let cameras be that film."""
    monkeypatch.setattr(live, "device", lambda name: ("lavfi", CAMERA))


@pytest.fixture
def served(tmp_path):
    """Serve a folder on this machine: (folder, its address, what was asked for)."""
    asked = []

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, form, *arguments):
            asked.append(form % arguments)

    folder = tmp_path / "served"
    folder.mkdir()
    handler = functools.partial(Handler, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield folder, f"http://127.0.0.1:{server.server_port}", asked
        server.shutdown()
        thread.join()


def true_frames(count):
    """Return the first frames of the film, not paced, as FFmpeg hands them on."""
    with av.open(CAMERA.partition(",")[0], format="lavfi") as film:
        frames = film.decode(video=0)
        return [next(frames).to_ndarray(format="rgb24") for _ in range(count)]


@pytest.mark.parametrize("name", ["0", "/dev/video7"])
def test_a_camera_gives_its_frames_at_its_times_until_stop(camera, name):
    began = time.monotonic()
    source = open_source(name, stop_s=0.3)
    frames = list(source.frames())
    assert time.monotonic() - began >= 0.3
    assert [frame.t_ns for frame in frames] == [k * 10**9 // RATE for k in range(16)]
    for frame, true in zip(frames, true_frames(16), strict=True):
        assert np.array_equal(frame.image, true)
    assert (source.kind, source.has_clock, source.inputs) == ("camera", False, [])
    assert source.encoding == "srgb"
    assert "times of frames: it states" in source.notes


def test_a_camera_becomes_events_and_a_rate_replaces_its_times(camera, tmp_path):
    done = convert("0", tmp_path / "a.h5", stop_s=0.3)
    assert (done.frames, done.width, done.height) == (16, 64, 48)
    slower = convert("0", tmp_path / "b.h5", fps=25, stop_s=0.3)
    assert (slower.frames, slower.duration_s) == (8, pytest.approx(0.28))
    stack = tmp_path / "stack.npy"
    np.save(stack, np.stack(true_frames(16)))
    convert(stack, tmp_path / "c.h5", fps=RATE)
    events = read_events(tmp_path / "a.h5").events
    assert events.size > 100
    assert np.array_equal(events, read_events(tmp_path / "c.h5").events)


def test_frames_without_times_get_those_of_their_arrival(camera, monkeypatch):
    monkeypatch.setattr(live.LiveSource, "_decoded", untimed(live.LiveSource._decoded))
    source = open_source("0", stop_s=0.3)
    times = np.diff([frame.t_ns for frame in source.frames()]) / 1e9
    assert np.median(times) == pytest.approx(1 / RATE, rel=0.5)
    assert "times of frames: this computer's clock as they arrive" in source.notes


def untimed(decoded):
    def without(self, container):
        for frame in decoded(self, container):
            frame.pts = None
            yield frame

    return without


def test_what_was_lost_is_told(camera, monkeypatch):
    monkeypatch.setattr(live.LiveSource, "_decoded", with_gap(live.LiveSource._decoded))
    source = open_source("0", stop_s=1.0)
    assert len(list(source.frames())) < 25
    assert [note for note in source.notes if "no frame for" in note]


def with_gap(decoded):
    def without(self, container):
        return (f for k, f in enumerate(decoded(self, container)) if not 4 < k < 40)

    return without


@pytest.mark.skipif(sys.platform != "linux", reason="devices of Linux")
@pytest.mark.parametrize("name", ["99", "/dev/video99"])
def test_a_camera_that_is_not_there_is_one_line(adv2e, name):
    for command in ("convert", "info"):
        outcome = adv2e(command, name, "--stop", "1")
        assert outcome.status == 1
        assert outcome.err.splitlines() == [
            f"adv2e: error: {name}: no camera can be opened: No such file or directory"
        ]


def test_a_file_or_folder_that_is_called_like_a_camera_comes_first(tmp_path, monkeypatch, camera):
    monkeypatch.chdir(tmp_path)
    assert is_live("0")
    (tmp_path / "0").mkdir()
    assert not is_live("0")
    with pytest.raises(DataError, match="0: "):
        open_source("0", fps=10)
    assert not is_live("0000")


def test_options_that_a_camera_does_not_have_are_refused(camera, tmp_path):
    for options in ({"bayer": "RGGB"}, {"timestamps": tmp_path / "t.txt"}, {"time_unit": "s"}):
        with pytest.raises(DataError, match="0: its frames have times and colours of their own"):
            open_source("0", **options)
    with pytest.raises(UsageError, match="--motion moves before one picture"):
        open_source("0", motion="saccade")
    with pytest.raises(UsageError, match="0: a camera has no end: stop_s=S says when to stop"):
        info("0")


def test_info_describes_a_camera(camera):
    found = info("0", stop_s=0.3)
    assert found["layout"] == "camera"
    assert (found["width"], found["height"], found["frames"]["count"]) == (64, 48, 16)
    assert found["frames"]["rate_hz"] == pytest.approx(RATE)
    json.dumps(found)


PROGRAM = f"""
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a terminal
from adv2e.sources import live
live.device = lambda name: ("lavfi", {CAMERA!r})
from adv2e.__main__ import main
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ctrl_c_ends_a_camera_and_keeps_its_events(tmp_path):
    out = tmp_path / "out"
    with running_python(PROGRAM, "convert", "0", "-o", out / "a.h5", text=True) as process:
        wait_until_writing(out)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "adv2e: capture ended: what came is converted" in err
    recording = read_events(out / "a.h5")
    count = recording.metadata["ended_by_hand_after_frames"]
    assert f"0: ended by hand (Ctrl-C) after {count} frames" in err
    assert count > 10
    assert recording.events.size > 100
    assert recording.events["t"].max() <= (count - 1) * 10**6 // RATE


def wait_until_writing(folder):
    end = time.monotonic() + 120
    while not list(folder.glob(".adv2e.*/new*")):
        assert time.monotonic() < end
        time.sleep(0.02)


def test_addresses_need_leave(adv2e, served, tmp_path):
    folder, address, asked = served
    shutil.copy(written(tmp_path / "clip.ts", "mpeg4", 25), folder / "clip.ts")
    url = f"{address}/clip.ts"
    for command in (["convert", url, "-o", tmp_path / "a.h5"], ["info", url]):
        outcome = adv2e(*command)
        assert outcome.status == 1
        line = f"adv2e: error: {url}: an address: --network lets it be read, or download it first"
        assert outcome.err.splitlines() == [line]
    assert asked == []
    assert not (tmp_path / "a.h5").exists()
    done = convert(url, tmp_path / "a.h5", network=True)
    plain = convert(tmp_path / "clip.ts", tmp_path / "b.h5")
    assert asked
    assert done.frames == plain.frames
    events = [read_events(tmp_path / name).events for name in ("a.h5", "b.h5")]
    assert events[0].size > 100
    assert np.array_equal(*events)
    assert info(url, network=True)["layout"] == "network"


def test_an_address_does_not_open_files_of_this_computer(served, tmp_path):
    folder, address, asked = served
    secret = written(tmp_path / "secret.ts", "mpeg4", 25)
    text = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{}\n#EXT-X-ENDLIST\n"
    (folder / "list.m3u8").write_text(text.format(secret.as_uri()))
    (folder / "fair.m3u8").write_text(text.format("fair.ts"))
    shutil.copy(secret, folder / "fair.ts")
    with pytest.raises(DataError, match="no video"):
        open_source(f"{address}/list.m3u8", network=True)
    assert len(list(open_source(f"{address}/fair.m3u8", network=True).frames())) > 20
    for name in (secret.as_uri(), f"concat://{secret}", "lavfi://testsrc", f"subfile://{secret}"):
        with pytest.raises(DataError, match="no video can be opened"):
            open_source(name, network=True)
    assert any("fair.ts" in line for line in asked)


def test_a_password_is_not_told():
    address = "rtsp://me:secret@127.0.0.1:9/stream"
    for options in ({}, {"network": True}):
        with pytest.raises(DataError, match=r"^rtsp://127\.0\.0\.1:9/stream: ") as caught:
            open_source(address, **options)
        assert "secret" not in str(caught.value)


@pytest.mark.parametrize("name", ["0", "/dev/video0", "http://127.0.0.1:9/clip.mp4"])
def test_commands_that_need_a_recording_take_no_camera(adv2e, tmp_path, camera, name):
    events = tmp_path / "a.txt"
    events.write_text("0.000001000 1 1 1\n0.000002000 1 1 0\n")
    compared = adv2e("compare", events, events, "--frames", name)
    line = f"{name}: a camera or an address, which adv2e convert and info read alone"
    assert (compared.status, line in compared.err) == (1, True), compared.err
    batch = adv2e("batch", name, tmp_path / "out")
    assert batch.status != 0
    assert len(batch.err.splitlines()) == 1
