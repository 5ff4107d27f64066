from __future__ import annotations

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source


def save(path, array):
    np.save(path, array)
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "stack.npy"


@pytest.mark.parametrize("shape", [(3, 5, 7), (3, 5, 7, 3)])
@pytest.mark.parametrize(
    ("dtype", "white"),
    [(np.uint8, 255), (np.uint16, 65535), (np.float32, 1), (np.float64, 1), (">u2", 65535)],
)
def test_frames_come_back_as_stored(path, picture, shape, dtype, white):
    stack = picture(0, shape, dtype)
    source = open_source(save(path, stack), fps=100)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [0, 10_000_000, 20_000_000]
    assert all(np.array_equal(f.image, image) for f, image in zip(frames, stack, strict=True))
    assert frames[0].image.dtype == source.dtype == np.dtype(dtype).newbyteorder("=")
    assert (source.kind, source.width, source.height) == ("npy", 7, 5)
    assert source.colour is (len(shape) == 4)
    encoding = "srgb" if dtype == np.uint8 else "linear"
    assert (source.encoding, source.full_scale) == (encoding, white)
    assert source.path == str(path)


def test_rates_are_decimal_numbers(path):
    source = open_source(save(path, np.zeros((4, 2, 2), np.uint8)), fps=29.97)
    assert [f.t_ns for f in source.frames()] == [0, 33_366_700, 66_733_400, 100_100_100]


def test_times_in_an_array_beside_it(path, tmp_path):
    save(tmp_path / "stack_ts.npy", np.array([1468941032.25, 1468941032.5]))
    source = open_source(save(path, np.zeros((2, 2, 2), np.uint8)))
    assert source.has_clock
    assert [f.t_ns for f in source.frames()] == [1468941032_250000000, 1468941032_500000000]
    assert any("stack_ts.npy" in note for note in source.notes)


def test_times_in_a_list_beside_it(path, tmp_path):
    (tmp_path / "stack.timestamps.txt").write_text("0.5\n0.75\n")
    source = open_source(save(path, np.zeros((2, 2, 2), np.uint8)))
    assert [f.t_ns for f in source.frames()] == [500_000_000, 750_000_000]


def test_given_times_replace_those_beside_it_and_a_note_says_so(path, tmp_path):
    (tmp_path / "stack.timestamps.txt").write_text("0.5\n0.75\n")
    source = open_source(save(path, np.zeros((2, 2, 2), np.uint8)), fps=4)
    assert [f.t_ns for f in source.frames()] == [0, 250_000_000]
    assert any("--fps 4 replaces" in n and "stack.timestamps.txt" in n for n in source.notes)


def test_without_times_the_message_says_what_to_give(path):
    save(path, np.zeros((2, 2, 2), np.uint8))
    with pytest.raises(DataError, match=r"--fps F or --timestamps FILE.*stack_ts\.npy"):
        open_source(path)


def test_another_number_of_times_names_both(path, tmp_path):
    save(path, np.zeros((3, 2, 2), np.uint8))
    times = tmp_path / "t.txt"
    times.write_text("0\n1\n")
    with pytest.raises(DataError, match=r"t\.txt: 2 times for the 3 frames of .*stack\.npy"):
        open_source(path, timestamps=times)
    save(tmp_path / "stack_ts.npy", np.arange(4.0))
    with pytest.raises(DataError, match=r"stack_ts\.npy: 4 times for the 3 frames of .*stack\.npy"):
        open_source(path)


@pytest.mark.parametrize(
    "times", [np.arange(3, dtype=np.float32), np.arange(3, dtype=np.int32), np.eye(3)]
)
def test_times_in_an_array_must_be_float64_or_int64(path, tmp_path, times):
    save(path, np.zeros((3, 2, 2), np.uint8))
    save(tmp_path / "stack_ts.npy", times)
    with pytest.raises(DataError, match=r"stack_ts\.npy: .*expected float64 or int64"):
        open_source(path)


