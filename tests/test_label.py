"""The label of events: what was guessed, made up, clipped and left out; and --strict."""

from __future__ import annotations

import csv
import hashlib
import itertools
import json
import re
import zlib
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.stream import Disposition
from video_files import pictures, written

import adv2e as ours
from adv2e.errors import DataError
from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink, write_events
from adv2e.in_python import in_python
from adv2e.label import Label, Line, guessed, left_out, rows_of, told_of

pytestmark = pytest.mark.filterwarnings("ignore::adv2e.errors.Adv2eWarning")

DOCUMENT = Path(__file__).parents[1] / "docs" / "label.md"
SAID = {"frames": {"encoding": "srgb"}}


def ramp(count=5, dtype=np.uint8, scale=1):
    """Frames of 8x6 that are all different, and neither 0 nor white."""
    rows, columns = np.mgrid[:6, :8]
    return np.stack([(scale * (20 + 30 * n + columns + rows)) for n in range(count)]).astype(dtype)


def stack(tmp_path, frames):
    np.save(tmp_path / "clip.npy", frames)
    return tmp_path / "clip.npy"


def folder(tmp_path, names, colour=True):
    place = tmp_path / "pictures"
    place.mkdir(parents=True, exist_ok=True)
    for image, name in zip(ramp(len(names)), names, strict=True):
        cv2.imwrite(str(place / name), np.stack([image] * 3, -1) if colour else image)
    return place


def converted(source, tmp_path, name="out.h5", **options):
    """Return the label of a conversion, and all lines that it told."""
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("adv2e.conversion.convert.warn", told.append)
        done = ours.convert(source, tmp_path / name, overwrite=True, **options)
    return read_events(tmp_path / name).metadata["label"], [*told, *done.notes]


# ---- Inputs of which something must be guessed: the input, options, the guess, and what says it.


def video(tmp_path):
    return written(tmp_path / "clip.avi", "mpeg4", 25), {}, ("frames.encoding", "srgb"), {}


def grey_pictures(tmp_path):
    names = [f"{n}.png" for n in range(4)]
    made = folder(tmp_path, names, colour=False), {"fps": 25}
    return *made, ("frames.encoding", "srgb"), {"config": SAID}


def colour_pictures(tmp_path):
    names = [f"{n}.jpg" for n in range(4)]
    return folder(tmp_path, names), {"fps": 25}, ("frames.encoding", "srgb"), {"config": SAID}


def floats(tmp_path):
    source = stack(tmp_path, ramp(dtype=np.float32, scale=1 / 256))
    linear = {"config": {"frames": {"encoding": "linear"}}}
    return source, {"fps": 25}, ("frames.encoding", "linear"), linear


def recording(tmp_path):
    """A recording of a camera: its frames are linear by custom."""
    write_recording(tmp_path / "camera")
    linear = {"config": {"frames": {"encoding": "linear"}}}
    return tmp_path / "camera", {}, ("frames.encoding", "linear"), linear


def write_recording(place):
    (place / "images").mkdir(parents=True)
    for n, image in enumerate(ramp(4)):
        cv2.imwrite(str(place / "images" / f"{n}.png"), image)
    lines = [f"{0.04 * n:.9f} images/{n}.png\n" for n in range(4)]
    (place / "images.txt").write_text("".join(lines))
    (place / "events.txt").write_text("0.010000000 1 2 1\n0.020000000 7 5 0\n")


def twelve_bits(tmp_path):
    source = stack(tmp_path, ramp(dtype=np.uint16, scale=16))
    said = {"config": {"frames": {"full_scale": 4095}}}
    return source, {"fps": 25}, ("frames.full_scale", 65535), said


def above_one(tmp_path):
    frames = ramp(dtype=np.float32, scale=1 / 128)
    frames[0, 0, 0] = 1.5
    source = stack(tmp_path, frames)
    said = {"config": {"frames": {"full_scale": 2.0}}}
    return source, {"fps": 25}, ("frames.full_scale", 1.0), said


def milliseconds(tmp_path):
    (tmp_path / "times.txt").write_text("".join(f"{40 * n}\n" for n in range(5)))
    given = {"timestamps": tmp_path / "times.txt"}
    return stack(tmp_path, ramp()), given, ("time unit", "ms"), {"time_unit": "ms"}


