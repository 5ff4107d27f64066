"""The track that is the film among several, and streams that are unlike the usual."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
import pytest
from av.stream import Disposition
from video_files import pictures, written

from adv2e.errors import DataError
from adv2e.sources import open_source

SMALL, LARGE = (32, 24), (64, 48)


def two_tracks(path, default, titles=("", "")):
    """Write a small and a large film into one file; the one of number `default` is flagged so."""
    with av.open(str(path), "w") as film:
        streams = [film.add_stream("mpeg4", rate=25) for _ in (SMALL, LARGE)]
        for number, (stream, size) in enumerate(zip(streams, (SMALL, LARGE), strict=True)):
            stream.width, stream.height = size
            stream.pix_fmt = "yuv420p"
            stream.disposition = Disposition.default if number == default else Disposition(0)
            if titles[number]:
                stream.metadata["title"] = titles[number]
        for n in range(6):
            for stream in streams:
                shape = (stream.height, stream.width, 3)
                frame = av.VideoFrame.from_ndarray(np.full(shape, 30 * n, np.uint8), "rgb24")
                frame.pts, frame.time_base = n, Fraction(1, 25)
                film.mux(stream.encode(frame))
        for stream in streams:
            film.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("suffix", ["mkv", "mp4"])
@pytest.mark.parametrize("default", [0, 1])
def test_the_default_track_is_taken_and_told(tmp_path, suffix, default):
    source = open_source(two_tracks(tmp_path / f"clip.{suffix}", default))
    assert (source.width, source.height) == (SMALL, LARGE)[default]
    assert len(list(source.frames())) == 6
    (told,) = source.notes
    assert "2 tracks of frames: 0 = video (32x24), 1 = video (64x48)" in told
    assert f"{default} = video is taken, --track chooses another" in told


def test_a_track_is_chosen_by_number_or_title(tmp_path):
    path = two_tracks(tmp_path / "clip.mkv", 1, ("Left eye", "Right"))
    for track, size in (("0", SMALL), (0, SMALL), ("1", LARGE), ("Left eye", SMALL)):
        source = open_source(path, track=track)
        assert (source.width, source.height, source.notes) == (*size, [])
        assert [frame.image.shape[:2] for frame in source.frames()] == [size[::-1]] * 6
    for track in ("2", "-1", "middle", "\u0664"):
        with pytest.raises(DataError, match=r"but 0 = Left eye \(32x24\), 1 = Right"):
            open_source(path, track=track)
    with pytest.raises(DataError, match="no such track"):
        open_source(written(tmp_path / "one.mp4", "mpeg4", 25), track="1")


def test_a_cover_is_not_the_film(tmp_path):
    path = tmp_path / "clip.mp4"
    with av.open(str(path), "w") as film:
        cover, stream = film.add_stream("mjpeg", rate=25), film.add_stream("mpeg4", rate=25)
        cover.width, cover.height, cover.pix_fmt = 160, 96, "yuvj420p"
        cover.disposition = Disposition.attached_pic
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        large = av.VideoFrame.from_ndarray(np.zeros((96, 160, 3), np.uint8), "rgb24")
        film.mux(cover.encode(large.reformat(format="yuvj420p")) + cover.encode(None))
        for n, image in enumerate(pictures(5)):
            frame = av.VideoFrame.from_ndarray(image, "rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    source = open_source(path)
    assert (source.width, source.height, source.notes) == (64, 48, [])
    assert len(list(source.frames())) == 5


@pytest.mark.parametrize("suffix", ["mkv", "mp4"])
def test_pixels_that_are_not_square_are_told(tmp_path, suffix):
    path = tmp_path / f"clip.{suffix}"
    with av.open(str(path), "w") as film:
        stream = film.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.sample_aspect_ratio = Fraction(16, 11)
        for image in pictures(4):
            film.mux(stream.encode(av.VideoFrame.from_ndarray(image, "rgb24")))
        film.mux(stream.encode(None))
    source = open_source(path)
    assert (source.width, source.height) == (64, 48)
    assert [note for note in source.notes if "not square (16:11)" in note]


@pytest.mark.parametrize("suffix", ["ts", "h264"])
def test_a_size_that_changes_names_the_frame(tmp_path, suffix):
    parts = []
    for number, size in enumerate((SMALL, LARGE)):
        part = tmp_path / f"{number}.{suffix}"
        with av.open(str(part), "w") as film:
            stream = film.add_stream("libx264", rate=25, options={"bf": "0"})
            stream.width, stream.height = size
            stream.pix_fmt = "yuv420p"
            for n in range(4):
                shape = (size[1], size[0], 3)
                frame = av.VideoFrame.from_ndarray(np.full(shape, 40 * n, np.uint8), "rgb24")
                frame.pts, frame.time_base = 4 * number + n, Fraction(1, 25)
                film.mux(stream.encode(frame))
            film.mux(stream.encode(None))
        parts.append(part.read_bytes())
    path = tmp_path / f"clip.{suffix}"
    path.write_bytes(b"".join(parts))
    frames = open_source(path, fps=25).frames()
    with pytest.raises(DataError, match=r"frame 4: uint8 colour of 64x48, but the first .* 32x24"):
        list(frames)


@pytest.mark.parametrize(("seconds", "reordered"), [(1, 0), (10, 2), (60, 3)])
@pytest.mark.parametrize("suffix", ["mkv", "mp4", "ts"])
def test_time_lapses(tmp_path, suffix, seconds, reordered):
    rate = Fraction(1, seconds)
    path = written(tmp_path / f"clip.{suffix}", "libx264", rate, reordered=reordered)
    times = [frame.t_ns for frame in open_source(path).frames()]
    assert times == [n * seconds * 10**9 for n in range(36)]


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "ts"])
@pytest.mark.parametrize("first", [-4, 0, 250])
def test_streams_may_begin_at_any_time(tmp_path, suffix, first):
    path = written(
        tmp_path / f"clip.{suffix}", "libx264", 25, reordered=2, numbers=range(first, first + 36)
    )
    source = open_source(path)
    times = [frame.t_ns for frame in source.frames()]
    cut = 4 if first < 0 and suffix == "mp4" else 0  # its edit list begins at zero
    assert times == [n * 40_000_000 for n in range(36 - cut)]
    assert (source.count, source.doubts) == (len(times), [])


@pytest.mark.parametrize(
    ("name", "codec"),
    [("a.h264", "libx264"), ("a.264", "libx264"), ("a.hevc", "libx265"), ("a.265", "libx265")],
)
def test_streams_without_a_container_have_no_times(tmp_path, name, codec):
    path = tmp_path / name
    options = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    with av.open(str(path), "w", format="h264" if codec == "libx264" else "hevc") as film:
        stream = film.add_stream(codec, rate=30, options=options)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for image in pictures(8):
            film.mux(stream.encode(av.VideoFrame.from_ndarray(image, "rgb24")))
        film.mux(stream.encode(None))
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames()] == [round(n * 10**9 / 30) for n in range(8)]
    (told,) = source.doubts
    assert "no times: taken at 30 frames a second" in told
    source = open_source(path, fps=10)
    assert [frame.t_ns for frame in source.frames()] == [n * 10**8 for n in range(8)]
    assert source.doubts == []


def test_y4m_without_a_rate_asks_for_one(tmp_path):
    path = tmp_path / "clip.y4m"
    frames = 3 * (b"FRAME\n" + bytes(24))
    path.write_bytes(b"YUV4MPEG2 W4 H4 F0:0 Ip C420\n" + frames)
    with pytest.raises(DataError, match=r"clip\.y4m: it states no times; give --fps"):
        open_source(path)
    assert len(list(open_source(path, fps=10).frames())) == 3
