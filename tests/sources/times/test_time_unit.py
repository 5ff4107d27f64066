"""One rule for the unit of times, whatever is opened; --time-unit settles what it leaves open."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

from adv2e.errors import DataError, UsageError
from adv2e.events import make_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink, write_events
from adv2e.sources import open_source

PER_S = {"s": 1, "ms": 1000, "us": 10**6, "ns": 10**9}


def times_of(source):
    return [frame.t_ns for frame in source.frames()]


def listed(unit, fps, count, *, whole=False):
    """Times of frames as a list has them."""
    number = "{:.0f}" if whole else "{:.6f}"
    return [number.format(n * PER_S[unit] / fps) for n in range(count)]


@pytest.fixture
def clip(write_video, picture):
    return write_video("clip.mkv", [picture(n, (24, 32, 3)) for n in range(6)], 30)


@pytest.mark.parametrize("fps", [25, 400])
@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_times_of_a_video_in_another_unit_are_found_and_told(clip, tmp_path, adv2e, unit, fps):
    times = tmp_path / "t.txt"
    times.write_text("\n".join(listed(unit, fps, 6)))
    source = open_source(clip, timestamps=times)
    assert times_of(source) == [n * 10**9 // fps for n in range(6)]
    (doubt,) = source.doubts
    assert f"taken as {unit} ({fps} frames a second)" in doubt
    assert "--time-unit" in doubt
    assert f"problem     {doubt}" in adv2e("info", clip, "--timestamps", times).out
    told = adv2e("convert", clip, "--timestamps", times, "-o", tmp_path / "a.txt")
    assert told.err.splitlines()[0] == doubt
    assert open_source(clip, timestamps=times, time_unit=unit).doubts == []


def test_a_thousandfold_from_the_times_of_the_video_is_told(clip, tmp_path):
    times = tmp_path / "t.txt"
    times.write_text("\n".join(f"{n / 30e3:.12f}" for n in range(6)))
    (doubt,) = open_source(clip, timestamps=times).doubts
    assert "3.33333e-05 s apart, where the video's own are 0.03" in doubt


def test_a_video_of_its_own_times_has_no_use_for_a_unit(clip):
    with pytest.raises(DataError, match=r"clip\.mkv: --time-unit is for lists of times"):
        open_source(clip, time_unit="ms")
    with pytest.raises(UsageError, match="--time-unit is for lists of times, which --fps"):
        open_source(clip, fps=30, time_unit="ms")
    with pytest.raises(UsageError, match="time_unit: must be s, ms, us or ns, got 'm'"):
        open_source(clip, time_unit="m")


@pytest.fixture
def recording(write_images, picture):
    """Write a recording with its lists in the units given; returns its folder."""
    folder = write_images([picture(n) for n in range(4)], "rec/images").parent

    def write(frames, events):
        rows = zip(frames, range(4), strict=True)
        (folder / "images.txt").write_text("".join(f"{t} images/frame_{n}.png\n" for t, n in rows))
        (folder / "events.txt").write_text(
            "".join(f"{t} {n % 32} 3 1\n" for n, t in enumerate(events))
        )
        return folder

    return write


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_frames_and_events_of_a_recording_are_in_one_unit(recording, unit):
    events = sorted(f"{n * 150 * PER_S[unit] // 10**6:020d}" for n in range(500))
    folder = recording(listed(unit, 40, 4, whole=True), events)
    frames_ns = [0, 25_000_000, 50_000_000, 75_000_000]
    found = read_events(folder)
    assert found.frame_times_ns.tolist() == frames_ns
    assert abs(int(found.events["t"].max()) - 499 * 150) < 1000
    assert any(f"taken as {unit}" in problem for problem in found.problems)
    for opened in (folder, folder / "images"):
        assert times_of(open_source(opened)) == frames_ns
        assert f"taken as {unit}" in open_source(opened).doubts[0]


def test_a_unit_given_is_that_of_the_list_without_points(recording):
    folder = recording(listed("us", 40, 4, whole=True), ["0.001", "0.07"])
    found = read_events(folder, time_unit="ms")
    assert found.frame_times_ns.tolist() == [0, 25 * 10**9, 50 * 10**9, 75 * 10**9]
    assert found.events["t"].tolist() == [1000, 70_000]


def test_a_unit_given_is_that_of_both(recording):
    folder = recording(["0.0", "0.5", "1.5", "2.5"], ["1.5", "2.25"])
    found = read_events(folder, time_unit="ms")
    assert found.frame_times_ns.tolist() == [0, 500_000, 1_500_000, 2_500_000]
    assert found.events["t"].tolist() == [1500, 2250]
    assert found.problems == []


@pytest.mark.parametrize(
    ("unit", "text", "t_us"),
    [
        ("s", "1500 1 2 1\n", 1_500_000_000),
        ("ms", "1500 1 2 1\n", 1_500_000),
        ("us", "1500 1 2 1\n", 1500),
        ("ns", "1500 1 2 1\n", 2),
        ("ns", "1468941032229165635 1 2 1\n", 1_468_941_032_229_166),
        ("us", "1500.4 1 2 1\n", 1500),
        ("ms", "1.0005 1 2 1\n", 1001),
    ],
)
def test_a_unit_given_for_events_in_text(tmp_path, unit, text, t_us):
    path = tmp_path / "e.txt"
    path.write_text(text)
    assert read_events(path, time_unit=unit).events["t"].tolist() == [t_us]


def test_slow_frames_that_we_wrote_are_in_seconds(recording, adv2e, tmp_path):
    folder = recording(["0.0", "2.0", "4.0", "6.0"], ["0.1"])
    assert open_source(folder).doubts
    out = tmp_path / "out"
    assert adv2e("convert", folder, "--time-unit", "s", "-o", out).status == 0
    for path in (out, out / "images"):
        source = open_source(path)
        assert (times_of(source)[-1], source.doubts) == (6 * 10**9, [])
    report = json.loads(adv2e("info", out, "--json").out)
    assert report["frames"]["last_ns"] == 6 * 10**9


def test_what_dvs_voltmeter_writes_is_in_microseconds(write_images, picture):
    folder = write_images([picture(n) for n in range(3)])
    (folder / "info.txt").write_text(
        "".join(f"frames/frame_{n}.png {n * 41667}\n" for n in range(3))
    )
    source = open_source(folder)
    assert times_of(source) == [0, 41_667_000, 83_334_000]
    assert "are taken as us (23.9998 frames a second)" in source.doubts[0]


def test_info_of_a_stack_tells_its_doubts(adv2e, tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((3, 4, 5), np.uint8))
    np.save(tmp_path / "a_ts.npy", np.array([0, 40_000, 80_000]))
    out = adv2e("info", tmp_path / "a.npy").out
    assert "frame span  0 to 0.08 s" in out
    assert "are taken as us (25 frames a second); --time-unit settles it" in out
    assert "0 to 80 s" in adv2e("info", tmp_path / "a.npy", "--time-unit", "ms").out


# files of events that are no text


def hdf5(path, ts, stamps=(), **attributes):
    with h5py.File(path, "w") as file:
        n = np.arange(len(ts))
        columns = {"ts": np.asarray(ts), "xs": n % 40, "ys": n % 30, "ps": n % 2 == 0}
        for name, column in columns.items():
            file[f"events/{name}"] = column
        for number, stamp in enumerate(stamps):
            image = file.create_dataset(f"images/image{number:09d}", data=np.zeros((30, 40), "u1"))
            image.attrs["timestamp"] = stamp
        file.attrs.update(attributes)
    return path


def npz(path, t, name="t"):
    n = np.arange(len(t))
    np.savez(path, **{name: np.asarray(t)}, x=n % 40, y=n % 30, p=n % 2)
    return path


EVENTS_US = np.arange(1000) * 137


@pytest.mark.parametrize("write", [hdf5, npz])
@pytest.mark.parametrize(
    ("t", "name", "told"),
    [
        (EVENTS_US / 1e6, "s", False),
        (EVENTS_US, "us", True),
        (EVENTS_US.astype(np.float64), "us", True),
        (EVENTS_US.astype(np.uint32), "us", True),
        (EVENTS_US + 1_468_941_032 * 10**6, "us", False),
        ((EVENTS_US + 1_468_941_032 * 10**6) * 1000, "ns", False),
    ],
)
def test_event_files_are_read_by_the_same_rule(tmp_path, write, t, name, told):
    found = read_events(write(tmp_path / ("a.npz" if write is npz else "a.h5"), t))
    begin = 1_468_941_032 * 10**6 if t.max() > 1e9 else 0
    assert np.array_equal(found.events["t"], EVENTS_US + begin)
    doubts = [problem for problem in found.problems if "no unit is stated" in problem]
    assert [f"times are taken as {name}" in doubt for doubt in doubts] == [True] * told


@pytest.mark.parametrize("write", [hdf5, npz])
def test_a_unit_given_for_event_files(tmp_path, write):
    path = write(tmp_path / ("a.npz" if write is npz else "a.h5"), np.array([1000, 2000]))
    for unit, rate in PER_S.items():
        found = read_events(path, time_unit=unit)
        assert found.events["t"].tolist() == [10**9 // rate, 2 * 10**9 // rate]
        assert not any("no unit" in problem for problem in found.problems)


@pytest.mark.parametrize(("name", "scale"), [("t_s", 1e6), ("t_ms", 1e3), ("t_ns", 1e-3)])
def test_a_column_may_state_its_unit(tmp_path, name, scale):
    found = read_events(npz(tmp_path / "a.npz", [1000, 2000], name))
    assert found.events["t"].tolist() == [1000 * scale, 2000 * scale]
    assert not any("no unit" in problem for problem in found.problems)


def test_images_in_hdf5_tell_the_unit_of_events_beside_them(tmp_path):
    path = hdf5(tmp_path / "a.h5", EVENTS_US / 1000, [0.0, 40.0, 80.0, 120.0])
    found = read_events(path)
    assert found.frame_times_ns.tolist() == [0, 40_000_000, 80_000_000, 120_000_000]
    assert np.array_equal(found.events["t"], EVENTS_US)
    assert "images: no unit is stated: times 40 apart are taken as ms" in found.problems[0]
    ours = hdf5(tmp_path / "b.h5", [0.1, 90.0], [0.0, 40.0, 80.0], adv2e='{"adv2e": "1"}')
    assert read_events(ours).frame_times_ns.tolist() == [0, 40 * 10**9, 80 * 10**9]


def test_events_and_frames_that_share_no_time_are_told(tmp_path):
    def problems(*stamps):
        path = hdf5(tmp_path / "a.h5", EVENTS_US / 1e6, stamps)
        return [one for one in read_events(path).problems if "another unit" in one]

    assert problems(0.0, 0.04, 0.08) == []
    assert problems(5.0, 5.04, 5.08) == [
        "events are from 0 to 0.136863 s, frames from 5 to 5.08 s: are some in another unit?"
        " --time-unit settles it"
    ]


def test_other_commands_take_the_unit(adv2e, tmp_path):
    path = npz(tmp_path / "a.npz", EVENTS_US)
    told = adv2e("compare", path, path)
    assert told.err.count("no unit is stated: times are taken as us") == 2
    settled = adv2e("compare", path, path, "--time-unit", "us")
    assert (settled.status, "no unit" in settled.err, settled.out) == (0, False, told.out)
    drawn = adv2e("render", path, "-o", tmp_path / "a.png", "--time-unit", "us")
    assert (drawn.status, "no unit" in drawn.err) == (0, False)


@pytest.mark.parametrize("name", ["a.raw", "a.aedat", "a.es", "a.h5", "a.txt"])
def test_a_unit_for_times_of_a_known_one_is_told(adv2e, tmp_path, name):
    path = tmp_path / name
    write_events(path, make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0]), (4, 3))
    told = adv2e("convert", path, "-o", tmp_path / "out.csv", "--time-unit", "ms")
    assert told.status == 0
    assert f"{path}: --time-unit ms is not followed: the file says what its times are" in told.err
    assert read_events(tmp_path / "out.csv").events["t"].tolist() == [10, 20]


def test_a_unit_beside_a_list_is_that_of_the_list(adv2e, tmp_path):
    path, times = tmp_path / "a.h5", tmp_path / "times.txt"
    with open_sink(path, width=40, height=30, metadata={}, with_frames=True) as sink:
        for number in range(3):
            sink.write_frame(number * 10**7, np.full((30, 40), 60 * number, np.uint8))
    times.write_text("0\n40\n80\n")
    words = ("--from", "frames", "--timestamps", times, "--time-unit", "ms", "--with-frames")
    told = adv2e("convert", path, "-o", tmp_path / "out.h5", *words)
    assert (told.status, "not followed" in told.err) == (0, False), told.err
    assert read_events(tmp_path / "out.h5").frame_times_ns.tolist() == [0, 40_000_000, 80_000_000]
