from __future__ import annotations

import re

import cv2
import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.conversion import demo as module
from adv2e.formats.reading import read_events


@pytest.fixture
def small(monkeypatch):
    """Make the demonstration small enough for a test."""
    monkeypatch.setattr(module, "WIDTH", 64)
    monkeypatch.setattr(module, "HEIGHT", 48)
    monkeypatch.setattr(module, "DURATION_S", 1.0)
    monkeypatch.setattr("adv2e.rendering.films.default_scale", lambda width: 2)
    monkeypatch.setattr(module, "INSTANTS_S", (0.2, 0.4, 0.7, 0.9))


FILES = [
    *("clip.avi", "clip.events.h5", "clip.events.mp4", "clip.events.png"),
    *("declared.yaml", "recording.zip"),
]


def test_makes_clip_events_picture_and_film_and_says_what(adv2e, small, tmp_path):
    folder = tmp_path / "new" / "demo"
    outcome = adv2e("demo", "-o", folder, "--threads", 1)
    assert outcome.status == 0, outcome.err
    for name in FILES:
        assert name in outcome.out
        assert (folder / name).stat().st_size > 100
    recording = read_events(folder / "clip.events.h5")
    events = recording.events
    assert (recording.width, recording.height) == (64, 48)
    assert f"{events.size:,} events" in outcome.out
    share = float(re.search(r"([\d.]+) % of them ON", outcome.out)[1])
    assert share == pytest.approx(100 * events["p"].mean(), abs=0.06)
    assert recording.frame_times_ns.size == 30
    # it moves up to 0.64 s and then rests
    moving = np.count_nonzero((events["t"] > 200_000) & (events["t"] < 400_000))
    resting = np.count_nonzero((events["t"] > 750_000) & (events["t"] < 950_000))
    assert moving > 10 * resting
    assert cv2.imread(str(folder / "clip.events.png")).shape[1] > 600

    # the sample recording is not what its declared model makes: its pixels are dead for longer
    sample = read_events(folder / "recording.zip")
    declared = load_config(folder / "declared.yaml", "frames.encoding=linear", seed=9)
    frames = [frame.image for frame in sample.frames()]
    times = sample.frame_times_ns * 1e-9
    simulated = np.concatenate(list(simulate(frames, times, declared)))
    assert len(simulated) > 1.3 * len(sample.events) > 10_000
    truth = load_config(declared, module.UNDECLARED)
    simulated = np.concatenate(list(simulate(frames, times, truth)))
    assert len(simulated) == pytest.approx(len(sample.events), rel=0.01)

    # the film is that of the file: nothing was drawn before it had come
    assert adv2e("render", folder / "clip.events.h5", "-o", tmp_path / "film.mp4").status == 0
    assert (folder / "clip.events.mp4").read_bytes() == (tmp_path / "film.mp4").read_bytes()

    # again: the same events, and what is not ours is kept
    (folder / "mine.txt").write_text("mine")
    outcome = adv2e("demo", "-o", folder, "-q", "--threads", 1)
    assert outcome.status == 1
    assert "clip.avi: exists already; --overwrite replaces it" in outcome.err
    assert adv2e("demo", "-o", folder, "-q", "--threads", 1, "--overwrite").out == ""
    assert np.array_equal(read_events(folder / "clip.events.h5").events, events)
    assert sorted(path.name for path in folder.iterdir()) == sorted([*FILES, "mine.txt"])


def test_a_file_in_place_of_the_folder(adv2e, tmp_path):
    (tmp_path / "demo").write_text("mine")
    outcome = adv2e("demo", "-o", tmp_path / "demo")
    assert outcome.status == 1
    assert "is not a folder" in outcome.err
    assert (tmp_path / "demo").read_text() == "mine"
