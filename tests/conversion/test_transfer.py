"""Event files written as other event files: what comes over, and that nothing is simulated."""

from __future__ import annotations

import errno
import itertools
import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from streams import random_events

import adv2e
from adv2e.errors import DataError, OutputError, UsageError
from adv2e.events import make_events
from adv2e.formats.hdf5_layouts import Layout
from adv2e.formats.writing import open_sink

WIDTH, HEIGHT = 30, 20
NAMES = ("a.h5", "a.txt", "a.zip", "a")


def events_of(count=5000, first=0, last=2_000_000):
    return random_events(1, count, first=first, last=last, size=(WIDTH, HEIGHT))


def frames_of(count=5):
    rng = np.random.default_rng(3)
    return [
        (k * 100_000_000, rng.integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8))
        for k in range(count)
    ]


def write(path, events, frames=(), metadata=None):
    described = metadata or {"adv2e": "0.0.1", "config": {"seed": 5}, "seed": 5}
    with open_sink(
        path, width=WIDTH, height=HEIGHT, metadata=described, with_frames=bool(frames)
    ) as sink:
        for t_ns, image in frames:
            sink.write_frame(t_ns, image)
        sink.write_events(events)
    return path


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("target", NAMES)
@pytest.mark.parametrize("source", NAMES)
@pytest.mark.quick_cases(1)
def test_events_and_size_come_over(source, target, adv2e, tmp_path):
    events = events_of()
    write(tmp_path / "from" / source, events)
    told = adv2e("convert", f"from/{source}", "-o", f"to/{target}")
    assert told.status == 0, told.err
    found = adv2e_read(tmp_path / "to" / target)
    assert np.array_equal(found.events, events)
    assert (found.width, found.height, found.problems) == (WIDTH, HEIGHT, [])
    assert "nothing was simulated" in told.out
    assert f"to/{target}: 5,000 events" in told.out


def adv2e_read(path):
    return adv2e.read_events(path)


@pytest.mark.parametrize("target", ["a.h5", "a.zip", "a"])
def test_frames_come_over_with_their_light(target, adv2e, tmp_path):
    frames = frames_of()
    light = {"adv2e": "0.0.1", "frames": {"encoding": "srgb", "full_scale": 255.0}}
    write(tmp_path / "b.zip", events_of(), frames, light)
    more = ("--with-frames",) if target == "a.h5" else ()
    assert adv2e("convert", "b.zip", "--from", "events", "-o", target, *more).status == 0
    found = adv2e_read(tmp_path / target)
    assert found.frame_times_ns.tolist() == [t for t, _ in frames]
    for frame, (_, image) in zip(found.frames(), frames, strict=True):
        assert np.array_equal(frame.image, image)
    assert found.encoding == "srgb"


def test_how_the_events_were_made_comes_over(adv2e, tmp_path):
    write(tmp_path / "a.h5", events_of())
    assert adv2e("convert", "a.h5", "-o", "b.txt").status == 0
    described = json.loads((tmp_path / "b.txt.json").read_text())
    assert (described["adv2e"], described["seed"], described["config"]) == ("0.0.1", 5, {"seed": 5})
    assert described["converted"]["name"] == "a.h5"
    assert (described["width"], described["height"]) == (WIDTH, HEIGHT)


def test_a_part_of_time_and_sensor(adv2e, tmp_path):
    events = events_of(first=1_000_000, last=3_000_000)
    write(tmp_path / "a.h5", events)
    first = int(events["t"][0])
    told = adv2e(
        *("convert", "a.h5", "-o", "b.h5", "--start", "0.5", "--stop", "1", "--t0", "zero"),
    )
    assert told.status == 0, told.err
    inside = (events["t"] >= first + 500_000) & (events["t"] <= first + 1_000_000)
    expected = events[inside]
    expected["t"] -= first + 500_000
    assert np.array_equal(adv2e_read(tmp_path / "b.h5").events, expected)


