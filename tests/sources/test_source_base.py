"""What holds of every source: selection, origin of time, and the checks on frames."""

from __future__ import annotations

import re
import weakref

import numpy as np
import pytest

from adv2e.errors import Adv2eError, DataError, UsageError
from adv2e.sources import Frame, open_source


@pytest.fixture
def stack(tmp_path, picture):
    """A stack of ten frames, 0.1 s apart from 5 s on, and the file of its times."""
    path = tmp_path / "stack.npy"
    np.save(path, np.stack([picture(n) for n in range(10)]))
    times = tmp_path / "times.txt"
    times.write_text("".join(f"{5 + n / 10:.1f}\n" for n in range(10)))
    return path, times


def times_of(source):
    return [frame.t_ns for frame in source.frames()]


TENTH = 100_000_000
FIFTH_SECOND = 5 * 10**9


def test_frames_come_as_often_as_asked(stack):
    source = open_source(stack[0], fps=10)
    first, second = list(source.frames()), list(source.frames())
    assert len(first) == len(second) == source.count == 10
    assert all(isinstance(frame, Frame) for frame in first)
    assert np.array_equal(first[3].image, second[3].image)


def test_frames_are_not_kept(stack):
    images = []
    for frame in open_source(stack[0], fps=10).frames():
        images.append(weakref.ref(frame.image))
        del frame
        assert [image() for image in images] == [None] * len(images)
    assert len(images) == 10


@pytest.mark.parametrize(
    ("options", "numbers"),
    [
        ({}, range(10)),
        ({"start_s": 0.2}, range(2, 10)),
        ({"stop_s": 0.2}, range(3)),
        ({"start_s": 0.25, "stop_s": 0.61}, range(3, 7)),
        ({"start_s": 0.3, "stop_s": 0.6}, range(3, 7)),
        ({"stop_s": 100.0}, range(10)),
    ],
)
def test_selection_counts_from_the_first_frame_and_includes_both_ends(stack, options, numbers):
    source = open_source(stack[0], timestamps=stack[1], **options)
    assert times_of(source) == [FIFTH_SECOND + n * TENTH for n in numbers]
    assert source.count == len(numbers)


@pytest.mark.parametrize(
    ("t0", "clock", "first"),
    [
        ("auto", True, FIFTH_SECOND + 2 * TENTH),
        ("keep", True, FIFTH_SECOND + 2 * TENTH),
        ("zero", True, 0),
        ("auto", False, 2 * TENTH),
        ("keep", False, 2 * TENTH),
        ("zero", False, 0),
    ],
)
def test_origin_of_time(stack, t0, clock, first):
    when = {"timestamps": stack[1]} if clock else {"fps": 10}
    source = open_source(stack[0], start_s=0.2, t0=t0, **when)
    assert source.has_clock is clock
    assert times_of(source)[:2] == [first, first + TENTH]


def test_times_of_the_epoch_stay_exact(stack):
    stack[1].write_text("".join(f"1468941032.{229165635 + n}\n" for n in range(10)))
    times = times_of(open_source(stack[0], timestamps=stack[1]))
    assert times == [1_468_941_032_229_165_635 + n for n in range(10)]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fps": 25, "timestamps": "t.txt"}, "--fps and --timestamps"),
        ({"fps": 0}, "--fps"),
        ({"fps": float("nan")}, "--fps"),
        ({"fps": 25, "start_s": -1}, "start_s: must be seconds"),
        ({"fps": 25, "stop_s": float("nan")}, "stop_s: must be seconds"),
        ({"fps": 25, "start_s": 2, "stop_s": 2}, "--stop 2 must be after"),
        ({"fps": 25, "t0": "now"}, "t0: must be auto, zero or keep"),
    ],
)
def test_impossible_options_are_usage_errors(stack, options, message):
    with pytest.raises(UsageError, match=message):
        open_source(stack[0], **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start_s": 0.9}, "--start and --stop leave a single frame, .* 0.9 s"),
        ({"start_s": 3}, "--start and --stop leave no frames"),
        ({"start_s": 0.41, "stop_s": 0.49}, "--start and --stop leave no frames"),
    ],
)
def test_a_selection_of_fewer_than_two_frames_is_refused(stack, options, message):
    with pytest.raises(DataError, match=f"stack.npy: {message}"):
        open_source(stack[0], fps=10, **options)


def test_damage_is_allowed_of_video_alone(stack):
    source = open_source(stack[0], fps=10, allow_damaged=True)
    assert any("stack.npy: --allow-damaged is for video" in line for line in source.notes)


def test_missing_input(tmp_path):
    with pytest.raises(DataError, match=r"none\.mp4: no such file or folder"):
        open_source(tmp_path / "none.mp4")


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("frames/%04d.png", "give the folder of the images"),
        ("frames/*.png", "give the folder of the images"),
        ("https://a.b/c.mp4", "https://a.b/c.mp4: an address: --network lets it be read"),
        ("", "the input has no name"),
    ],
)
def test_a_missing_input_that_looks_like_something_else(name, advice):
    with pytest.raises(DataError, match=re.escape(advice)):
        open_source(name)


@pytest.mark.parametrize("name", ["clip.doc", "clip"])
def test_unsupported_files_say_what_is_supported(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"text")
    with pytest.raises(DataError, match=f"{name}: .*folder of images.*mp4.*zip npy"):
        open_source(path)


def test_every_complaint_is_one_line(tmp_path, stack):
    wrong = [tmp_path / "none", stack[0], tmp_path]
    for path in wrong:
        with pytest.raises(Adv2eError) as caught:
            open_source(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)
