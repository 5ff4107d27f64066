from __future__ import annotations

import cv2
import numpy as np
import pytest

from adv2e.events import make_events
from adv2e.formats.writing import open_sink


@pytest.fixture
def recording(tmp_path):
    """Return an event file of 1 s with frames."""
    path = tmp_path / "clip.h5"
    times = np.arange(0, 1_000_000, 500)
    events = make_events(times, times // 500 % 32, times // 500 % 24, times // 1000 % 2)
    with open_sink(path, width=32, height=24, metadata={}, with_frames=True) as sink:
        for k in range(10):
            sink.write_frame(k * 100_000_000, np.full((24, 32), 20 * k, np.uint8))
            sink.write_events(events[200 * k : 200 * (k + 1)])
    return path


def levels(path):
    """Return the picture as RGB."""
    return cv2.imread(str(path))[:, :, ::-1]


@pytest.mark.parametrize("name", ["out.mp4", "out.avi", "out.gif", "out.png"])
@pytest.mark.quick_cases(1)
def test_makes_the_file_and_says_so(adv2e, recording, tmp_path, name):
    path = tmp_path / name
    outcome = adv2e("render", recording, "-o", path, "--fps", 10)
    assert outcome.status == 0
    assert outcome.err == f"{path}: written\n"
    assert path.stat().st_size > 500
    assert sorted(tmp_path.iterdir()) == sorted([recording, path])


def test_film_options(adv2e, recording, tmp_path):
    path = tmp_path / "out.avi"
    options = ["--fps", 20, "--speed", 0.5, "--start", 0.2, "--stop", 0.6, "--no-beside"]
    assert adv2e("render", recording, "-o", path, "--scale", 2, *options).status == 0
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 16
    assert video.get(cv2.CAP_PROP_FRAME_WIDTH) == 64


def test_colours_window_and_instants(adv2e, recording, tmp_path):
    path = tmp_path / "out.png"
    colours = ["--on-color", "#00ff00", "--off-color", "purple", "--scale", 1, "--no-beside"]
    # from 0.25 to 0.5 s there are 500 events, 8 ms: 16
    adv2e("render", recording, "-o", path, "--at", 0.5, "--window", 8, *colours)
    picture = levels(path)[34:]
    assert np.count_nonzero(np.all(picture == (0, 255, 0), axis=2)) == 8
    assert np.count_nonzero(np.all(picture == (130, 50, 170), axis=2)) == 8


def test_style(adv2e, recording, tmp_path):
    path = tmp_path / "out.png"
    adv2e("render", recording, "-o", path, "--style", "black", "--count", 1, "--scale", 4)
    assert levels(path).mean() < 80


def test_frames_are_shown_unless_not_wanted(adv2e, recording, tmp_path):
    for name, option in (("with.png", "--beside"), ("without.png", "--no-beside")):
        adv2e("render", recording, "-o", tmp_path / name, option, "--count", 1, "--scale", 1)
    assert levels(tmp_path / "with.png").shape[1] > levels(tmp_path / "without.png").shape[1] + 30


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ([], "-o is missing"),
        (["-o", "out.mov"], "out.mov: a film ends in"),
        (["-o", "out.png", "--on-color", "rouge"], "colour 'rouge'"),
        (["-o", "out.png", "--style", "pink"], "'pink'"),
        (["-o", "out.mp4", "--at", "1"], "out.mp4: instants (--at) are for a .png"),
        (["-o", "out.mp4", "--start", "2", "--stop", "1"], "--stop 1 must be after --start 2"),
        (["-o", "out.gif", "--fps", "60"], "at most 50"),
        (["-o", "out.png", "--window", "0"], "--window"),
    ],
)
def test_wrong_command_lines(adv2e, recording, tmp_path, monkeypatch, options, text):
    monkeypatch.chdir(tmp_path)
    outcome = adv2e("render", recording, *options)
    assert outcome.status == 2
    assert text in outcome.err
    assert outcome.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [recording]


def test_output_that_exists(adv2e, recording, tmp_path):
    path = tmp_path / "out.png"
    path.write_text("mine")
    outcome = adv2e("render", recording, "-o", path)
    assert outcome.status == 1
    assert "out.png: exists" in outcome.err
    assert path.read_text() == "mine"
    assert adv2e("render", recording, "-o", path, "--overwrite").status == 0
    assert levels(path).size > 0


def test_missing_recording(adv2e, tmp_path):
    outcome = adv2e("render", tmp_path / "absent.h5", "-o", tmp_path / "out.png")
    assert outcome.status == 1
    assert "absent.h5" in outcome.err
    assert list(tmp_path.iterdir()) == []