def decimals(tmp_path):
    """Names of which the order depends on what the digits after the point are."""
    names = ["7.9.png", "7.10.png", "7.11.png", "7.12.png"]
    source = folder(tmp_path, names)
    listed = "".join(f"{0.04 * n} {name}\n" for n, name in enumerate(names))
    (tmp_path / "named.txt").write_text(listed)
    said = {"timestamps": tmp_path / "named.txt", "fps": None}
    return source, {"fps": 25}, ("order of frames", "by name"), said


def two_tracks(tmp_path):
    with av.open(str(tmp_path / "clip.mkv"), "w") as film:
        streams = [film.add_stream("mpeg4", rate=25) for _ in range(2)]
        for number, stream in enumerate(streams):
            stream.width, stream.height, stream.pix_fmt = 32, 24, "yuv420p"
            stream.disposition = Disposition.default if number else Disposition(0)
            stream.metadata["title"] = ("left", "right")[number]
        for n in range(6):
            for stream in streams:
                image = np.full((24, 32, 3), 30 * n, np.uint8)
                frame = av.VideoFrame.from_ndarray(image, "rgb24")
                frame.pts, frame.time_base = n, Fraction(1, 25)
                film.mux(stream.encode(frame))
        for stream in streams:
            film.mux(stream.encode(None))
    return tmp_path / "clip.mkv", {}, ("track", "right"), {"track": 1}


def no_container(tmp_path):
    path = tmp_path / "clip.h264"
    with av.open(str(path), "w", format="h264") as film:
        stream = film.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for image in pictures(8):
            film.mux(stream.encode(av.VideoFrame.from_ndarray(image, "rgb24")))
        film.mux(stream.encode(None))
    return path, {}, ("fps", 30.0), {"fps": 30}


def gopro(tmp_path):
    place = tmp_path / "GOPR0372_07_00"
    place.mkdir()
    for n, image in enumerate(ramp(4)):
        cv2.imwrite(str(place / f"{323 + n:06d}.png"), image)
    return place, {}, ("fps", 240), {"fps": 240}


def two_cameras(tmp_path):
    for camera in ("cam0", "cam1"):
        place = tmp_path / "set" / "mav0" / camera
        (place / "data").mkdir(parents=True)
        stamps = [1403636579763555584 + 50_000_000 * n for n in range(3)]
        for image, stamp in zip(ramp(3), stamps, strict=True):
            cv2.imwrite(str(place / "data" / f"{stamp}.png"), image)
        lines = ["#timestamp [ns],filename", *(f"{t},{t}.png" for t in stamps)]
        (place / "data.csv").write_text("\n".join(lines) + "\n")
    one = {"source": tmp_path / "set" / "mav0" / "cam0"}
    return tmp_path / "set", {}, ("camera", "the first"), one


def poses(tmp_path):
    """Poses beside a video, at times in a unit that nothing states."""
    place = tmp_path / "clip.npy.side"
    place.mkdir()
    lines = [f"{40 * n} 0 0 0 0 0 0 1\n" for n in range(5)]
    (place / "groundtruth.txt").write_text("".join(lines))
    return stack(tmp_path, ramp()), {"fps": 25}, ("time unit", "ms"), {"side": "none"}


FRAMES = {
    one.__name__: one
    for one in (
        *(video, grey_pictures, colour_pictures, floats, recording, twelve_bits, above_one),
        *(milliseconds, decimals, two_tracks, no_container, gopro, two_cameras, poses),
    )
}


def no_unit(tmp_path):
    lines = [f"{1000 * n} {n % 8} {n % 6} {n % 2}\n" for n in range(200)]
    (tmp_path / "a.txt").write_text("8 6\n" + "".join(lines))
    return tmp_path / "a.txt", {}, ("time unit", "us"), {"time_unit": "us"}


def no_size(tmp_path):
    lines = [f"{n / 1000 + 1e-5:.9f} {n % 8} {n % 6} {n % 2}\n" for n in range(200)]
    (tmp_path / "a.txt").write_text("".join(lines))
    return tmp_path / "a.txt", {}, ("size", "8x6"), {"size": "8x6"}


def one_less(tmp_path):
    lines = [f"{n / 1000 + 1e-5:.9f} {n % 8} {n % 6} {n % 2}\n" for n in range(200)]
    (tmp_path / "a.txt").write_text("7 5\n" + "".join(lines))
    return tmp_path / "a.txt", {}, ("size", "8x6"), {"size": "8x6"}


