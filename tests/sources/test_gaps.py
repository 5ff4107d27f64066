"""Gaps between frames are told."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e.sources import open_source
from adv2e.sources.times.gaps import gap_doubts

MS = 10**6


def test_a_gap_says_where_and_how_long():
    times = [n * 40 * MS + (n >= 7) * 1500 * MS for n in range(20)]
    assert gap_doubts(times, "a.mp4") == [
        "a.mp4: no frame for 1.54 s between frames 6 and 7; usual are 0.04 s"
    ]
    times += [times[-1] + 9 * 10**9]
    (told,) = gap_doubts(times, "a.mp4")
    assert "no frame for 9 s between frames 19 and 20 (2 such gaps; this is the longest)" in told


@pytest.mark.parametrize(
    "times",
    [
        [],
        [0, 10**10],
        [0, 10**10, 2 * 10**10],  # pictures of a slow process
        [0, 10**9, 2 * 10**9, 4 * 10**9],
        [0, 33 * MS, 66 * MS, 400 * MS],  # a frame here and there was left out
    ],
)
def test_usual_steps_are_no_gaps(times):
    assert gap_doubts(times, "a") == []


def test_a_fast_camera_that_paused():
    times = [n * MS for n in range(9)]
    assert gap_doubts([*times, 40 * MS], "a") != []


def test_gaps_in_given_times_are_told(write_video, picture, tmp_path):
    path = write_video("clip.avi", [picture(n, (24, 32, 3)) for n in range(5)])
    times = tmp_path / "t.txt"
    times.write_text("0\n0.1\n0.2\n5\n5.1\n")
    (told,) = open_source(path, timestamps=times).doubts
    assert told == f"{times}: no frame for 4.8 s between frames 2 and 3; usual are 0.1 s"
    assert open_source(path).doubts == []


@pytest.mark.parametrize("kind", ["npy", "images"])
def test_gaps_of_other_sources_are_told(write_images, picture, tmp_path, kind):
    pictures = [picture(n) for n in range(5)]
    times = tmp_path / "t.txt"
    times.write_text("0\n0.1\n0.2\n5\n5.1\n")
    path = tmp_path / "stack.npy"
    np.save(path, np.stack(pictures))
    path = path if kind == "npy" else write_images(pictures)
    source = open_source(path, timestamps=times)
    assert source.doubts == [f"{path}: no frame for 4.8 s between frames 2 and 3; usual are 0.1 s"]
    assert open_source(path, fps=10).doubts == []