@pytest.mark.parametrize(
    ("times", "unit"),
    [([0, 33_000, 67_000], "us"), ([0.0, 33.0, 67.0], "ms"), ([0.0, 0.033, 0.067], "s")],
)
def test_the_unit_of_times_in_an_array_is_told_apart(path, tmp_path, times, unit):
    save(path, np.zeros((3, 2, 2), np.uint8))
    save(tmp_path / "stack_ts.npy", np.array(times))
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames()] == [0, 33_000_000, 67_000_000]
    assert bool(source.doubts) is (unit != "s")
    settled = open_source(path, time_unit=unit)
    assert [frame.t_ns for frame in settled.frames()] == [0, 33_000_000, 67_000_000]
    assert settled.doubts == []


@pytest.mark.parametrize(
    ("times", "message"),
    [([0.0, np.nan, 1.0], "NaN"), ([0.0, 1.0, 1.0], "frame 2: times must increase")],
)
def test_wrong_times_in_an_array(path, tmp_path, times, message):
    save(path, np.zeros((3, 2, 2), np.uint8))
    save(tmp_path / "stack_ts.npy", np.array(times))
    with pytest.raises(DataError, match=message):
        list(open_source(path).frames())


@pytest.mark.parametrize(
    ("value", "message"), [(np.nan, "NaN"), (np.inf, "infinite"), (-0.01, "cannot be negative")]
)
@pytest.mark.parametrize("number", [0, 2])
def test_impossible_light_names_the_frame(path, value, message, number):
    stack = np.full((3, 4, 4), 0.5, np.float32)
    stack[number, 1, 1] = value
    save(path, stack)
    with pytest.raises(DataError, match=rf"stack\.npy: frame {number}: .*{message}"):
        list(open_source(path, fps=10).frames())


def test_light_above_white_is_kept_and_told(path):
    save(path, np.full((2, 4, 4), 200.0))
    source = open_source(path, fps=10)
    assert all(np.all(frame.image == 200) for frame in source.frames())
    assert any("frames.full_scale" in note for note in source.notes)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((1, 4, 4), np.uint8), "a single frame"),
        (np.zeros((0, 4, 4), np.uint8), "no frames"),
        (np.zeros((4, 4), np.uint8), r"shape \(4, 4\); expected \(frames, rows, columns\)"),
        (np.zeros((2, 4, 4, 4), np.uint8), "expected"),
        (np.zeros((2, 0, 4), np.uint8), "expected"),
        (np.zeros((2, 4, 4), np.int64), "int64: give uint8, uint16, float32, float64"),
        (np.zeros((2, 4, 4), bool), "bool"),
        (np.array([None, {}]), "Python objects"),
    ],
)
def test_arrays_that_are_no_stacks(path, array, message):
    save(path, array)
    with pytest.raises(DataError, match=f"stack.npy: .*{message}"):
        open_source(path, fps=10)


def test_files_that_are_no_arrays(path, tmp_path):
    whole = save(tmp_path / "whole.npy", np.zeros((4, 8, 8), np.uint8)).read_bytes()
    for data in (b"", b"text", whole[:-20]):
        path.write_bytes(data)
        with pytest.raises(DataError, match=r"stack\.npy: (not a \.npy array|cut short)"):
            open_source(path, fps=10)


@pytest.mark.parametrize("order", ["C", "F"])
def test_any_order_in_memory(path, picture, order):
    stack = np.asarray(picture(0, (3, 5, 7), np.uint16), order=order)
    frames = list(open_source(save(path, stack), fps=100).frames())
    assert all(np.array_equal(f.image, image) for f, image in zip(frames, stack, strict=True))
    assert all(frame.image.flags.c_contiguous for frame in frames)


def test_a_file_cut_short_while_it_is_read(path):
    frames = open_source(save(path, np.zeros((50, 40, 40), np.uint8)), fps=100).frames()
    next(frames)
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)
    with pytest.raises(DataError, match=r"stack\.npy: frame 2\d: cut short"):
        list(frames)
