"""Which of several tracks, streams or topics is read: the user's choice, else the usual one."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest

from adv2e import EVENT_DTYPE as EVENT
from adv2e import convert, read_events, write_events
from adv2e.errors import DataError
from adv2e.formats.reading import open_events
from adv2e.sources import open_source
from adv2e.sources.frame import Track, choose

EVENTS = [
    Track("DAVIS_1/denoised", "100 events"),
    Track("DAVIS_1/events", "400 events", is_usual=True),
    Track("DAVIS_2/events", "7 events", is_usual=True),
]
FRAMES = [Track("DAVIS_1/frames", "3 frames", is_usual=True), Track("DAVIS_2/frames")]
LIST = (
    "0 = DAVIS_1/denoised (100 events), 1 = DAVIS_1/events (400 events), 2 = DAVIS_2/events"
    " (7 events)"
)


def test_the_usual_stream_is_taken_unasked_and_told():
    event, frame, told = choose(None, EVENTS, FRAMES, "a")
    assert (event, frame) == (1, 0)
    assert told == [
        f"3 streams of events: {LIST}: 1 = DAVIS_1/events is taken, --track chooses another",
        "2 tracks of frames: DAVIS_1/frames (3 frames), DAVIS_2/frames: DAVIS_1/frames is taken,"
        " --track chooses another",
    ]


@pytest.mark.parametrize(
    ("wanted", "event", "frame"),
    [
        ("0", 0, 0),
        ("2", 2, 1),
        ("denoised", 0, 0),
        ("DAVIS_1/events", 1, 0),
        ("/DAVIS_1/events", 1, 0),
        ("DAVIS_2", 2, 1),
        ("DAVIS_2/frames", 2, 1),
        ("DAVIS_1/frames", 1, 0),
    ],
)
def test_one_that_is_named_comes_with_the_frames_of_its_camera(wanted, event, frame):
    assert choose(wanted, EVENTS, FRAMES, "a")[:2] == (event, frame)


def test_nothing_is_told_of_a_choice_that_the_user_made():
    assert choose("denoised", EVENTS, FRAMES, "a")[2] == []
    assert choose("2", EVENTS, FRAMES, "a")[2] == []


def test_a_name_of_several_leaves_the_choice_among_them_which_is_told():
    event, _, told = choose("events", EVENTS, FRAMES, "a")
    assert event == 1
    assert told[0].endswith("1 = DAVIS_1/events is taken, --track chooses another")


def test_a_camera_without_frames_gets_none_of_another():
    assert choose("DAVIS_2", EVENTS, FRAMES[:1], "a")[:2] == (2, None)


def test_frames_of_the_only_other_camera_are_taken():
    topics = [Track("/dvs/events")], [Track("/camera/image_raw")]
    assert choose(None, *topics, "a") == (0, 0, [])


def test_empty_ones_come_last():
    both = [Track("a/events", is_usual=True, is_empty=True), Track("b/other")]
    assert choose(None, both, [], "a")[0] == 1


@pytest.mark.parametrize("wanted", ["3", "-1", "00", "nothing", "DAVIS", "vents", "/", "1.0"])
def test_what_is_not_there_is_an_error_that_lists_what_is(wanted):
    text = f"a: --track {wanted}: it holds no such track, but {LIST}, DAVIS_1/frames (3 frames)"
    with pytest.raises(DataError, match=re.escape(text)):
        choose(wanted, EVENTS, FRAMES, "a")


def test_frames_alone_are_counted_themselves():
    assert choose("1", [], FRAMES, "a")[:2] == (None, 1)
    with pytest.raises(DataError, match=r"it holds no such track, but 0 = DAVIS_1/frames"):
        choose("2", [], FRAMES, "a")


@pytest.mark.parametrize("name", ["a.txt", "a.h5", "a.csv", "a.npz", "a.raw", "a.dat", "a.es"])
def test_files_of_one_stream_take_no_other(tmp_path, name):
    events = np.zeros(3, EVENT)
    events["t"] = 1, 2, 3
    write_events(tmp_path / name, events, (4, 3))
    assert open_events(tmp_path / name, track=0).facts.problems == []
    assert len(read_events(tmp_path / name, track="events").events) == 3
    with pytest.raises(
        DataError, match=rf"{name}: track=1: it holds no such track, but 0 = events"
    ):
        read_events(tmp_path / name, track=1)
    with pytest.raises(DataError, match=r"track right: it holds no such track, but 0 = events"):
        convert(tmp_path / name, tmp_path / "b.txt", track="right")


def test_pictures_are_one_track(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((2, 3, 4), np.uint8))
    assert open_source(tmp_path / "a.npy", fps=10, track=0).count == 2
    with pytest.raises(
        DataError, match=r"a\.npy: --track 1: it holds no such track, but 0 = frames"
    ):
        open_source(tmp_path / "a.npy", fps=10, track=1)


@pytest.mark.parametrize("option", ["--track", "--stream", "--topic"])
@pytest.mark.parametrize(
    "command",
    [
        ["convert", "a.h5", "-o", "b.txt"],
        ["info", "a.h5"],
        ["render", "a.h5", "-o", "b.png"],
        ["compare", "a.h5", "a.h5"],
        ["export", "a.h5", "-o", "grids", "--to", "voxel", "--count", "2"],
        ["diagnose", "a.h5"],
    ],
)
def test_every_command_has_the_option(adv2e, tmp_path, monkeypatch, command, option):
    monkeypatch.chdir(tmp_path)
    events = np.zeros(3, EVENT)
    events["t"] = 1, 2, 3
    write_events("a.h5", events, (4, 3))
    outcome = adv2e(*command, option, "1")
    assert outcome.status == 1
    assert outcome.err.splitlines()[-1] == (
        "adv2e: error: a.h5: --track 1: it holds no such track, but 0 = events"
    )
    assert adv2e(*command, option, "").status == 2


@pytest.mark.thorough
def test_a_batch_has_one_rule_for_all(adv2e, tmp_path):
    for name in ("a", "b"):
        (tmp_path / "in" / name).mkdir(parents=True)
        for number in range(2):
            picture = np.zeros((3, 4), np.uint8)
            cv2.imwrite(str(tmp_path / "in" / name / f"{number}.png"), picture)
        (tmp_path / "in" / name / "timestamps.txt").write_text("0.1\n0.2\n")
    outcome = adv2e("batch", tmp_path / "in", tmp_path / "out", "--track", 1)
    assert outcome.status == 1
    assert outcome.err.count("--track 1: it holds no such track, but 0 = frames") >= 2