def unusual_columns(tmp_path):
    lines = [f"{n % 8} {n % 6} {n % 2} {n / 1000 + 1e-5:.6f}\n" for n in range(200)]
    (tmp_path / "a.txt").write_text("8 6\n" + "".join(lines))
    return tmp_path / "a.txt", {}, ("columns", "x y polarity time"), None


def no_heading(tmp_path):
    with (tmp_path / "a.csv").open("w", newline="") as file:
        rows = ([n / 1000 + 1e-5, n % 8, n % 6, n % 2] for n in range(200))
        csv.writer(file).writerows(rows)
    return tmp_path / "a.csv", {"size": "8x6"}, ("columns", "t,x,y,p"), None


def three_signs(tmp_path):
    lines = [f"{n / 1000 + 1e-5:.9f} {n % 8} {n % 6} {n % 3 - 1}\n" for n in range(200)]
    (tmp_path / "a.txt").write_text("8 6\n" + "".join(lines))
    return tmp_path / "a.txt", {}, ("polarity", "-1 and 0 are OFF"), None


def odd_sign(tmp_path):
    lines = [
        f"{n / 1000 + 1e-5:.9f} {n % 8} {n % 6} {2 if n == 9 else n % 2}\n" for n in range(2000)
    ]
    (tmp_path / "a.txt").write_text("8 6\n" + "".join(lines))
    return tmp_path / "a.txt", {}, ("polarity", "ON above 0"), None


def no_chip(tmp_path):
    words = np.array([(179 << 22 | 239 << 12, 9), (5 << 22, 10)], ">u4").tobytes()
    (tmp_path / "a.aedat").write_bytes(b"#!AER-DAT2.0\r\n#End Of ASCII Header\r\n" + words)
    return tmp_path / "a.aedat", {}, ("size", "240x180"), {"size": "240x180"}


EVENTS = {
    one.__name__: one
    for one in (
        *(no_unit, no_size, one_less, unusual_columns, no_heading, three_signs, odd_sign),
        no_chip,
    )
}


@pytest.mark.parametrize("case", [*FRAMES, *EVENTS])
def test_a_guess_is_told_in_the_label_and_refused(tmp_path, case):
    source, options, (what, value), said = {**FRAMES, **EVENTS}[case](tmp_path)
    is_encoding = what == "frames.encoding"
    config = {} if is_encoding or case in EVENTS else {"config": SAID}

    label, told = converted(source, tmp_path, **config, **options)

    (guess,) = (one for one in label["guessed"] if one["what"] == what)
    assert guess["value"] == value
    assert len(guess["why"]) > 10
    assert str(tmp_path) not in json.dumps(label)
    assert any(word in line for line in told for word in (what, str(value), guess["why"]))
    with pytest.raises(DataError) as raised:
        ours.convert(source, tmp_path / "strict.h5", **config, **options, strict=True)
    assert str(raised.value).startswith(f"{source}: ")
    assert f"{what}: {value} is a guess: " in str(raised.value)
    assert "\n" not in str(raised.value)
    assert not (tmp_path / "strict.h5").exists()
    if said is None:
        return
    said = said or {"config": SAID}
    merged = {"source": source, **config, **options, **said}
    if config and "config" in said:
        merged["config"] = [SAID, said["config"]]
    ours.convert(output=tmp_path / "strict.h5", strict=True, **merged)
    assert read_events(tmp_path / "strict.h5").metadata["label"]["guessed"] == []


CALLS = {
    "aedat2.py": 1,  # no_chip
    "base.py": 2,  # twelve_bits; frames of other encodings
    "columns.py": 1,  # no_unit
    "csv.py": 1,  # no_heading
    "ddd.py": 1,  # DDD17 without frames
    "decoding.py": 1,  # video and others
    "frame.py": 1,  # two_tracks
    "gopro.py": 1,  # gopro
    "listed.py": 1,  # above_one
    "listing.py": 2,  # no_container; a video with some times
    "listings.py": 1,  # two_cameras
    "rates.py": 3,  # milliseconds; times unlike those of a video
    "reading.py": 4,  # odd_sign, three_signs, no_size, one_less
    "source.py": 1,  # decimals
    "stream.py": 1,  # Y4M
    "tables.py": 1,  # poses
    "text.py": 1,  # unusual_columns
}
"""Places in the code that guess, and the cases here that they are in."""


