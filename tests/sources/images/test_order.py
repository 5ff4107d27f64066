"""Order of pictures by their names, and what is told of it."""

from __future__ import annotations

import random
import zipfile

import numpy as np
import pytest

from adv2e.sources import open_source
from adv2e.sources.images.source import in_order

DECIMALS = ["3081.75", "3081.8", "3081.85", "3081.9", "3081.95", "3082.0", "3082.05"]


def order(names):
    mixed = list(names)
    random.Random(1).shuffle(mixed)
    return in_order(mixed)


@pytest.mark.parametrize(
    "stems",
    [
        DECIMALS,
        [*DECIMALS[:5], "3082", "3082.05"],
        [f"cam0_{text}" for text in DECIMALS],
        [f"{0.05 * k:.6g}" for k in range(30)],
        ["1e-05", "5e-05", "0.0001", "0.00015", "0.0002"],
        [f"{1305031102.1753 + 0.0333 * k:.6f}".rstrip("0") for k in range(40)],
        ["-1.0", "-0.5", "0.0", "0.5", "1.0"],
    ],
)
def test_decimals_without_their_last_zeros(stems):
    names = [f"{stem}.png" for stem in stems]
    found, told = order(names)
    assert found == names
    assert "decimals, not as whole numbers" in told[0]


@pytest.mark.parametrize(
    "stems",
    [
        [f"{100 + ns // 10**9}.{ns % 10**9}" for ns in range(0, 2 * 10**9, 33_333_333)],
        [f"shot{shot}.{frame}" for shot in (1, 2) for frame in range(1, 13)],
        ["1.5", "1.10"],
    ],
)
def test_whole_numbers_after_a_point(stems):
    names = [f"{stem}.png" for stem in stems]
    found, told = order(names)
    assert found == names
    assert "whole numbers, not as decimals" in told[0]


@pytest.mark.parametrize(
    "names",
    [
        ["IMG_7.jpg", "IMG_8.jpg", "IMG_8 (1).jpg", "IMG_8 (2).jpg", "IMG_8 (10).jpg", "IMG_9.jpg"],
        ["a 1.png", "a 1 - Copy.png", "a 1 - Copy (2).png", "a 2.png"],
        ["20240101_170431.jpg", "20240101_170431_1.jpg", "20240101_170432.jpg"],
        ["img.jpg", "img copy.jpg", "img copy 2.jpg", "img copy 10.jpg"],
        ["frame2.png", "Frame10.PNG", "frame11.png"],
        ["e\u0301_1.png", "\u00e9_2.png", "e\u0301_3.png", "\u00e9_10.png"],
        ["cam0_11_000034.png", "cam0_12_000002.png", "cam0_12_000034.png", "cam1_1_0.png"],
        ["frame-1.png", "frame-2.png", "frame-10.png"],
        ["v1.2.3.png", "v1.2.10.png"],
        ["1403636579763555584.png", "1403636579813555456.png", "1403636579863555584.png"],
        ["1305031102.175304.png", "1305031102.211214.png", "1305031102.243211.png"],
    ],
)
def test_names_that_are_read_in_one_way_alone(names):
    assert order(names) == (names, [])


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (["-3.png", "-2.png", "-1.png", "0.png", "1.png", "10.png"], "negative"),
        (["t-10.png", "t-1.png", "t+0.png", "t+1.png"], "negative"),
        (["-1.png", "-2.png", "-10.png"], "as a dash: -1.png comes first"),
        ([f"{k:02x}.png" for k in range(8, 30)], "hexadecimal"),
        ([f"frame_{k:x}.png" for k in range(8, 30)], "hexadecimal"),
        (["a.jpg", "a.png", "b.png"], "a.jpg and a.png are of one name or number"),
        (["01.png", "1.png", "2.png"], "01.png and 1.png are of one name or number"),
        (["left_1.png", "left_2.png", "right_1.png", "right_2.png"], "of 2 kinds"),
    ],
)
def test_what_is_taken_is_told(names, line):
    found, told = order(names)
    assert found == names
    assert len(told) == 1
    assert line in told[0]


def test_names_that_tell_no_order_are_told():
    names = ["9e688c58a5487b8eaf69c9e1005ad0bf.png", "55a54008ad1ba589aa210d2629c1df41.png"]
    assert "hardly tell an order" in order(names)[1][0]


@pytest.mark.parametrize("packed", [False, True])
def test_the_order_is_told_where_it_gives_the_times(write_images, picture, tmp_path, packed):
    folder = write_images([picture(n) for n in range(3)])
    for number, name in enumerate(("0.75", "0.8", "0.85")):
        (folder / f"frame_{number}.png").rename(folder / f"{name}.png")
    source = folder
    if packed:
        source = tmp_path / "folder.zip"
        with zipfile.ZipFile(source, "w") as archive:
            for file in folder.iterdir():
                archive.write(file, file.name)
    opened = open_source(source, fps=20)
    told = [line for line in opened.doubts if "decimals" in line]
    assert len(told) == 1
    images = [frame.image for frame in opened.frames()]
    assert all(np.array_equal(image, picture(n)) for n, image in enumerate(images))
    bare, named = tmp_path / "bare.txt", tmp_path / "named.txt"
    bare.write_text("0\n0.5\n1\n")
    named.write_text("0 0.75.png\n0.5 0.8.png\n1 0.85.png\n")
    assert told[0] in open_source(source, timestamps=bare).doubts
    assert not any("decimals" in line for line in open_source(source, timestamps=named).doubts)


def test_a_list_may_have_accents_as_another_system_stores_them(write_images, picture, tmp_path):
    folder = write_images([picture(0), picture(1)])
    for letter, file in zip("ab", sorted(folder.glob("*.png")), strict=True):
        file.rename(folder / f"\u00e9{letter}.png")
    listed = tmp_path / "list.txt"
    listed.write_text("0.0 e\u0301a.png\n0.5 e\u0301b.png\n", "utf-8")
    assert open_source(folder, timestamps=listed).count == 2