def test_a_part_of_the_sensor(adv2e, tmp_path):
    events, frames = events_of(), frames_of()
    write(tmp_path / "a.h5", events, frames)
    told = adv2e("convert", "a.h5", "-o", "b.zip", "--crop", "5,3,10,8")
    assert told.status == 0, told.err
    found = adv2e_read(tmp_path / "b.zip")
    x, y = events["x"].astype(int) - 5, events["y"].astype(int) - 3
    kept = (x >= 0) & (x < 10) & (y >= 0) & (y < 8)
    assert (found.width, found.height, found.events.size) == (10, 8, kept.sum())
    assert found.events["x"].tolist() == x[kept].tolist()
    assert found.events["y"].tolist() == y[kept].tolist()
    assert np.array_equal(next(found.frames()).image, frames[0][1][3:11, 5:15])
    told = adv2e("convert", "a.h5", "-o", "c.zip", "--crop", "25,3,10,8")
    assert (told.status, "--crop 25,3,10,8 does not lie on the sensor" in told.err) == (1, True)


def test_a_size_that_is_given_holds(adv2e, tmp_path):
    (tmp_path / "a.txt").write_text("0.1 3 2 1\n0.2 7 5 0\n0.3 31 0 1\n")
    told = adv2e("convert", "a.txt", "-o", "b.h5", "--size", "30x20", "--crop-events")
    assert "1 events outside 30x20, which --size states: left out" in told.err
    found = adv2e_read(tmp_path / "b.h5")
    assert (found.width, found.height, found.events.size) == (30, 20, 2)


def test_both_ends_of_a_part_belong_to_it(tmp_path):
    write(tmp_path / "a.h5", make_events([10, 20, 30, 40], [1] * 4, [2] * 4, [1] * 4))
    adv2e.convert("a.h5", "b.h5", start_s=10e-6, stop_s=20e-6)
    assert adv2e_read(tmp_path / "b.h5").events["t"].tolist() == [20, 30]


def test_a_text_without_a_size_takes_that_of_its_coordinates_and_says_so(adv2e, tmp_path):
    (tmp_path / "a.txt").write_text("0.1 3 2 1\n0.2 7 5 0\n")
    told = adv2e("convert", "a.txt", "-o", "b.h5")
    assert "a.txt: no geometry stated: 8x6 from the largest coordinates" in told.err
    found = adv2e_read(tmp_path / "b.h5")
    assert (found.width, found.height) == (8, 6)


def test_events_out_of_order_are_sorted_and_it_is_told(adv2e, tmp_path):
    (tmp_path / "a.txt").write_text("30 20\n0.2 3 2 1\n0.1 7 5 0\n")
    told = adv2e("convert", "a.txt", "-o", "b.h5")
    assert (
        "events are not in the order of time (1 steps back, the largest 100 ms): sorted" in told.err
    )
    assert adv2e_read(tmp_path / "b.h5").events["t"].tolist() == [100_000, 200_000]


def test_events_outside_the_sensor_are_left_out_and_it_is_told(adv2e, tmp_path):
    (tmp_path / "a.txt").write_text("30 20\n0.1 3 2 1\n0.2 40 5 0\n0.3 3 2 1\n")
    told = adv2e("convert", "a.txt", "-o", "b.h5")
    assert (told.status, "--crop-events leaves them out" in told.err) == (1, True)
    assert not (tmp_path / "b.h5").exists()
    told = adv2e("convert", "a.txt", "-o", "b.h5", "--crop-events")
    assert "1 events outside 30x20, which the first line states: left out" in told.err
    assert adv2e_read(tmp_path / "b.h5").events["t"].tolist() == [100_000, 300_000]


def test_events_of_one_time_stay_in_order_across_the_parts_of_reading(tmp_path, monkeypatch):
    from adv2e.formats import hdf5

    monkeypatch.setattr(hdf5, "PART", 3)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["events/ts"] = np.full(10, 0.5)
        file["events/xs"] = np.arange(10)[::-1].astype(np.int16)
        file["events/ys"] = np.zeros(10, np.int16)
        file["events/ps"] = np.ones(10, np.bool_)
        file.attrs["sensor_resolution"] = (1, 10)
    adv2e.convert("a.h5", "b.txt")
    rows = (tmp_path / "b.txt").read_text().split()
    assert rows[1::4] == [str(x) for x in reversed(range(10))]