def test_every_place_that_guesses_has_a_case():
    found = {}
    for path in Path(ours.__file__).parent.rglob("*.py"):
        calls = re.findall(r"(?<!def )\bguessed(?:_unit)?\(", path.read_text("utf-8"))
        if calls:
            found[path.name] = len(calls)
    assert found == CALLS


def test_a_ddd_recording_without_frames(tmp_path):
    from ddd_files import polarity, write_ddd

    path = write_ddd(tmp_path / "a.hdf5", [polarity([(1, 2, 3, 1), (9, 4, 5, 0)])])
    label, _ = converted(path, tmp_path)
    assert [(one["what"], one["value"]) for one in label["guessed"]] == [("size", "346x260")]
    with pytest.raises(DataError, match="size: 346x260 is a guess: give size"):
        ours.convert(path, tmp_path / "b.h5", strict=True)


def test_times_unlike_those_of_the_video(tmp_path):
    clip = written(tmp_path / "clip.avi", "mpeg4", 25)
    times = tmp_path / "times.txt"
    times.write_text("".join(f"{40_000 * n}\n" for n in range(36)))
    label, _ = converted(clip, tmp_path, config=SAID, timestamps=times)
    assert [one["what"] for one in label["guessed"]] == ["time unit"]
    times.write_text("".join(f"{0.1 * n / 1000}\n" for n in range(36)))
    with pytest.raises(DataError, match="time unit: s is a guess"):
        ours.convert(clip, tmp_path / "b.h5", SAID, timestamps=times, strict=True)


def test_a_video_with_some_times(tmp_path):
    """H.264 in an MPEG program stream: FFmpeg writes a time for the first alone."""
    clip = written(tmp_path / "clip.mpg", "libx264", 25, reordered=2)
    label, _ = converted(clip, tmp_path, config=SAID)
    assert [one["what"] for one in label["guessed"]] == ["times of frames"]
    with pytest.raises(DataError, match=r"times of frames: .* is a guess: give fps or timestamps"):
        ours.convert(clip, tmp_path / "b.h5", SAID, strict=True)
    ours.convert(clip, tmp_path / "b.h5", SAID, fps=25, strict=True)


def test_frames_of_other_encodings_are_refused_when_they_come(tmp_path):
    """The first states linear light, a later one nothing: only reading tells."""
    place = folder(tmp_path, [f"{n}.png" for n in range(4)])
    data = (place / "0.png").read_bytes()
    chunk = b"gAMA" + (100_000).to_bytes(4, "big")
    head = 8 + 25
    stated = (4).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big")
    (place / "0.png").write_bytes(data[:head] + stated + data[head:])
    label, _ = converted(place, tmp_path, fps=25)
    assert [(one["what"], one["value"]) for one in label["guessed"]] == [
        ("frames.encoding", "linear")
    ]
    with pytest.raises(DataError, match=r"frames\.encoding: linear is a guess"):
        ours.convert(place, tmp_path / "b.h5", fps=25, strict=True)
    assert not (tmp_path / "b.h5").exists()
    ours.convert(place, tmp_path / "b.h5", SAID, fps=25, strict=True)


def test_all_guesses_are_in_one_message_and_no_other_doubt_is_an_error(tmp_path, adv2e):
    source, options, *_ = milliseconds(tmp_path)
    words = ("convert", source, "--timestamps", options["timestamps"], "-o", tmp_path / "a.h5")
    done = adv2e(*words, "--strict")
    assert done.status == 1
    line = done.err.splitlines()[-1]
    assert "frames.encoding: srgb is a guess: give --set frames.encoding=..." in line
    assert "time unit: ms is a guess: give --time-unit ms, or another" in line
    assert not (tmp_path / "a.h5").exists()
    done = adv2e(*words, "--strict", "--time-unit", "ms", "--set", "frames.encoding=srgb")
    assert done.status == 0, done.err
    # frames far apart are doubtful, and no guess
    times = [0, 1, 2, 90]
    (tmp_path / "gap.txt").write_text("".join(f"{t}\n" for t in times))
    np.save(tmp_path / "four.npy", ramp(4))
    words = ("convert", tmp_path / "four.npy", "--timestamps", tmp_path / "gap.txt", "--strict")
    settled = ("--time-unit", "s", "--set", "frames.encoding=srgb", "--set", "sampling.L=1")
    done = adv2e(*words, *settled, "-o", tmp_path / "b.h5")
    assert done.status == 0, done.err
    assert "no frame for 88 s" in done.err


