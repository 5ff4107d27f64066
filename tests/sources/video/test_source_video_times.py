"""Times of frames in containers of every kind, written by another library."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source

pytest.importorskip("av", reason="PyAV writes what OpenCV does not")
from video_files import COUNT, written


def times_of(path, **options):
    return [frame.t_ns for frame in open_source(path, **options).frames()]


def at_rate(hz, numbers=range(COUNT)):
    return [round(Fraction(n * 10**9) / hz) for n in numbers]


FILES = [
    ("clip.avi", "mpeg4", 2),
    ("clip.avi", "libx264", 2),
    ("clip.avi", "mpeg2video", 0),
    ("clip.wmv", "libx264", 3),
    ("clip.wmv", "wmv2", 0),
    ("clip.mpg", "mpeg1video", 2),
    ("clip.mpg", "mpeg2video", 2),
    ("clip.mpg", "mpeg2video", 0),
    ("clip.mpg", "libx264", 2),
    ("clip.ts", "libx264", 2),
    ("clip.mp4", "libx264", 3),
    ("clip.mov", "mpeg4", 2),
    ("clip.mkv", "libx264", 2),
    ("clip.flv", "libx264", 2),
]


@pytest.mark.parametrize(("name", "codec", "reordered"), FILES)
@pytest.mark.parametrize("rate", [Fraction(30), Fraction(30000, 1001), Fraction(25)])
def test_every_frame_is_at_its_time(tmp_path, name, codec, reordered, rate):
    path = written(tmp_path / name, codec, rate, reordered=reordered)
    source = open_source(path)
    times = [frame.t_ns for frame in source.frames()]
    clock_ns = 10**6 if name.endswith("flv") else 20_000 if name.endswith("ts") else 1
    assert len(times) == COUNT == source.count
    assert np.abs(np.subtract(times, at_rate(rate))).max() <= clock_ns
    scarce = name.endswith("mpg") and codec == "libx264"  # FFmpeg writes a time for the first alone
    assert all("1 of its 36 frames: taken at" in doubt for doubt in source.doubts)
    assert len(source.doubts) == scarce


@pytest.mark.parametrize("name", ["clip.avi", "clip.mpg", "clip.mp4", "clip.mkv", "clip.wmv"])
def test_sound_that_is_longer_changes_nothing(tmp_path, name):
    codec = "mpeg2video" if name.endswith("mpg") else "mpeg4"
    path = written(tmp_path / name, codec, 30, reordered=2, sound=True)
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames()] == at_rate(30)
    assert source.count == COUNT


@pytest.mark.parametrize("name", ["clip.avi", "clip.mp4", "clip.ts", "clip.mkv"])
@pytest.mark.parametrize("reordered", [0, 2])
def test_a_rate_that_varies_is_followed(tmp_path, name, reordered):
    numbers = [n for n in range(45) if n % 5 != 3]
    path = written(tmp_path / name, "mpeg4", 30, reordered=reordered, numbers=numbers)
    times = times_of(path)
    step = np.subtract(times, at_rate(30, numbers))
    # AVI has no time for the last ones
    settled = step[: -reordered - 1] if reordered and name.endswith("avi") else step
    assert np.abs(settled).max() <= 10**6
    assert all(after > before for before, after in pairwise(times))
    assert len(times) == COUNT


@pytest.mark.parametrize("name", ["clip.mp4", "clip.ts", "clip.avi"])
def test_a_gap_is_told_before_the_work(tmp_path, name):
    numbers = [n + 40 * (n >= 20) for n in range(COUNT)]
    path = written(tmp_path / name, "mpeg4", 30, numbers=numbers)
    (told,) = open_source(path).doubts
    assert told.startswith(f"{path}: no frame for 1.36666666")
    assert "between frames 19 and 20; usual are 0.03333333" in told
    assert open_source(path, fps=30).doubts == []


@pytest.mark.parametrize("name", ["clip.ts", "clip.mpg"])
def test_files_that_were_joined_say_where(tmp_path, name):
    part = written(tmp_path / name, "mpeg2video", 30, reordered=2)
    part.write_bytes(part.read_bytes() * 2)
    with pytest.raises(
        DataError, match=rf"{name}: times begin again near frame 3[678]: .*give --fps"
    ):
        open_source(part)
    assert times_of(part, fps=30) == at_rate(30, range(2 * COUNT))
    assert len(times_of(part, stop_s=1)) == 31


@pytest.mark.parametrize("name", ["clip.mpg", "clip.ts", "clip.avi"])
def test_times_for_frames_that_no_header_counts(tmp_path, name):
    path = written(tmp_path / name, "mpeg2video", 30, reordered=2)
    times = tmp_path / "t.txt"
    for count in (COUNT, COUNT - 1):
        times.write_text("".join(f"{n}.5\n" for n in range(count)))
        if count == COUNT:
            assert times_of(path, timestamps=times)[-1] == 35_500_000_000
        else:
            with pytest.raises(DataError, match=rf"{name}: 35 times given for 36 frames"):
                open_source(path, timestamps=times)