@pytest.mark.parametrize("suffix", ["h5", "txt", "csv", "npz", "aedat", "dat", "es", "raw"])
def test_a_pixel_that_alternates_within_a_time_still_does(suffix, adv2e, tmp_path):
    (tmp_path / "a.csv").write_text("t_us,x,y,p\n5,7,8,1\n5,3,4,1\n5,3,4,0\n5,3,4,1\n6,3,4,0\n")
    said = ("--size", "10x10", "--time-unit", "us")
    assert adv2e("convert", "a.csv", "-o", f"b.{suffix}", *said).status == 0
    assert adv2e("convert", f"b.{suffix}", "-o", "c.csv", "--size", "10x10").status == 0
    rows = [tuple(map(int, line.split(","))) for line in Path("c.csv").read_text().split()[1:]]
    expected = [(5, 7, 8, 1), (5, 3, 4, 1), (5, 3, 4, 0), (5, 3, 4, 1), (6, 3, 4, 0)]
    assert rows == expected


def test_options_of_events_are_refused_where_frames_are_simulated(adv2e, tmp_path):
    write(tmp_path / "a.zip", events_of(), frames_of())
    told = adv2e("convert", "a.zip", "-o", "b.h5", "--crop-events")
    assert (told.status, "its frames are simulated" in told.err) == (1, True)


def test_a_recording_with_frames_is_simulated_unless_its_events_are_asked_for(adv2e, tmp_path):
    write(tmp_path / "a.zip", events_of(), frames_of())
    told = adv2e("convert", "a.zip", "-o", "b.txt", "-c", "ideal")
    assert "from 5 frames" in told.out
    told = adv2e("convert", "a.zip", "-o", "c.txt", "--from", "events")
    assert "nothing was simulated" in told.out


def test_frames_of_an_event_file_are_simulated_if_asked_for(adv2e, tmp_path):
    write(tmp_path / "a.h5", events_of(), frames_of())
    write(tmp_path / "a.zip", events_of(), frames_of())
    assert adv2e("convert", "a.h5", "-o", "b.txt", "--from", "frames", "-c", "ideal").status == 0
    assert adv2e("convert", "a.zip", "-o", "c.txt", "-c", "ideal").status == 0
    assert (tmp_path / "b.txt").read_bytes() == (tmp_path / "c.txt").read_bytes()


def test_an_event_file_without_frames_has_none_to_simulate(adv2e, tmp_path):
    write(tmp_path / "a.h5", events_of())
    told = adv2e("convert", "a.h5", "-o", "b.txt", "--from", "frames")
    assert (told.status, told.err) == (1, "adv2e: error: a.h5: holds events and no frames\n")


@pytest.mark.parametrize(
    "option",
    [("--seed", "0"), ("-c", "ideal"), ("--set", "pixel.leak=null"), ("--fps", "30"),
     ("--preview", "a.gif")],
)  # fmt: skip
def test_options_of_a_simulation_are_refused(option, adv2e, tmp_path):
    write(tmp_path / "a.h5", events_of())
    told = adv2e("convert", "a.h5", "-o", "b.txt", *option)
    assert told.status == 1
    assert "a.h5: its events are written, nothing is simulated: leave out -" in told.err
    assert not (tmp_path / "b.txt").exists()


def test_frames_are_refused_where_they_cannot_be_stored(adv2e, tmp_path):
    write(tmp_path / "a.zip", events_of(), frames_of())
    for more in ((), ("--from", "events")):
        told = adv2e("convert", "a.zip", "-o", "b.raw", "--with-frames", *more)
        assert told.status == 2
        assert "--with-frames: EVT 3.0 of Prophesee's cameras holds events alone" in told.err
    assert not (tmp_path / "b.raw").exists()


def test_frames_that_are_not_there_are_not_stored_without_a_word(adv2e, tmp_path):
    write(tmp_path / "a.h5", events_of())
    told = adv2e("convert", "a.h5", "-o", "b.h5", "--with-frames")
    assert told.status == 1
    assert "a.h5: holds events and no frames: leave --with-frames out" in told.err
    assert not (tmp_path / "b.h5").exists()


def test_a_recording_is_no_picture_to_move_before(adv2e, tmp_path):
    write(tmp_path / "a.aedat4", events_of(), frames_of())
    told = adv2e("convert", "a.aedat4", "-o", "b.txt", "--motion", "pan")
    assert (told.status, "--motion moves before one picture" in told.err) == (1, True)