def test_strict_in_python_names_arguments():
    frames = list(ramp())
    with pytest.raises(DataError) as raised:
        next(ours.simulate(frames, fps=100, strict=True))
    assert "frames.encoding: srgb is a guess: give sets frames.encoding=" in str(raised.value)
    events = np.concatenate(list(ours.simulate(frames, fps=100, config=SAID, strict=True)))
    plain = np.concatenate(list(ours.simulate(frames, fps=100, config=SAID)))
    assert np.array_equal(events, plain)


# ---- What the frames show of themselves.


def clips(draw):
    """Frames of which some repeat, some are clipped, at times with gaps."""
    rng = np.random.default_rng(draw)
    frames = [rng.integers(0, 256, (6, 8), np.uint8) for _ in range(9)]
    frames[5][:3] = 255
    frames[6][:2] = 0
    for n in (3, 4, 7):
        frames[n] = frames[n - 1].copy()
    steps = rng.choice([10_000, 10_000, 10_000, 30_000], 8)
    return np.stack(frames), np.concatenate([[0], np.cumsum(steps)])


@pytest.mark.parametrize("draw", [0, 1, 2])
@pytest.mark.parametrize(("threads", "parts"), [(1, 10), (2, 10), (2, 1)])
def test_numbers_of_the_label_are_those_of_the_frames(tmp_path, draw, threads, parts):
    frames, times_us = clips(draw)
    source = stack(tmp_path, frames)
    (tmp_path / "times.txt").write_text("".join(f"{t}\n" for t in times_us))
    given = {"timestamps": tmp_path / "times.txt", "time_unit": "us", "threads": threads}
    floor = {"pixel": {"log_response": {"linear_below": 0, "floor": 3.0}}}
    config = [SAID, floor, {"sampling": {"L": parts}}]  # with one, the kernel decodes
    label, _ = converted(source, tmp_path, config=config, **given)

    same = sum(a.tobytes() == b.tobytes() for a, b in itertools.pairwise(frames))
    steps = [b - a for a, b in itertools.pairwise(times_us)]
    usual = sorted(steps)[3:5]
    long = [step for step in steps if step > 0.75 * sum(usual)]
    values = frames.ravel().tolist()
    light = [255 * ((v / 255 + 0.055) / 1.055) ** 2.4 if v > 10 else v / 12.92 for v in values]
    assert same >= 3
    assert label["made_up"] == {
        "interpolation": "linear",
        "share": 1.0,
        "interval_us": sum(usual) / 2,
        "longest_us": max(steps),
        "gaps": len(long),
        "gap_share": pytest.approx(sum(long) / sum(steps)),
        "repeated": same,
    }
    assert label["clipped"] == {
        "black": values.count(0) / len(values),
        "white": values.count(255) / len(values),
        "floor": sum(one <= 3.0 for one in light) / len(values),
    }


@pytest.mark.parametrize(
    ("dtype", "scale", "white"),
    [(np.uint16, 16, 4095), (np.float32, 1 / 256, 0.5), (np.uint8, 1, 300)],
)
def test_white_is_that_of_the_configuration(tmp_path, dtype, scale, white):
    frames = ramp(6, dtype, scale)
    frames[2, 0] = min(white, 255) if dtype == np.uint8 else white
    config = [SAID, {"frames": {"full_scale": white}}]
    label, _ = converted(stack(tmp_path, frames), tmp_path, config=config, fps=50)
    count = sum(float(value) >= white for value in frames.ravel())
    assert label["clipped"] == {"black": 0.0, "white": count / frames.size}
    assert (count > 0) == (dtype != np.uint8)


