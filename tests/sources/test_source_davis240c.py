from __future__ import annotations

import zipfile

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source

LIST = "0.038766001 images/frame_1.png\n0.000000000 images/frame_0.png\n0.5 images/frame_2.png\n"
TIMES = [0, 38_766_001, 500_000_000]


@pytest.fixture
def recording(write_images, picture):
    """A recording of three grey frames whose list is out of order."""
    images = write_images([picture(n) for n in range(3)], folder="rec/images")
    (images.parent / "images.txt").write_text(LIST)
    return images.parent


@pytest.fixture
def pack(recording, tmp_path):
    """Pack the recording, below a folder of the archive."""

    def pack(top="", leave_out=()):
        path = tmp_path / "rec.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(recording.rglob("*")):
                if file.is_file() and file.name not in leave_out:
                    archive.write(file, top + str(file.relative_to(recording)))
        return path

    return pack


def check(source, picture):
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == TIMES
    assert all(np.array_equal(f.image, picture(n)) for n, f in enumerate(frames))
    assert (source.kind, source.encoding, source.has_clock) == ("davis240c", "linear", True)
    assert (source.width, source.height, source.count) == (32, 24, 3)


def test_folder_is_sorted_by_time_and_keeps_its_clock(recording, picture):
    check(open_source(recording), picture)


def test_folder_with_events_needs_no_folder_for_images(recording, picture):
    for number in range(3):
        (recording / "images" / f"frame_{number}.png").rename(recording / f"frame_{number}.png")
    (recording / "images.txt").write_text(LIST.replace("images/", ""))
    assert open_source(recording).kind == "images"
    (recording / "events.txt").write_text("0.1 1 1 1\n")
    check(open_source(recording), picture)


def test_whole_numbers_are_microseconds_as_those_of_its_events_are(recording, pack):
    lines = [f"{t // 1000} images/frame_{n}.png\n" for t, n in zip(TIMES, (0, 1, 2), strict=True)]
    (recording / "images.txt").write_text("".join(lines))
    for source in (open_source(recording), open_source(pack())):
        assert [frame.t_ns for frame in source.frames()] == [t // 1000 * 1000 for t in TIMES]
        assert any("are taken as us (" in doubt for doubt in source.doubts)
    given = open_source(recording, fps=10.0)
    assert not given.doubts


def test_whole_numbers_that_could_count_the_frames_are_seconds_in_doubt(recording, pack):
    lines = [f"{t} images/frame_{n}.png\n" for n, t in enumerate((0, 1, 3))]
    (recording / "images.txt").write_text("".join(lines))
    for source in (open_source(recording), open_source(pack())):
        assert [frame.t_ns for frame in source.frames()] == [0, 10**9, 3 * 10**9]
        assert any("taken as s (" in doubt for doubt in source.doubts)


@pytest.mark.parametrize("top", ["", "rec/"])
def test_zip_with_its_files_at_the_root_or_in_one_folder(pack, picture, top):
    check(open_source(pack(top)), picture)


def test_zip_made_by_a_mac(pack, picture):
    path = pack("rec/")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("__MACOSX/images.txt", b"\0\1")
    check(open_source(path), picture)


def test_colour_is_linear_too(write_images, picture):
    images = write_images([picture(n, (24, 32, 3)) for n in range(3)], folder="rec/images")
    (images.parent / "images.txt").write_text(LIST)
    source = open_source(images.parent)
    assert (source.colour, source.encoding) == (True, "linear")


def test_given_times_replace_the_list_and_a_note_says_so(recording, picture, tmp_path):
    times = tmp_path / "t.txt"
    times.write_text("1\n2\n3\n")
    source = open_source(recording, timestamps=times)
    assert [frame.t_ns for frame in source.frames()] == [10**9, 2 * 10**9, 3 * 10**9]
    assert source.notes == [
        f"times from {times}: time [s]",
        f"--timestamps {times} replaces the times in {recording / 'images.txt'}",
    ]
    source = open_source(recording, fps=20)
    assert [frame.t_ns for frame in source.frames()] == [0, 50_000_000, 100_000_000]
    assert not source.has_clock


def test_given_times_with_names(recording, picture, tmp_path):
    times = tmp_path / "t.txt"
    times.write_text("1 images/frame_2.png\n2 images/frame_1.png\n3 images/frame_0.png\n")
    frames = list(open_source(recording, timestamps=times).frames())
    assert np.array_equal(frames[0].image, picture(2))


def test_a_listed_image_that_is_missing_is_named_by_line(recording, pack):
    with pytest.raises(DataError, match=r"rec\.zip: images\.txt line 1: no image images/frame_1"):
        open_source(pack(leave_out=["frame_1.png"]))
    (recording / "images" / "frame_1.png").unlink()
    with pytest.raises(DataError, match=r"images\.txt line 1: no image .*frame_1\.png"):
        open_source(recording)


def test_stamps_that_occur_twice_are_named_by_line(recording):
    (recording / "images.txt").write_text(LIST.replace("0.5", "0.038766001"))
    with pytest.raises(DataError, match=r"images\.txt line 3: times must increase.*line 1"):
        open_source(recording)


def test_a_list_without_names(pack, recording):
    (recording / "images.txt").write_text("0.1\n0.2\n")
    with pytest.raises(DataError, match=r"images\.txt: 2 times for the 3 frames"):
        open_source(pack())


def test_zip_without_a_list_is_one_of_plain_images(pack):
    with pytest.raises(DataError, match=r"rec\.zip: no times of its frames are known"):
        open_source(pack(leave_out=["images.txt"]))
    assert open_source(pack("two/folders/")).kind == "images"


def test_zip_with_two_lists(pack):
    path = pack("a/")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("b/images.txt", LIST)
    with pytest.raises(DataError, match=r"rec\.zip: more than one images\.txt"):
        open_source(path)


def test_files_that_are_no_zip(tmp_path, pack):
    whole = pack().read_bytes()
    path = tmp_path / "bad.zip"
    for data in (b"", b"text" * 100, whole[:-30]):
        path.write_bytes(data)
        with pytest.raises(DataError, match=r"bad\.zip: not a zip archive that can be read"):
            open_source(path)


def test_a_damaged_member_is_named(pack):
    path = pack()
    data = bytearray(path.read_bytes())
    start = data.index(b"images/frame_2.png") + 60
    data[start : start + 40] = bytes(40)
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"rec\.zip: images/frame_2\.png: cannot be read"):
        list(open_source(path).frames())
