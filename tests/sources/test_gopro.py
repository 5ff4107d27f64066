"""Sequences of GOPRO: their times come from the numbers of their frames."""

from __future__ import annotations

import json
from fractions import Fraction

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source


def write(folder, numbers, value=40):
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        image = np.full((6, 8, 3), value + number % 100, np.uint8)
        cv2.imwrite(str(folder / f"{number:06d}.png"), image)
    return folder


def times_ns(numbers, window):
    return [round(Fraction((n - numbers[0]) * window * 10**9, 240)) for n in numbers]


@pytest.fixture
def large(tmp_path):
    """The three folders of a sequence of GOPRO_Large, whose numbers begin at 47."""
    sequence = tmp_path / "GOPRO_Large" / "train" / "GOPR0372_07_00"
    for value, kind in ((40, "sharp"), (80, "blur"), (120, "blur_gamma")):
        write(sequence / kind, range(47, 52), value)
    return sequence


@pytest.mark.parametrize("split", ["train", "test"])
def test_all_frames_come_at_240_a_second(tmp_path, split):
    numbers = [323, 324, 325, 326]
    folder = write(tmp_path / "GOPRO_Large_all" / split / "GOPR0372_07_00", numbers)
    source = open_source(folder)
    assert [frame.t_ns for frame in source.frames()] == times_ns(numbers, 1)
    assert (source.kind, source.encoding, source.has_clock) == ("gopro", "srgb", False)
    assert source.doubts == []
    label = f"times from the numbers in {folder}"
    assert source.notes == [f"{label}: all frames, 240 a second (GOPRO_Large_all)"]


@pytest.mark.parametrize(
    ("kind", "value"), [("", 40), ("sharp", 40), ("blur", 80), ("blur_gamma", 120)]
)
def test_one_frame_is_kept_of_as_many_as_the_name_says(large, kind, value):
    source = open_source(large / kind)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == times_ns(range(47, 52), 7)
    assert [frame.image[0, 0, 0] for frame in frames] == [value + n for n in range(47, 52)]
    # blur is the mean of encoded numbers: where nothing moves, it equals sharp
    assert (source.kind, source.encoding) == ("gopro", "srgb")
    folder = large / (kind or "sharp")
    listed = f"one frame of 7, 240/7 a second ({kind or 'sharp'} of GOPRO_Large)"
    assert source.notes[0] == f"times from the numbers in {folder}: {listed}"
    assert any("frames.exposure_us=29167" in n for n in source.notes) is kind.startswith("blur")


def test_the_line_on_light_says_which_frames_they_are(adv2e, large, tmp_path):
    for kind, said in (
        ("sharp", "the camera's curve is about that"),
        ("blur", "means of encoded numbers, no light"),
        ("blur_gamma", "means of light, encoded again"),
    ):
        outcome = adv2e("convert", large / kind, "-o", tmp_path / f"{kind}.h5", "-q")
        assert outcome == (0, "", "")
        report = json.loads(adv2e("info", large / kind, "--json").out)
        assert report["layout"] == "gopro"
        light = f"srgb, white 255 (GOPRO: {said}; frames.encoding changes it)"
        assert report["frames"]["light"] == light
        assert len(f"frames are {light}") <= 100


def test_a_gap_in_the_numbers_is_a_gap_in_time(tmp_path):
    numbers = [1, 2, 5, 6, 9]
    folder = write(tmp_path / "GOPRO_Large" / "test" / "GOPR0384_11_00" / "sharp", numbers)
    source = open_source(folder)
    assert [frame.t_ns for frame in source.frames()] == times_ns(numbers, 11)
    gap = "no frames between 000002.png and 000005.png, and at 1 more places"
    assert source.notes[1] == f"{folder}: {gap}; the times leave room for them"


def test_given_times_win_and_a_note_says_so(large, tmp_path):
    folder = large / "sharp"
    source = open_source(folder, fps=30)
    assert [frame.t_ns for frame in source.frames()][1] == 33_333_333
    assert source.notes == [f"--fps 30 replaces the times in the numbers in {folder}"]
    times = tmp_path / "t.txt"
    times.write_text("1\n2\n3\n4\n5.5\n")
    source = open_source(folder, timestamps=times)
    assert [frame.t_ns for frame in source.frames()][-1] == 5_500_000_000
    assert source.has_clock
    assert source.notes[-1].endswith(f"replaces the times in the numbers in {folder}")


@pytest.mark.parametrize(
    ("path", "window"),
    [
        ("gopro/train/GOPR0372_07_00", 1),
        ("GOPR0372_07_00", 1),
        ("gopro/train/sharp/GOPR0372_07_00", 7),
        ("GOPRO_Large/blur/train/GOPR0372_07_00", 7),
    ],
)
def test_a_sequence_is_known_whatever_stands_above(tmp_path, path, window):
    source = open_source(write(tmp_path / path, [323, 324, 325]))
    assert [frame.t_ns for frame in source.frames()] == times_ns([323, 324, 325], window)
    assert ("--fps 240/7 if" in "".join(source.doubts)) is (window == 1)


@pytest.mark.parametrize(
    "path",
    [
        "GOPRO_Large_all/train/scene_07_00",
        "GOPRO_Large/train/GOPR0372_07_00",
        "GOPRO_Large/train/GOPR0372_07_00/depth",
        "GOPRO_Large/train/GOPR0372_00_00/sharp",
        "GOPRO_Large/train/GOPR0372_7_00/sharp",
    ],
)
def test_other_folders_have_no_times(tmp_path, path):
    with pytest.raises(DataError, match="no times of its frames are known"):
        open_source(write(tmp_path / path, [1, 2, 3]))


@pytest.mark.parametrize("name", ["0000004.png", "000004.jpg", "frame.png"])
def test_other_names_among_the_frames_leave_no_times(large, name):
    cv2.imwrite(str(large / "sharp" / name), np.zeros((6, 8, 3), np.uint8))
    with pytest.raises(DataError, match="no times of its frames are known"):
        open_source(large / "sharp")


def test_a_list_in_the_folder_is_believed(large):
    (large / "sharp" / "timestamps.txt").write_text("1\n2\n3\n4\n5\n")
    source = open_source(large / "sharp")
    assert (source.kind, source.has_clock) == ("images", True)