def test_the_share_without_a_shutter(tmp_path):
    source = stack(tmp_path, ramp())
    lines = [f"{40 * n},{40 * n + 10}\n" for n in range(5)]
    (tmp_path / "times.txt").write_text("start,end\n" + "".join(lines))
    given = {"timestamps": tmp_path / "times.txt", "time_unit": "ms"}
    label, _ = converted(source, tmp_path, config=[SAID, {"sampling": {"L": 1}}], **given)
    assert label["made_up"]["share"] == pytest.approx(0.75)
    label, _ = converted(
        source, tmp_path, config=[SAID, {"frames": {"exposure_us": 30_000}}], fps=25
    )
    assert label["made_up"]["share"] == pytest.approx(0.25)
    assert label["made_up"]["interpolation"] == "linear"
    label, _ = converted(source, tmp_path, config=SAID, fps=25, start_s=0.04, stop_s=0.12)
    assert label["left_out"] == ["what is before 0.04 s and after 0.12 s from the begin"]


def test_a_sensor_that_moves_before_a_picture_repeats_nothing_while_it_moves(tmp_path):
    image = np.random.default_rng(0).integers(40, 200, (40, 40), np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), image)
    label, _ = converted(tmp_path / "photo.png", tmp_path, config=SAID, motion="pan", extent_px=4)
    assert label["made_up"]["repeated"] == 0
    assert label["clipped"] == {"black": 0.0, "white": 0.0}


def test_events_that_the_readout_loses_are_counted(tmp_path):
    source = stack(tmp_path, np.repeat(ramp(), 3, axis=0) + np.uint8(0))
    lossy = {"readout": {"loss": {"fraction": 0.5}}}
    whole = ours.convert(source, tmp_path / "whole.h5", SAID, fps=25)
    done = ours.convert(source, tmp_path / "lossy.h5", [SAID, lossy], fps=25)
    label = read_events(tmp_path / "lossy.h5").metadata["label"]
    assert whole.events > done.events
    assert label["left_out"] == [f"{whole.events - done.events:,} events that the readout lost"]


def test_digests_are_those_of_the_file_and_of_the_manifest(tmp_path):
    (tmp_path / "clips").mkdir()
    written(tmp_path / "clips" / "a.avi", "mpeg4", 25)
    ours.batch(tmp_path / "clips", tmp_path / "out", SAID, jobs=1)
    metadata = read_events(tmp_path / "out" / "a.h5").metadata
    text = json.dumps([metadata["config"]], sort_keys=True)
    record = json.loads((tmp_path / "out" / "manifest.jsonl").read_text().splitlines()[-1])
    assert metadata["label"]["sha256"] == {
        "config": hashlib.sha256(text.encode()).hexdigest(),
        "source": record["source_sha256"],
    }
    assert len(record["source_sha256"]) == 64


# ---- Where the label goes.

NAMES = ("a.h5", "a.txt", "a.csv", "a.zip", "a", "a.npz", "a.raw", "a.dat", "a.aedat4", "a.aedat")
FORMATS = [(name, None) for name in NAMES] + [
    ("a.es", None),
    ("b.raw", "evt2"),
    ("c", "ros2"),
    ("a.bag", None),
]


@pytest.mark.parametrize(("name", "format"), FORMATS)
def test_every_format_has_the_whole_label_and_a_copy_keeps_it(tmp_path, name, format):
    if format == "ros2" or name.endswith(".bag"):
        pytest.importorskip("rosbags", reason="bags need it")
    frames, _ = clips(1)
    source = stack(tmp_path, frames)
    label, _ = converted(source, tmp_path, fps=25)
    (tmp_path / "in").mkdir()
    given = {} if format is None else {"format": format}
    ours.convert(source, tmp_path / "in" / name, fps=25, **given)
    found = read_events(tmp_path / "in" / name).metadata["label"]
    assert found == label
    assert found["made_up"]["repeated"] == 3
    ours.convert(tmp_path / "in" / name, tmp_path / "copy.npz", take="events")
    kept = read_events(tmp_path / "copy.npz").metadata["label"]
    left = ["frames"] if name in ("a.zip", "a") else []
    assert kept == {**label, "left_out": left}
    (tmp_path / "to").mkdir()
    ours.convert(tmp_path / "out.h5", tmp_path / "to" / name, **given)
    assert read_events(tmp_path / "to" / name).metadata["label"] == label
    ours.write_events(tmp_path / "python.h5", ours.read_events(tmp_path / "to" / name))
    assert read_events(tmp_path / "python.h5").metadata["label"] == label


