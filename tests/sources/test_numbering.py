"""Frames at a constant rate whose names have gaps."""

from __future__ import annotations

from fractions import Fraction

import pytest

from adv2e.sources import open_source
from adv2e.sources.times.instants import FrameRate
from adv2e.sources.times.numbering import numbering_doubt


def doubt(*names, fps=240):
    return numbering_doubt([f"clip 1/{name}" for name in names], FrameRate(Fraction(fps)))


def test_numbers_that_rise_by_more_than_one_are_told_with_the_rate_they_suggest():
    told = doubt("000052.png", "000063.png", "000074.png", "000085.png")
    assert "the numbers in the frames' names are 11 apart (000052.png, 000063.png)" in told
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
        ["1403636579763555584.png", "1403636579813555456.png", "1403636579863555584.png"],
        ["33333.png", "66667.png", "100000.png"],
        ["5.175304.png", "5.208604.png", "5.241904.png"],
    ],
)
def test_times_are_not_called_numbers(names):
    told = doubt(*names)
    assert told.startswith(f"the frames' names look like times ({names[0]}, {names[1]})")
    assert "give --fps" not in told


def test_one_picture_in_two_formats_is_told():
    assert doubt("1.jpg", "1.png", "2.jpg", "2.png").startswith("1.jpg and 1.png differ in their")


@pytest.mark.parametrize(
    "names",
    [
        ["1.png", "2.png", "3.png"],
        ["frame_09.png", "frame_10.png", "frame_11.png"],
        ["a.png", "b.png"],
        ["l1.png", "r1.png", "l2.png"],
        ["1_7.png", "2_9.png"],
        ["0.png"],
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
    assert not open_source(folder, timestamps=_list(folder)).doubts


def _list(folder):
    path = folder / "times.txt"
    path.write_text("0.1\n0.2\n0.4\n")
    return path
