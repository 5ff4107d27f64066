from __future__ import annotations

import re
import struct
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.sources import open_source
from adv2e.sources.video import source as video


def times_of(source):
    return [frame.t_ns for frame in source.frames()]


def at_rate(hz, count):
    return [round(Fraction(n * 10**9) / hz) for n in range(count)]


@pytest.fixture
def colours(picture):
    """Twelve colour pictures with detail that compresses badly."""
    return [picture(n, (48, 64, 3)) for n in range(12)]


@pytest.fixture
def smooth():
    """Thirty pictures that every codec can hold: a ramp that moves."""
    rows, columns = np.mgrid[:48, :64]
    ramps = [(rows + 2 * columns + 5 * n) % 256 for n in range(30)]
    return [np.stack([r, r[::-1], r[:, ::-1]], -1).astype(np.uint8) for r in ramps]


@pytest.mark.parametrize("suffix", ["avi", "mkv"])
def test_lossless_colour_comes_back_as_rgb(write_video, colours, suffix):
    source = open_source(write_video(f"clip.{suffix}", colours))
    frames = list(source.frames())
    assert all(np.array_equal(f.image, image) for f, image in zip(frames, colours, strict=True))
    assert (source.kind, source.width, source.height, source.count) == ("video", 64, 48, 12)
    assert (source.dtype, source.colour, source.has_clock) == (np.uint8, True, False)
    assert (source.encoding, source.full_scale, source.notes) == ("srgb", 255, [])


@pytest.mark.parametrize(("dtype", "encoding"), [(np.uint8, "srgb"), (np.uint16, "linear")])
def test_lossless_grey_comes_back_as_stored(write_video, picture, dtype, encoding):
    stored = [picture(n, (48, 64), dtype) for n in range(5)]
    source = open_source(write_video("clip.mkv", stored))
    frames = list(source.frames())
    assert all(np.array_equal(f.image, image) for f, image in zip(frames, stored, strict=True))
    assert (source.dtype, source.colour, source.encoding) == (dtype, False, encoding)
    assert source.full_scale == np.iinfo(dtype).max
    depth = "16-bit grey video" if dtype == np.uint16 else "usual for video that states no curve"
    assert (source.light.encoding_reason, source.notes) == (depth, [])


def test_threads_that_decode_change_nothing(write_video, colours, monkeypatch):
    monkeypatch.setattr(video, "_DECODER_PIXELS", 100)
    source = open_source(write_video("clip.mp4", colours, 30, "mp4v"))
    frames = []
    for threads in (1, 3):
        source.threads = threads
        frames.append([(frame.t_ns, frame.image.tobytes()) for frame in source.frames()])
    assert frames[0] == frames[1]
    assert len(frames[0]) == 12


@pytest.mark.parametrize(
    "hz",
    [Fraction(n) for n in (24, 25, 30, 50, 60)]
    + [Fraction(n, 1001) for n in (24000, 30000, 60000)],
)
def test_matroska_stands_for_its_rate_and_not_for_milliseconds(write_video, picture, hz):
    path = write_video("clip.mkv", [picture(0, (16, 16, 3))] * 300, float(hz))
    source = open_source(path)
    assert times_of(source) == at_rate(hz, 300)
    assert source.count == 300


def find_block(data, ms):
    """Return where the time of the block of track 1 at a time [ms] stands in a Matroska file."""
    pattern = rb"\xa3[\x20-\x7f]..?\x81(" + re.escape(struct.pack(">h", ms)) + rb")[\x00\x80]"
    (found,) = re.finditer(pattern, data, re.DOTALL)
    return found.start(1)


def test_matroska_of_variable_rate_keeps_its_own_milliseconds(write_video, colours):
    path = write_video("clip.mkv", colours, fps=10)
    data = path.read_bytes()
    steps = [0, 100, 190, 300, 405, 500, 600, 777, 800, 900, 1000, 1100]
    blocks = [find_block(data, 100 * number) for number in range(len(steps))]
    for place, step in zip(blocks, steps, strict=True):
        data = data[:place] + struct.pack(">h", step) + data[place + 2 :]
    path.write_bytes(data)
    assert times_of(open_source(path)) == [step * 10**6 for step in steps]