def test_a_copy_adds_what_it_guesses_and_leaves_out(tmp_path):
    source = stack(tmp_path, ramp())
    label, _ = converted(source, tmp_path, fps=25, causes=True, with_frames=True)
    ours.convert(tmp_path / "out.h5", tmp_path / "a.npz", start_s=0.01)
    kept = read_events(tmp_path / "a.npz").metadata["label"]
    assert kept["guessed"] == label["guessed"]
    assert kept["left_out"] == ["what is before 0.01 s from the begin", "frames", "causes"]
    path, *_ = no_size(tmp_path)
    outside = path.read_text() + "0.300000000 70000 1 1\n"
    path.write_text(outside)
    label, _ = converted(path, tmp_path)
    assert [one["what"] for one in label["guessed"]] == ["size"]
    assert label["left_out"] == ["1 events with a coordinate below 0 or above 65535: left out"]
    assert set(label) == {"guessed", "left_out"}


def test_what_a_batch_makes_without_events_has_the_label(tmp_path):
    (tmp_path / "clips").mkdir()
    written(tmp_path / "clips" / "a.avi", "mpeg4", 25)
    how = {"export": "voxel", "no_events": True, "jobs": 1}
    ours.batch(tmp_path / "clips", tmp_path / "out", **how)
    (told,) = (tmp_path / "out").rglob("export.json")
    label = json.loads(told.read_text())["simulated"]["label"]
    assert [one["what"] for one in label["guessed"]] == ["frames.encoding"]
    assert label["made_up"]["interval_us"] == 40_000


def test_a_strict_batch_goes_on_past_a_guess_and_twice_is_as_once(tmp_path, adv2e):
    place = tmp_path / "clips"
    place.mkdir()
    written(place / "a.avi", "mpeg4", 25)
    with av.open(str(place / "b.mp4"), "w") as film:
        stream = film.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.color_trc = 13
        for image in pictures(6):
            film.mux(stream.encode(av.VideoFrame.from_ndarray(image, "rgb24")))
        film.mux(stream.encode(None))
    words = ("batch", place, tmp_path / "out", "--strict", "--jobs", "1")
    for made in ("1 made", "0 made"):
        done = adv2e(*words)
        assert done.status == 1
        assert made in done.out
        assert "frames.encoding: srgb is a guess" in done.err
        assert (tmp_path / "out" / "b.h5").exists()
        assert not (tmp_path / "out" / "a.h5").exists()
    done = adv2e("batch", place, tmp_path / "out", "--jobs", "1")
    assert (done.status, (tmp_path / "out" / "a.h5").exists()) == (0, True)
    # what was made with guesses is not kept by one that makes none
    done = adv2e(*words)
    assert done.status == 1
    done = adv2e(*words, "--set", "frames.encoding=srgb")
    assert done.status == 0, done.err


def test_exports_and_comparisons_have_the_label(tmp_path, adv2e):
    source = stack(tmp_path, np.repeat(ramp(), 4, axis=0))
    label, _ = converted(source, tmp_path, fps=100)
    ours.export(tmp_path / "out.h5", tmp_path / "grids", "voxel", count=50)
    (told,) = json.loads((tmp_path / "grids" / "export.json").read_text())["inputs"]
    assert told["label"].pop("adv2e") == ours.__version__
    assert "numpy" in told["label"].pop("versions")
    assert told["label"] == label
    text, *_ = no_size(tmp_path)
    events = read_events(tmp_path / "out.h5").events
    lines = [f"{e['t'] / 1e6:.6f} {e['x']} {e['y']} {e['p']}\n" for e in events]
    text.write_text("".join(lines))
    found = json.loads(adv2e("compare", text, tmp_path / "out.h5", "--json").out)
    assert [one["what"] for one in found["measured"]["label"]["guessed"]] == ["size"]
    assert found["simulated"]["label"]["made_up"] == label["made_up"]
    text.write_text("8 6\n" + "".join(lines))
    found = json.loads(adv2e("compare", text, tmp_path / "out.h5", "--json").out)
    assert found["measured"]["label"] is None


# ---- Inspection.


