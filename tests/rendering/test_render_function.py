"""``adv2e.render``: from a file, a recording or an array; pictures are those of the command."""

from __future__ import annotations

import numpy as np
import pytest

import adv2e
from adv2e.errors import DataError, UsageError
from adv2e.events import make_events

SIZE = (16, 12)


@pytest.fixture
def events():
    times = np.arange(0, 400_000, 1000)
    return make_events(times, times // 1000 % 16, times // 1000 % 12, times // 2000 % 2)


def test_file_recording_and_array_give_the_same_picture(events, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    adv2e.write_events("events.h5", events, SIZE)
    given = {"at_s": [0.1, 0.3], "style": "grey", "window_ms": 30.0, "scale": 2}
    adv2e.render("events.h5", "a.png", **given)
    adv2e.render(adv2e.read_events("events.h5"), "b.png", **given)
    shuffled = np.random.default_rng(1).permutation(events)
    adv2e.render(shuffled, "c.png", size=SIZE, **given)
    assert len({(tmp_path / name).read_bytes() for name in ("a.png", "b.png", "c.png")}) == 1


def test_the_command_draws_the_same(events, adv2e, tmp_path, monkeypatch):
    import adv2e as package

    monkeypatch.chdir(tmp_path)
    package.write_events("events.h5", events, SIZE)
    given = ("--fps", "20", "--speed", "0.5", "--on-color", "green", "--scale", "2")
    assert adv2e("render", "events.h5", "-o", "a.avi", *given).status == 0
    package.render("events.h5", "b.avi", fps=20, speed=0.5, on_color="green", scale=2)
    assert (tmp_path / "a.avi").read_bytes() == (tmp_path / "b.avi").read_bytes()


@pytest.mark.parametrize(
    ("output", "given", "error", "text"),
    [
        ("a.png", {}, UsageError, "size: an array of events needs"),
        ("a.png", {"size": (4, 4)}, DataError, "events: number 4 has x 4, outside a sensor of 4x4"),
        ("a.doc", {"size": SIZE}, UsageError, r"a\.doc: a film ends in"),
        ("a.avi", {"size": SIZE, "at_s": [1]}, UsageError, r"a\.avi: instants \(at_s\) are for"),
        ("a.png", {"size": SIZE, "style": "pink"}, UsageError, "style: must be white, black"),
        ("a.avi", {"size": SIZE, "fps": 0}, UsageError, "fps: must be a number above 0, got 0"),
        ("a.png", {"size": SIZE, "window_ms": -2.5}, UsageError, "window_ms: must be a number"),
        ("a.png", {"size": SIZE, "scale": 33}, UsageError, "scale: must be at most 32, got 33"),
        ("a.png", {"size": SIZE, "count": 2.5}, UsageError, "count: must be a whole number"),
    ],
)
def test_what_cannot_be(events, tmp_path, output, given, error, text):
    with pytest.raises(error, match=text):
        adv2e.render(events, tmp_path / output, **given)
    assert list(tmp_path.iterdir()) == []


def test_how_to_read_is_said_of_files_alone(events, tmp_path):
    path = tmp_path / "events.h5"
    adv2e.write_events(path, events, SIZE)
    usual = adv2e.render(path, count=1, scale=1)
    wide = adv2e.render(path, count=1, scale=1, size=(SIZE[0] + 7, SIZE[1]))
    assert wide.shape[1] == usual.shape[1] + 7
    recording = adv2e.read_events(path)
    with pytest.raises(UsageError, match="size: is of the reading of a file"):
        adv2e.render(recording, size=SIZE)
    with pytest.raises(UsageError, match="time_unit: is of the reading of a file"):
        adv2e.render(events, size=SIZE, time_unit="us")
