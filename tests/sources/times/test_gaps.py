"""Frames that are missing are told."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from adv2e.sources import open_source
from adv2e.sources.times.rates import FrameRate, gap_doubts, numbering_doubt

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


# numbers in names


def doubt(*names, fps=240):
    return numbering_doubt([f"clip 1/{name}" for name in names], FrameRate(Fraction(fps)))


def test_numbers_that_rise_by_more_than_one_are_told_with_the_rate_they_suggest():
    told = doubt("000052.png", "000063.png", "000074.png", "000085.png")
    assert "the numbers in the frames' names are mostly 11 apart (000052.png, 000063.png)" in told
    assert "if all frames came at 240 a second, these come at 21.82: give --fps 240/11" in told


def test_a_rate_that_is_a_fraction():
    assert "give --fps 30000/2002" in doubt("2", "4", "6", fps=Fraction(30000, 1001))


def test_a_gap_is_told_with_its_place():
    told = doubt("1.png", "2.png", "3.png", "7.png", "8.png", "10.png")
    assert "frames are missing between 3.png and 7.png, and at 1 more places" in told
    assert "apart" not in told


def test_gaps_between_numbers_that_rise_by_more_than_one():
    told = doubt("2", "4", "6", "12")
    assert "mostly 2 apart" in told
    assert "missing between 6 and 12" in told


@pytest.mark.parametrize(
    "names",
    [
        ["1.png", "2.png", "3.png"],
        ["frame_09.png", "frame_10.png", "frame_11.png"],
        ["a.png", "b.png"],
        ["l1.png", "r1.png", "l2.png"],
        ["1_7.png", "2_9.png"],
        ["0.png"],
        ["1403636579763555584.png", "1403636579813555456.png", "1403636579863555584.png"],
        ["5.175304.png", "5.208604.png", "5.241904.png"],
        ["1.png", "2.png", "3.jpg"],
    ],
)
def test_nothing_is_told_of_others(names):
    assert doubt(*names) == ""


def test_it_is_told_before_the_work_and_by_info(adv2e, write_images, picture):
    folder = write_images([picture(n) for n in range(3)], name="{:06d}.png")
    for number in (2, 1, 0):
        (folder / f"{number:06d}.png").rename(folder / f"{52 + 11 * number:06d}.png")
    (told,) = open_source(folder, fps=240).doubts
    assert "--fps 240/11" in told
    assert f"problem     {told}" in adv2e("info", folder, "--fps", "240").out