def with_durations(data, durations):
    """Return an MP4 file of OpenCV's with other frame durations [ticks] in its ``stts`` box."""
    start = data.index(b"stts") - 4
    (size,) = struct.unpack_from(">I", data, start)
    entries = b"".join(struct.pack(">II", 1, duration) for duration in durations)
    table = struct.pack(">I4sII", 16 + len(entries), b"stts", 0, len(durations)) + entries
    data = bytearray(data[:start] + table + data[start + size :])
    for parent in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        place = data.index(parent) - 4
        (old,) = struct.unpack_from(">I", data, place)
        struct.pack_into(">I", data, place, old + len(table) - size)
    struct.pack_into(">I", data, data.index(b"elst") + 12, 10**6)  # show all of it
    return bytes(data)


def test_variable_rate_is_followed_frame_by_frame(write_video, smooth):
    path = write_video("clip.mp4", smooth[:6], 25, "mp4v")
    data = path.read_bytes()
    (ticks,) = struct.unpack_from(">I", data, data.index(b"stts") + 16)  # of 1/25 s
    durations = [ticks, 2 * ticks, ticks // 2, 5 * ticks, ticks, ticks]
    path.write_bytes(with_durations(data, durations))
    starts = np.concatenate([[0], np.cumsum(durations[:-1])]).tolist()
    assert times_of(open_source(path)) == [round(Fraction(s * 10**9, 25 * ticks)) for s in starts]


def test_a_video_trimmed_by_its_edit_list_is_whole(write_video, smooth):
    path = write_video("clip.mp4", smooth, 25, "mp4v")
    data = bytearray(path.read_bytes())
    for place in (data.index(b"elst") + 12, data.index(b"tkhd") + 24):
        assert struct.unpack_from(">I", data, place) == (1200,)  # [ms]
        struct.pack_into(">I", data, place, 400)
    path.write_bytes(data)
    assert times_of(open_source(path)) == at_rate(Fraction(25), 10)


def test_times_that_do_not_increase_name_the_frame_and_the_remedy(write_video, smooth):
    path = write_video("clip.mp4", smooth[:6], 25, "mp4v")
    path.write_bytes(with_durations(path.read_bytes(), [512, 512, 0, 512, 512, 512]))
    with pytest.raises(DataError, match=r"clip\.mp4: frame 3: times must increase.*--fps"):
        times_of(open_source(path))
    assert times_of(open_source(path, fps=2)) == at_rate(Fraction(2), 6)


def test_given_times_replace_the_files_and_a_note_says_so(write_video, colours, tmp_path):
    path = write_video("clip.avi", colours)
    source = open_source(path, fps=240)
    assert times_of(source) == at_rate(Fraction(240), 12)
    assert (source.notes, source.has_clock) == (["--fps 240 replaces the times in the file"], False)
    times = tmp_path / "t.txt"
    times.write_text("".join(f"1468941032.{n:09d}\n" for n in range(12)))
    source = open_source(path, timestamps=times)
    assert times_of(source) == [1468941032_000000000 + n for n in range(12)]
    assert source.has_clock


@pytest.mark.parametrize("count", [11, 13, 3])
@pytest.mark.parametrize("name", ["clip.avi", "clip.mkv"])
def test_another_number_of_times_is_told_at_once(write_video, colours, tmp_path, name, count):
    times = tmp_path / "t.txt"
    times.write_text("".join(f"{n}\n" for n in range(count)))
    path = write_video(name, colours)
    with pytest.raises(DataError, match=rf"{name}: {count} times given for 12 frames"):
        open_source(path, timestamps=times)


def test_selection_reads_no_further_than_asked(write_video, colours):
    path = write_video("clip.avi", colours)
    source = open_source(path, start_s=0.08, stop_s=0.2)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [n * 40_000_000 for n in range(2, 6)]
    assert np.array_equal(frames[0].image, colours[2])
    assert source.count == 4
    assert times_of(open_source(path, start_s=0.08, stop_s=0.2, t0="zero"))[0] == 0


@pytest.mark.parametrize(("suffix", "codec"), [("avi", "FFV1"), ("mkv", "FFV1"), ("mp4", "mp4v")])
@pytest.mark.parametrize("given", [None, "fps", "timestamps"])
@pytest.mark.parametrize("part", [(0.0, 0.44), (0.08, 0.2), (0.1, None), (0.05, 0.17), (0.3, 9.0)])
def test_frames_of_a_part_are_counted_before_they_are_read(
    write_video, tmp_path, smooth, suffix, codec, given, part
):
    path = write_video(f"clip.{suffix}", smooth, codec=codec)
    if given == "timestamps":
        (tmp_path / "times.txt").write_text("".join(f"{7 + n * n * 1e-3}\n" for n in range(30)))
    times = {"fps": {"fps": 100}, "timestamps": {"timestamps": tmp_path / "times.txt"}}
    if given == "fps":
        part = (part[0] / 4, part[1] and part[1] / 4)
    source = open_source(path, start_s=part[0], stop_s=part[1], **times.get(given, {}))
    assert source.count == len(times_of(source))


def test_start_behind_the_end_says_how_long_the_video_is(write_video, colours):
    source = open_source(write_video("clip.avi", colours), start_s=3)
    with pytest.raises(
        DataError, match=r"clip\.avi: --start and --stop leave no frames, .* 0.44 s"
    ):
        times_of(source)


def test_a_single_frame_is_refused_before_it_is_handed_out(write_video, colours):
    source = open_source(write_video("clip.mkv", colours[:1]))
    with pytest.raises(DataError, match=r"clip\.mkv: a single frame; at least two are needed"):
        next(source.frames())


CONTAINERS = [
    ("clip.mp4", "mp4v"),
    ("clip.avi", "MJPG"),
    ("clip.mkv", "FFV1"),
    ("clip.avi", "FFV1"),
]


@pytest.mark.parametrize(("name", "codec"), CONTAINERS)
@pytest.mark.parametrize("share", [0.4, 0.95])
def test_a_video_cut_short_is_refused_at_once(write_video, smooth, name, codec, share):
    path = write_video(name, smooth, 25, codec)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(DataError, match=rf"{name}: cut short"):
        open_source(path)


@pytest.mark.parametrize(("name", "codec"), CONTAINERS)
def test_a_video_damaged_inside_is_refused(write_video, smooth, name, codec):
    path = write_video(name, smooth, 25, codec)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + len(data) // 4] = bytes(len(data) // 4)
    path.write_bytes(data)
    with pytest.raises(DataError, match=rf"{name}: .*(damaged|could be decoded where it states)"):
        times_of(open_source(path))


@pytest.mark.parametrize("data", [b"", b"no video at all" * 100, b"\0\0\0\x18ftypmp42"])
def test_files_that_are_no_video(tmp_path, data):
    path = tmp_path / "clip.mp4"
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"clip\.mp4: ") as caught:
        open_source(path)
    assert "\n" not in str(caught.value)


def test_opencv_and_ffmpeg_print_nothing_about_broken_files(write_video, smooth, tmp_path):
    path = write_video("clip.mp4", smooth, 25, "mp4v")
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + len(data) // 4] = bytes(len(data) // 4)
    path.write_bytes(data)
    (tmp_path / "none.mp4").write_bytes(b"no video at all" * 100)
    # in a process of its own, as the level of FFmpeg's messages is set when it is first used
    code = """if True:
        import sys
        from adv2e.errors import DataError
        from adv2e.sources import open_source
        for path in sys.argv[1:]:
            try:
                list(open_source(path).frames())
            except DataError as error:
                print(error)
    """
    arguments = [sys.executable, "-c", code, str(path), str(tmp_path / "none.mp4")]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 2