def test_info_has_the_label_before_the_size(tmp_path, adv2e):
    frames, _ = clips(0)
    converted(stack(tmp_path, frames), tmp_path, fps=25, start_s=0.04)
    lines = adv2e("info", tmp_path / "out.h5").out.splitlines()
    label = json.loads(adv2e("info", tmp_path / "out.h5", "--json").out)["label"]
    black, white = (100 * label["clipped"][name] for name in ("black", "white"))
    assert lines[1] == "guessed     frames.encoding srgb (8-bit grey images)"
    assert lines[2] == (
        "made up     light between frames, by linear interpolation: 100 % of the time; frames are"
        " 40 ms apart; 3 frames repeat the one before"
    )
    assert lines[3] == (f"clipped     {black:.3g} % of the numbers are 0, {white:.3g} % are white")
    assert lines[4] == "left out    what is before 0.04 s from the begin"
    assert lines[5].startswith("layout")
    report = ours.info(tmp_path / "out.h5")
    assert "label" not in report["metadata"]
    assert report["label"] == read_events(tmp_path / "out.h5").metadata["label"]


def test_info_tells_what_a_conversion_of_frames_would_guess(tmp_path, adv2e):
    source, options, *_ = twelve_bits(tmp_path)
    out = adv2e("info", source, "--fps", options["fps"]).out
    assert "guessed     frames.encoding linear (16-bit grey images)" in out
    assert "guessed     frames.full_scale 65535 " in out


@pytest.mark.parametrize(
    "label", [7, {}, {"guessed": 3, "left_out": []}, {"guessed": [{}], "left_out": []}, None]
)
def test_files_with_another_label_or_none_are_read_as_before(tmp_path, adv2e, label):
    events = make_events([10, 20], [0, 3], [0, 2], [1, 0])
    metadata = {} if label is None else {"label": label}
    write_events(tmp_path / "a.h5", events, (4, 3), metadata=metadata)
    done = adv2e("info", tmp_path / "a.h5")
    assert done.status == 0
    assert ("label       damaged" in done.out) == (label is not None)
    assert "guessed" not in done.out
    assert adv2e("convert", tmp_path / "a.h5", "-o", tmp_path / "b.npz").status == 0
    copied = read_events(tmp_path / "b.npz").metadata["label"]
    assert copied["left_out"] == []
    held = label.get("guessed") if isinstance(label, dict) else None
    assert copied["guessed"] == (held if isinstance(held, list) else [])


def test_an_outgrown_head_keeps_what_it_began_with(tmp_path):
    """A description that outgrows the room of its head does not run into the events."""
    events = make_events([10, 20], [0, 3], [0, 2], [1, 0])
    for name in ("a.raw", "a.dat", "a.aedat", "a.aedat4"):
        more = {"a": 1}
        with open_sink(tmp_path / name, width=4, height=3, metadata={"more": more}) as sink:
            sink.write_events(events)
            more["b"] = "x" * 10_000
        found = read_events(tmp_path / name)
        assert found.metadata["more"] == {"a": 1}
        assert np.array_equal(found.events, events)


def test_every_key_of_a_label_and_every_guess_is_in_its_document(tmp_path):
    text = DOCUMENT.read_text("utf-8")
    keys, guesses = text.split("## Keys")[1].split("## Without guesses")
    label, _ = converted(stack(tmp_path, ramp()), tmp_path, fps=25)
    for key, value in label.items():
        for name in value if isinstance(value, dict) else ():
            assert f"{key}.{name}`" in keys or f"`.{name}`" in keys, name
        assert f"`{key}" in keys
    for case in (*FRAMES.values(), *EVENTS.values()):
        (tmp_path / case.__name__).mkdir()
        what, _ = case(tmp_path / case.__name__)[2]
        assert f"`{what}`" in guesses


def test_a_line_stays_one_in_other_words():
    line = guessed("no unit: --time-unit settles it", "time unit", "ms", "give --time-unit ms")
    for other in (in_python(line), told_of("a.txt", line)):
        assert isinstance(other, Line)
        assert (other.entry, other.settle) == (line.entry, line.settle)
    assert in_python(line) == "no unit: time_unit settles it"
    assert type(told_of("a.txt", "plain")) is str
    told = []
    label = Label(told.append, said={"time unit"})
    label(line)
    label(left_out("some"))
    assert (told, label.entries) == ([line, "some"], {"guessed": [], "left_out": ["some"]})
    label.refuse("a.txt")
    assert list(rows_of(label.entries)) == [("left out", "some")]
    simulated = {**label.entries, "sha256": {}}
    assert list(rows_of(simulated)) == [("guessed", "nothing"), ("left out", "some")]
