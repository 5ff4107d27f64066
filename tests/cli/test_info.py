from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from adv2e.events import make_events
from adv2e.formats.writing import open_sink

KEYS = [
    "file",
    "label",
    "layout",
    "width",
    "height",
    "events",
    "frames",
    "problems",
    "notes",
    "metadata",
]


@pytest.fixture
def event_file(tmp_path):
    """Events of 8x6 pixels every 10 us, with two frames, as a file of ours."""
    path = tmp_path / "clip.events.h5"
    t = np.arange(100) * 10 + 20
    events = make_events(t, np.arange(100) % 8, np.arange(100) // 8 % 6, np.arange(100) % 4 == 0)
    metadata = {"adv2e": "0.1.0", "seed": 12, "config": {"seed": 12}, "source": {"name": "a.mp4"}}
    with open_sink(path, width=8, height=6, metadata=metadata, with_frames=True) as sink:
        sink.write_frame(0, np.zeros((6, 8), np.uint8))
        sink.write_events(events)
        sink.write_frame(40_000_000, np.zeros((6, 8), np.uint8))
    return path


@pytest.fixture
def images(tmp_path):
    folder = tmp_path / "clip"
    folder.mkdir()
    for n in range(3):
        cv2.imwrite(str(folder / f"{n}.png"), np.full((5, 7), 40 * n, np.uint8))
    return folder


def test_an_event_file_is_told_in_two_columns(adv2e, event_file):
    status, out, _ = adv2e("info", event_file)
    assert status == 0
    rows = dict(line.split(maxsplit=1) for line in out.splitlines() if not line.startswith("made"))
    assert rows["pixels"] == "8 x 6"
    assert rows["events"] == "100 (25 ON, 75 OFF)"
    assert "0.00002 to 0.00101 s (0.00099 s)" in out
    assert rows["tick"] == "10 us"
    assert rows["rate"].startswith("101,010 events/s")
    assert rows["seed"] == "12"
    assert "made by     adv2e 0.1.0" in out
    assert "made from   a.mp4" in out
    assert "25 Hz, intervals of 40 ms" in out


def test_json_has_the_same_keys_for_events_and_for_frames(adv2e, event_file, images):
    of_events = json.loads(adv2e("info", event_file, "--json").out)
    of_frames = json.loads(adv2e("info", images, "--json", "--fps", "50").out)
    assert list(of_events) == list(of_frames) == KEYS
    assert of_events["layout"] == "monash"
    assert of_events["events"]["on_share"] == 0.25
    assert of_events["events"]["tick_us"] == 10
    assert of_events["events"]["rate_per_pixel_hz"] == pytest.approx(100 / 0.00099 / 48)
    assert of_events["metadata"]["config"] == {"seed": 12}
    assert of_frames["events"] is None
    frames = of_frames["frames"]
    assert (frames["count"], frames["rate_hz"], frames["dtype"]) == (3, 50, "uint8")
    assert (frames["colour"], frames["encoding"]) == (False, "srgb")
    assert (frames["first_ns"], frames["last_ns"]) == (0, 40_000_000)


def test_frames_alone_are_told_as_text(adv2e, images):
    out = adv2e("info", images, "--fps", "50").out
    assert "pixels      7 x 5" in out
    assert "frames      3 of uint8, grey" in out
    assert "frame rate  50 Hz, intervals of 20 ms" in out


def test_intervals_that_rounding_alone_makes_different_are_one(adv2e, images):
    out = adv2e("info", images, "--fps", "300").out
    assert "frame rate  300 Hz, intervals of 3.33333 ms" in out
    (images / "times.txt").write_text("0\n0.25\n1\n")
    assert (
        "intervals of 250 to 750 ms"
        in adv2e("info", images, "--timestamps", images / "times.txt").out
    )


def test_a_recording_folder_with_events_is_told_with_both(adv2e, images):
    images.rename(images.parent / "images")
    folder = images.parent / "real"
    folder.mkdir()
    (images.parent / "images").rename(folder / "images")
    lines = [f"{100 + 0.05 * n:.9f} images/{n}.png\n" for n in range(3)]
    (folder / "images.txt").write_text("".join(lines))
    (folder / "events.txt").write_text("100.000001 0 0 1\n100.020000 6 4 0\n")
    report = json.loads(adv2e("info", folder, "--json").out)
    assert (report["layout"], report["width"], report["height"]) == ("davis240c", 7, 5)
    assert report["events"]["first_us"] == 100_000_001
    assert report["frames"]["last_ns"] == 100_100_000_000


def test_images_without_times_say_what_to_give(adv2e, images):
    status, out, err = adv2e("info", images)
    assert (status, out) == (1, "")
    assert "--fps" in err


def test_a_missing_file_is_one_line_and_status_1(adv2e, tmp_path):
    status, out, err = adv2e("info", tmp_path / "none.h5")
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert "none.h5: no such file" in err


def test_a_broken_zip_is_one_line_and_status_1(adv2e, tmp_path):
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04 and no more")
    status, _, err = adv2e("info", tmp_path / "a.zip")
    assert status == 1
    assert err.count("\n") == 1
    assert "a.zip" in err


def test_progress_is_told_apart_from_what_is_found(adv2e, event_file):
    told = adv2e("info", event_file, "--progress", "--json")
    assert json.loads(told.out) == json.loads(adv2e("info", event_file, "--json").out)
    assert "reading clip.events.h5: " in told.err
    assert "sorting and counting: 100%" in told.err
    assert adv2e("info", event_file).err == ""  # as standard error is no terminal


def test_progress_counts_the_frames_of_a_source(adv2e, images):
    err = adv2e("info", images, "--fps", "50", "--progress").err
    assert "reading clip: " in err
    assert "100%" in err


@pytest.mark.parametrize("command", ["compare", "render"])
def test_other_commands_tell_the_reading_too(adv2e, event_file, command):
    more = {
        "compare": [event_file, "--window", "0.0005"],
        "render": ["-o", event_file.with_suffix(".png")],
    }[command]
    outcome = adv2e(command, event_file, *more, "--progress")
    assert outcome.status == 0
    assert "sorting and counting: 100%" in outcome.err


@pytest.mark.parametrize(
    "options",
    [("--fps", "10"), ("--timestamps", "none.txt"), ("--bayer", "RGGB"), ("--allow-damaged",)],
)
def test_options_of_frames_are_not_ignored_for_events(adv2e, event_file, options):
    outcome = adv2e("info", event_file, *options)
    assert outcome.status == 1
    assert outcome.err.rstrip().endswith(f"its events are described: leave {options[0]} out")


def test_a_size_is_of_raw_video_alone(adv2e, images):
    assert adv2e("info", images, "--fps", 10, "--size", "8x6").status == 2