def test_events_out_of_order_that_all_lie_outside_leave_none(adv2e, tmp_path):
    (tmp_path / "a.txt").write_text("0.2 9 9 1\n0.1 8 8 0\n")
    told = adv2e("convert", "a.txt", "-o", "b.h5", "--size", "4x3", "--crop-events")
    assert told.status == 0, told.err
    assert "2 events outside 4x3, which --size states: left out" in told.err
    assert adv2e_read(tmp_path / "b.h5").events.size == 0


@pytest.mark.parametrize(
    "option", [{"bayer": "RGGB"}, {"motion": "pan"}, {"fps": 30}, {"allow_damaged": True}]
)
def test_arguments_of_a_simulation_are_refused(option, tmp_path):
    write(tmp_path / "a.h5", events_of())
    with pytest.raises(DataError, match=f"nothing is simulated: leave out {next(iter(option))}"):
        adv2e_convert("a.h5", "b.txt", **option)


def test_an_output_must_be_named(adv2e, tmp_path):
    write(tmp_path / "a.h5", events_of())
    told = adv2e("convert", "a.h5")
    assert (told.status, "-o OUT is missing" in told.err) == (2, True)
    with pytest.raises(UsageError, match="output is missing"):
        adv2e_convert("a.h5")


def adv2e_convert(*given, **named):
    return adv2e.convert(*given, **named)


def test_the_input_is_not_written_over(tmp_path):
    before = write(tmp_path / "a.h5", events_of()).read_bytes()
    with pytest.raises(OutputError, match=r"a\.h5"):
        adv2e_convert("a.h5", "a.h5", overwrite=True)
    assert (tmp_path / "a.h5").read_bytes() == before


def test_a_line_that_is_wrong_leaves_nothing(tmp_path):
    (tmp_path / "a.txt").write_text("30 20\n" + "0.1 3 2 1\n" * 10 + "0.2 nine\n")
    with pytest.raises(DataError, match=r"a\.txt line 12: must be 'time x y polarity'"):
        adv2e_convert("a.txt", "b.h5")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.txt"]


def test_no_events_need_a_size(tmp_path):
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(DataError, match=r"a\.txt: no events, and no size of the sensor"):
        adv2e_convert("a.txt", "b.h5")
    (tmp_path / "a.txt").write_text("30 20\n")
    with pytest.warns(UserWarning, match="no events"):
        assert adv2e_convert("a.txt", "b.h5").events == 0


@pytest.mark.thorough
def test_memory_does_not_grow_with_the_file(tmp_path, monkeypatch):
    from adv2e.formats import hdf5

    monkeypatch.setattr(hdf5, "PART", 1 << 14)
    peaks = []
    for count in (100_000, 800_000):
        write(tmp_path / f"{count}.h5", events_of(count))
        tracemalloc.start()
        adv2e_convert(f"{count}.h5", f"{count}.txt", threads=1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + (4 << 20)  # of 10 MB that the larger one's events take


def failing_disk(opened, at):
    """Return what opens a file of which part `at`, over all readings, cannot be read."""
    count = itertools.count()

    def check():
        if next(count) == at:
            raise OSError(errno.EIO, "Input/output error")

    def open_failing(layout, path, facts):
        file = opened(layout, path, facts)

        def parts():
            for part in file.parts():
                check()
                yield part

        def shots():
            for shot in file.shots():
                yield replace(shot, load=lambda load=shot.load: check() or load())

        return replace(file, parts=parts, shots=file.shots and shots)

    return open_failing


@pytest.mark.parametrize("at", range(4))
def test_a_disk_that_fails_is_told_in_one_line_and_nothing_is_left(adv2e, monkeypatch, at):
    write("a.h5", events_of(), frames_of(2))
    # the events twice, and a frame for what is stored of it, and to store it
    monkeypatch.setattr(Layout, "open", failing_disk(Layout.open, at))
    told = adv2e("convert", "a.h5", "-o", "b.zip", "--from", "events")
    assert told.status == 1
    assert told.err == "adv2e: error: a.h5: cannot be read: Input/output error\n"
    assert [path.name for path in Path().iterdir()] == ["a.h5"]
