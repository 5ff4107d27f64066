"""Frames through standard input: Y4M and raw video, read once, as they come."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError, UsageError
from adv2e.formats.reading import read_events
from adv2e.geometry import Size
from adv2e.options import PIXEL_FORMATS as NAMES
from adv2e.sources import open_source
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.pipes.source import open_source as open_pipe
from adv2e.sources.pipes.stream import PIXEL_FORMATS


def y4m(frames, tags="W8 H6 F25:1 Ip C420jpeg", marker="FRAME\n"):
    data = f"YUV4MPEG2 {tags}\n".encode()
    return data + b"".join(marker.encode() + frame for frame in frames)


def opened(data, *, fps=None, timestamps=None, pixel_format=None, size=None, **wanted):
    file = io.BytesIO(data)
    given = GivenTimes(fps, timestamps)
    return open_pipe(
        given,
        Selection(**wanted),
        pixel_format=pixel_format,
        size=None if size is None else Size(*size),
        file=file,
    )


def planes(luma, blue=128, red=128, chroma=(3, 4)):
    """Return a frame of 8x6 of one colour."""
    return b"".join(
        np.full(shape, value, np.uint8).tobytes()
        for shape, value in (((6, 8), luma), (chroma, blue), (chroma, red))
    )


def colour_of(source):
    (frame, *_) = source.frames()
    assert (frame.image.reshape(-1, 3) == frame.image[0, 0]).all()
    return frame.image[0, 0].tolist()


@pytest.mark.parametrize(
    ("space", "chroma"),
    [
        ("C420jpeg", (3, 4)),
        ("C420mpeg2", (3, 4)),
        ("C420paldv", (3, 4)),
        ("C420", (3, 4)),
        ("", (3, 4)),
        ("C422", (6, 4)),
        ("C444", (6, 8)),
    ],
)
@pytest.mark.parametrize(
    ("tag", "codes", "rgb"),
    [
        # BT.601: 16 is black and 235 white, unless all codes are in use
        ("", (16, 128, 128), [0, 0, 0]),
        ("XCOLORRANGE=LIMITED", (235, 128, 128), [255, 255, 255]),
        ("", (81, 90, 240), [254, 0, 0]),
        ("XCOLORRANGE=FULL", (76, 85, 255), [254, 0, 0]),
        ("XCOLORRANGE=FULL", (128, 128, 128), [128, 128, 128]),
    ],
)
def test_colours_by_the_range_that_the_stream_states(space, chroma, tag, codes, rgb):
    source = opened(y4m([planes(*codes, chroma)] * 3, f"W8 H6 F25:1 Ip {space} {tag}"))
    assert colour_of(source) == rgb
    assert (source.kind, source.width, source.height, source.colour) == ("y4m", 8, 6, True)
    assert (source.encoding, source.full_scale, source.has_clock) == ("srgb", 255, False)
    assert any("BT.601 is taken" in note for note in source.notes)


def test_the_rate_is_that_of_the_stream():
    source = opened(y4m([planes(16), planes(99), planes(235)], "W8 H6 F30000:1001 Ip"))
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [0, 33_366_667, 66_733_333]
    assert [frame.image[0, 0, 0] for frame in frames] == [0, 97, 255]
    source = opened(y4m([planes(16)] * 3, "W8 H6 F30000:1001 Ip"), fps=240)
    assert [frame.t_ns for frame in source.frames()] == [0, 4_166_667, 8_333_333]
    assert "--fps 240 replaces the 30000/1001 Hz of the stream" in source.notes


@pytest.mark.parametrize("shape", [(6, 8), (5, 7)])
def test_chroma_of_odd_sizes(shape):
    rows, columns = shape
    luma = np.full(shape, 81, np.uint8)
    blue, red = (np.full((3, 4), value, np.uint8) for value in (90, 240))
    red[-1, -1] = 128
    data = y4m([luma.tobytes() + blue.tobytes() + red.tobytes()] * 2, f"W{columns} H{rows} F5:1")
    image = next(opened(data).frames()).image
    assert image.shape == (*shape, 3)
    assert image[0, 0].tolist() == [254, 0, 0]
    assert image[-1, -1].tolist() != [254, 0, 0]
    assert image[3, 6].tolist() == image[3, 0].tolist() == [254, 0, 0]


@pytest.mark.parametrize("bits", [8, 9, 10, 12, 14, 16])
def test_grey_of_all_bits_as_it_is(bits):
    dtype = np.dtype("<u2" if bits > 8 else "u1")
    frames = [np.arange(48).reshape(6, 8) * ((1 << bits) - 1) // 47 for _ in range(2)]
    name = "mono" if bits == 8 else f"mono{bits}"
    source = opened(y4m([f.astype(dtype).tobytes() for f in frames], f"W8 H6 F25:1 C{name}"))
    assert (source.encoding, source.full_scale) == (
        "srgb" if bits == 8 else "linear",
        (1 << bits) - 1,
    )
    assert all(np.array_equal(f.image, g) for f, g in zip(source.frames(), frames, strict=True))
    assert source.notes == []


def test_grey_of_a_limited_range():
    frame = np.linspace(16, 235, 48).astype(np.uint8).tobytes()
    source = opened(y4m([frame] * 2, "W8 H6 F25:1 Cmono XCOLORRANGE=LIMITED"))
    image = next(source.frames()).image
    assert (image.min(), image.max()) == (0, 255)


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ("W8 H6 F25:1 It", r"interlaced Y4M \(It\); make whole pictures of it: -vf bwdif"),
        ("W8 H6 F25:1 Im", r"interlaced Y4M \(Im\)"),
        ("W8 H6 F25:1 C411", "pixels of '411'; write others: -pix_fmt yuv420p"),
        ("W8 H6 F25:1 C444alpha", "pixels of '444alpha'"),
        ("W8 H6 F25:1 C420p10", "pixels of '420p10'; .*, with -strict -1, gray10le"),
        ("W8 H6 F25:1 Cmono17", "pixels of 'mono17'"),
        ("W8 F25:1", "does not state width and height"),
        ("W8 H-6 F25:1", "does not state width and height"),
        ("W0 H6 F25:1", "frames of 0x6, must have from 1 to 33,554,432 pixels"),
        ("W100000 H100000 F25:1", "frames of 100000x100000, must have"),
        ("W8 H6 Fast", "frame rate of 'ast': damaged"),
        ("W8 H6 F9999999999:1", "frame rate that cannot be"),
        ("W8 H6 F0:0", "no times of its frames are known: give --fps F"),
        ("W8 H6", "no times of its frames are known: give --fps F"),
        ("W8 H6 X" + 1100 * "x", "header does not end"),
    ],
)
def test_headers_that_are_not_read_say_what_would_be(tags, message):
    with pytest.raises(DataError, match=f"^standard input: .*{message}"):
        opened(y4m([planes(16)] * 2, tags))


def test_frames_may_have_tags_of_their_own():
    assert len(list(opened(y4m([planes(16)] * 3, marker="FRAME Ip XA=1\n")).frames())) == 3


def raw(frames):
    return b"".join(frame.tobytes() for frame in frames)


@pytest.mark.parametrize("name", PIXEL_FORMATS)
def test_raw_video(picture, name):
    shape = (6, 8) if name.startswith("gray") else (6, 8, 3)
    deep = name.endswith("le")
    bits = int(name.strip("grayleb")) if name.startswith("gray") and deep else 16 if deep else 8
    frames = [
        picture(n, shape, np.uint16 if deep else np.uint8) >> (16 - bits if deep else 0)
        for n in range(3)
    ]
    stored = [frame[..., ::-1] if name == "bgr24" else frame for frame in frames]
    data = raw([frame.astype("<u2" if deep else "u1") for frame in stored])
    source = opened(data, fps=100, pixel_format=name, size=(8, 6))
    coming = list(source.frames())
    assert all(np.array_equal(f.image, g) for f, g in zip(coming, frames, strict=True))
    assert [frame.t_ns for frame in coming] == [0, 10_000_000, 20_000_000]
    grey = len(shape) == 2
    assert (source.kind, source.colour, source.full_scale) == ("raw", not grey, (1 << bits) - 1)
    assert source.encoding == ("linear" if grey and deep else "srgb")


def test_what_raw_video_needs(picture):
    data = raw([picture(n, (6, 8)) for n in range(3)])
    with pytest.raises(
        DataError, match=r"is not Y4M; .*--size WxH and --pixel-format: gray, gray10"
    ):
        opened(data, fps=10)
    with pytest.raises(DataError, match="no times of its frames are known"):
        opened(data, pixel_format="gray", size=(8, 6))
    with pytest.raises(DataError, match="is Y4M, which says its pixels: leave --pixel-format out"):
        opened(y4m([planes(16)] * 3), pixel_format="gray", size=(8, 6))
    with pytest.raises(DataError, match="nothing came through it"):
        opened(b"", pixel_format="gray", size=(8, 6), fps=10)
    with pytest.raises(DataError, match="frames of 999999x999999"):
        opened(data, pixel_format="gray", size=(999999, 999999), fps=10)
    wide = np.full((6, 8), 4000, "<u2")
    with pytest.raises(DataError, match="frame 0: a number of 4000, above the 1023 of 10 bits"):
        opened(raw([wide] * 2), pixel_format="gray10le", size=(8, 6), fps=10)
    with pytest.raises(DataError, match="a single frame; at least two"):
        list(opened(data[:48], fps=10, pixel_format="gray", size=(8, 6)).frames())


def test_smallest_frames(picture):
    data = bytes(range(9))
    source = opened(data, fps=10, pixel_format="gray", size=(1, 1))
    assert [int(frame.image[0, 0]) for frame in source.frames()] == list(range(9))


def test_options_know_the_same_names():
    assert NAMES == PIXEL_FORMATS


def test_raw_video_comes_through_standard_input_alone(tmp_path, write_images, picture):
    folder = write_images([picture(0), picture(1)])
    with pytest.raises(UsageError, match="INPUT must be -, and --size WxH says"):
        open_source(folder, fps=10, pixel_format="gray", size=Size(8, 6))
    with pytest.raises(UsageError, match="INPUT must be -, and --size WxH says"):
        open_source("-", fps=10, pixel_format="gray")


def test_frames_come_once():
    source = opened(y4m([planes(16)] * 3))
    assert len(list(source.frames())) == 3
    with pytest.raises(DataError, match="its frames were read, and come only once"):
        next(source.frames())


def test_no_frame_is_read_before_it_is_wanted():
    data = y4m([planes(16 + n) for n in range(9)])
    file = io.BytesIO(data)
    frames = open_pipe(GivenTimes(), Selection(), file=file).frames()
    next(frames)
    assert file.tell() <= len(data) - 7 * 72


def test_a_mark_that_is_cut_short():
    data = y4m([planes(16)] * 2) + b"FRAME Ip"
    with pytest.raises(DataError, match=r"ends within frame 2; --allow-damaged takes those"):
        list(opened(data).frames())
    assert len(list(opened(data, allow_damaged=True).frames())) == 2


@pytest.mark.parametrize("kept", [1, 30, 72 + 6 - 1])
@pytest.mark.parametrize("kind", ["y4m", "raw"])
def test_a_last_frame_that_is_cut_short(kind, kept):
    if kind == "y4m":
        data, given = y4m([planes(16)] * 3), {}
        whole = len(data) - 78
    else:
        data, given = bytes(48 * 3), {"fps": 10, "pixel_format": "gray", "size": (8, 6)}
        whole, kept = 96, min(kept, 47)
    with pytest.raises(DataError, match=r"ends within frame 2.*; --allow-damaged takes those"):
        list(opened(data[: whole + kept], **given).frames())
    source = opened(data[: whole + kept], allow_damaged=True, **given)
    assert len(list(source.frames())) == 2
    assert any("ends within frame 2" in note for note in source.notes)
    assert len(list(opened(data[:whole], **given).frames())) == 2


def test_damage_between_frames():
    data = y4m([planes(16)] * 4)
    data = data[:-78] + b"frame\n" + data[-72:]
    with pytest.raises(DataError, match="damaged before frame 3: no line FRAME"):
        list(opened(data).frames())


@pytest.mark.parametrize(("times", "message"), [(2, "2 times, and more"), (4, "4 times for 3")])
def test_times_from_a_list(tmp_path, times, message):
    path = tmp_path / "t.txt"
    path.write_text("0.5\n0.75\n1.25\n")
    source = opened(y4m([planes(16)] * 3), timestamps=path)
    assert [frame.t_ns for frame in source.frames()] == [5 * 10**8, 75 * 10**7, 125 * 10**7]
    assert source.has_clock
    assert any("replaces the 25 Hz of the stream" in note for note in source.notes)
    path.write_text("".join(f"{n / 4}\n" for n in range(times)))
    with pytest.raises(DataError, match=rf"t\.txt: {message}"):
        list(opened(y4m([planes(16)] * 3), timestamps=path).frames())


def test_a_part_and_mosaics(picture):
    data = raw([picture(n, (6, 8)) for n in range(10)])
    given = {"fps": 10, "pixel_format": "gray", "size": (8, 6)}
    frames = list(opened(data, start_s=0.2, stop_s=0.5, **given).frames())
    assert [frame.t_ns for frame in frames] == [2 * 10**8, 3 * 10**8, 4 * 10**8, 5 * 10**8]
    assert np.array_equal(frames[0].image, picture(2, (6, 8)))
    source = opened(data, bayer="RGGB", **given)
    assert (source.colour, source.light.encoding_reason) == (True, "a mosaic of RGGB")


def run(*arguments, data):
    return subprocess.run(
        [sys.executable, "-m", "adv2e", *map(str, arguments)],
        input=data, capture_output=True, check=False, timeout=300,
    )  # fmt: skip


def test_through_a_pipe_it_is_converted_and_told_of(tmp_path):
    data = y4m([planes(40 + 30 * n) for n in range(6)])
    done = run("convert", "-", "--fps", "240", "-o", tmp_path / "a.h5", data=data)
    assert done.returncode == 0, done.stderr
    recording = read_events(tmp_path / "a.h5")
    assert (recording.width, recording.height, len(recording.events) > 0) == (8, 6, True)
    assert recording.metadata["source"]["kind"] == "y4m"
    done = run("info", "-", "--json", data=data)
    report = json.loads(done.stdout)
    assert (report["file"], report["layout"]) == ("standard input", "y4m")
    assert report["frames"]["count"] == 6
    options = ("--size", "12x12", "--pixel-format", "gray", "--fps", "10")
    report = json.loads(run("info", "-", "--json", *options, data=bytes(144 * 4)).stdout)
    assert (report["layout"], report["frames"]["count"]) == ("raw", 4)


@pytest.mark.thorough
def test_nothing_is_left_of_a_conversion_that_fails(tmp_path):
    data = y4m([planes(40 + 30 * n) for n in range(6)])[:-5]
    done = run("convert", "-", "-o", tmp_path / "a.h5", data=data)
    assert done.returncode == 1
    assert b"standard input: ends within frame 5" in done.stderr
    assert not [*tmp_path.iterdir()]


def test_what_never_comes_takes_no_memory():
    tracemalloc.start()
    with pytest.raises(DataError, match="ends within frame 0"):
        opened(y4m([bytes(100)], "W8192 H4096 F25:1 Cmono16"))
    assert tracemalloc.get_traced_memory()[1] < 8 << 20
    tracemalloc.stop()


def test_a_terminal_is_no_source(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stdin", Terminal())
    with pytest.raises(DataError, match="standard input: is a terminal"):
        open_source("-", fps=10)
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(DataError, match="standard input: is closed"):
        open_source("-", fps=10)


TAGS = st.lists(
    st.sampled_from(
        [
            *("W8", "H6", "W1", "H0", "W99999999", "F25:1", "F1:0", "F:", "Ip", "It", "C420"),
            *("C444", "Cmono", "Cmono10", "C", "A1:1", "XCOLORRANGE=FULL", "X", "", "\xff", "\n"),
        ]
    ),
    max_size=8,
).map(" ".join)


@settings(max_examples=200, deadline=None)
@given(
    st.one_of(st.just("W8 H6 F25:1 C420jpeg"), TAGS),
    st.binary(max_size=300),
    st.integers(0, 3),
    st.booleans(),
)
def test_any_stream_gives_frames_or_an_error(tags, noise, frames, damaged):
    data = f"YUV4MPEG2 {tags}\n".encode("latin-1") + frames * (b"FRAME\n" + bytes(72)) + noise
    try:
        coming = list(opened(data, allow_damaged=damaged).frames())
    except DataError as error:
        assert "\n" not in str(error)
        return
    assert len(coming) >= 2
    assert all(frame.image.nbytes <= len(data) * 3 for frame in coming)
