import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from ddd_files import frame, imu, packet, polarity, special, twin, write_ddd
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.formats import hdf5
from adv2e.formats.frames import open_frames, takes_events
from adv2e.formats.reading import open_events, read_events

CORNERS = [(7, 0, 0, 1), (7, 345, 0, 0), (9, 0, 259, 0), (12, 345, 259, 1), (12, 345, 259, 1)]
UPSIDE_DOWN = "the cameras of DDD17 and DDD20 were mounted upside down: --rotate180 turns"


def image(seed, rows=260, columns=346):
    return np.random.default_rng(seed).integers(0, 1024, (rows, columns)) << 6


def columns_of(recording):
    return [(int(e["t"]), int(e["x"]), int(e["y"]), int(e["p"])) for e in recording.events]


@pytest.mark.thorough
def test_events_and_frames_as_a_twin_has_them(tmp_path):
    rng = np.random.default_rng(0)
    packets, t = [], 10_000
    for number in range(150):
        steps = rng.integers(0, 30, 20)
        times = (t + np.cumsum(steps)).tolist()
        t = times[-1]
        events = [(t, *rng.integers(0, (346, 260, 2)).tolist()) for t in times]
        packets += [polarity(events, room=number % 5), imu()]
        if number % 40 == 5:
            packets.append(frame(t - 5000, image(number), exposure_us=4001))
    path = write_ddd(tmp_path / "rec1487339175.hdf5", packets)

    recording = read_events(path, rotate180=False)

    events, frames = twin(path)
    assert sorted(columns_of(recording)) == sorted(events)
    assert recording.frame_times_ns.tolist() == [t * 1000 for t, _ in frames]
    for read, (_, stored) in zip(recording.frames(), frames, strict=True):
        assert read.image.dtype == np.uint16
        assert np.array_equal(read.image, stored)
    assert (recording.layout, recording.width, recording.height) == ("ddd", 346, 260)
    assert recording.encoding == "linear"


def test_corners_and_what_is_told(tmp_path):
    path = write_ddd(tmp_path / "a.hdf5", [polarity(CORNERS), frame(5000, image(0))])
    recording = read_events(path)
    assert columns_of(recording) == CORNERS
    (told,) = [problem for problem in recording.problems if "repeat" not in problem]
    assert told.startswith(UPSIDE_DOWN)


def test_turned_it_is_upright_and_nothing_is_told(tmp_path):
    path = write_ddd(tmp_path / "a.hdf5", [polarity(CORNERS), frame(5000, image(0))])
    recording = read_events(path, rotate180=True)
    turned = [(t, 345 - x, 259 - y, p) for t, x, y, p in CORNERS]
    assert sorted(columns_of(recording)) == sorted(turned)
    (read,) = recording.frames()
    assert np.array_equal(read.image, np.rot90(image(0), 2))
    assert not any("upside" in problem for problem in recording.problems)


def test_room_behind_the_items_is_not_read_and_invalid_ones_are_left_out(tmp_path):
    packets = [polarity(CORNERS, room=100), polarity([(20, 1, 2, 1)] * 3, valid=0)]
    recording = read_events(write_ddd(tmp_path / "a.hdf5", [*packets, frame(50, image(1))]))
    assert columns_of(recording) == CORNERS
    assert "3 events are marked as invalid: left out" in recording.problems


def test_times_beyond_31_bits_are_counted_by_the_heads(tmp_path):
    packets = [
        polarity([(2**31 - 5, 1, 1, 1)]),
        special(0),
        polarity([(3, 2, 2, 0)], wraps=1),
        frame(5000, image(0), wraps=1),
        polarity([(9, 3, 3, 0)], wraps=4),
    ]
    recording = read_events(write_ddd(tmp_path / "a.hdf5", packets))
    wrap = 2**31
    assert recording.events["t"].tolist() == [wrap - 5, wrap + 3, 4 * wrap + 9]
    assert recording.frame_times_ns.tolist() == [(wrap + 5000) * 1000]
    assert not any("set back" in problem for problem in recording.problems)


def test_a_wrap_that_the_heads_do_not_count(tmp_path):
    packets = [polarity([(2**31 - 5, 1, 1, 1)]), polarity([(3, 2, 2, 0)]), frame(9000, image(0))]
    recording = read_events(write_ddd(tmp_path / "a.hdf5", packets))
    assert recording.events["t"].tolist() == [2**31 - 5, 2**31 + 3]
    assert recording.frame_times_ns.tolist() == [(2**31 + 9000) * 1000]


@pytest.mark.parametrize("announced", [True, False])
def test_a_clock_that_is_set_back_goes_on(tmp_path, announced):
    packets = [
        polarity([(5_000_000, 1, 1, 1), (5_000_100, 1, 1, 1)]),
        frame(4_990_000, image(0)),
        *([special(1)] if announced else []),
        polarity([(30, 2, 2, 0)]),
        frame(40_000, image(1)),
        polarity([(50_000, 2, 2, 0)]),
    ]
    recording = read_events(write_ddd(tmp_path / "a.hdf5", packets))
    assert recording.events["t"].tolist() == [5_000_000, 5_000_100, 5_000_130, 5_050_100]
    assert recording.frame_times_ns.tolist() == [4_990_000_000, 5_040_100_000]
    told = "the clock was set back by 5.00007 s at event 2: times go on from those before"
    assert told in recording.problems


def test_small_steps_back_need_an_announcement(tmp_path):
    begin, after = [polarity([(900, 1, 1, 1)])], [polarity([(200, 1, 1, 1)])]
    plain = read_events(write_ddd(tmp_path / "a.hdf5", begin + after))
    reset = read_events(write_ddd(tmp_path / "b.hdf5", [*begin, special(1), *after]))
    assert plain.events["t"].tolist() == [200, 900]
    assert reset.events["t"].tolist() == [900, 1100]


def test_without_frames_the_size_is_told_and_events_are_converted(tmp_path):
    path = write_ddd(tmp_path / "a.hdf5", [polarity(CORNERS)])
    recording = read_events(path)
    assert (recording.width, recording.height) == (346, 260)
    assert recording.frame_times_ns is None
    assert any(problem.startswith("no frame tells the size") for problem in recording.problems)
    assert takes_events(path)


def test_no_packets_at_all(tmp_path):
    recording = read_events(write_ddd(tmp_path / "a.hdf5", []))
    assert recording.events.size == 0
    assert "no events" in recording.problems


def test_frames_are_what_is_simulated(tmp_path):
    path = write_ddd(
        tmp_path / "a.hdf5", [polarity(CORNERS), *(frame(9000 * n, image(n)) for n in (1, 2, 4))]
    )
    assert not takes_events(path)
    source = open_frames(path, rotate180=True)
    assert [f.t_ns for f in source.frames()] == [9_000_000, 18_000_000, 36_000_000]
    assert np.array_equal(next(source.frames()).image, np.rot90(image(1), 2))
    assert source.light.encoding == "linear"
    assert any("upside" in doubt for doubt in open_frames(path).doubts)


def test_rows_are_read_in_parts_of_bounded_size(tmp_path, monkeypatch):
    monkeypatch.setattr(hdf5, "PART", 50)
    packets = [polarity([(100 * n + k, k, n, 1) for k in range(20)]) for n in range(200)]
    file = open_events(write_ddd(tmp_path / "a.hdf5", packets))
    sizes = [part[0].size for part in file.parts()]
    assert sum(sizes) == 4000
    assert max(sizes) <= 70


@pytest.mark.parametrize(
    ("broken", "text"),
    [
        ((b"short", b""), "row 1: a head of 5 bytes, must be 28"),
        (packet(1, [b"\0" * 8], number=2), "2 of 1 items of 8 bytes"),
        (packet(1, [b"\0" * 6]), "items of 6 bytes"),
        (packet(1, [b"\0" * 8], wraps=-1), "-1 wraps"),
        (frame(9, image(0, 3, 4), wraps=1 << 21), "2097152 wraps"),
        (packet(2, [b"\0" * 8]), "items of 8 bytes"),
        ((polarity(CORNERS)[0], b"\0" * 8), "row 1: holds 8 bytes of items, its head states 5"),
    ],
)
def test_damaged_rows_are_named(tmp_path, broken, text):
    path = write_ddd(tmp_path / "a.hdf5", [polarity(CORNERS), broken, frame(9, image(0))])
    with pytest.raises(DataError, match=text):
        read_events(path)


def test_a_frame_larger_than_its_bytes_is_named(tmp_path):
    head, body = frame(9, image(0, 4, 5))
    body = body[:20] + np.array([50, 40], "<i4").tobytes() + body[28:]
    with pytest.raises(DataError, match="row 0: a frame of 50x40 pixels in 40 bytes"):
        read_events(write_ddd(tmp_path / "a.hdf5", [(head, body)]))
    with pytest.raises(DataError, match="a frame of 3 channels"):
        read_events(write_ddd(tmp_path / "b.hdf5", [frame(9, image(0, 4, 5), info=0b111)]))


@settings(max_examples=200, deadline=None)
@given(data=st.data())
@pytest.mark.thorough
def test_whatever_the_rows_hold_is_read_or_refused(data):
    packets = [polarity(CORNERS, room=1), special(1), frame(50, image(0, 3, 4)), imu()] * 2
    packets.append(polarity(CORNERS))
    damaged = [list(parts) for parts in packets]
    for _ in range(data.draw(st.integers(1, 3))):
        row, part = data.draw(st.integers(0, len(packets) - 1)), data.draw(st.integers(0, 1))
        content = bytearray(damaged[row][part])
        if content and data.draw(st.booleans()):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
        else:
            content = content[: data.draw(st.integers(0, len(content)))]
        damaged[row][part] = bytes(content)
    with tempfile.TemporaryDirectory() as folder:
        path = write_ddd(Path(folder, "a.hdf5"), damaged, rows=16, chunk=8)
        try:
            recording = read_events(path)
            list(recording.frames())
        except DataError as error:
            assert str(error).startswith(str(path))


def test_rows_of_other_things_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["dvs/data"] = np.zeros((4, 3))
        file["dvs/timestamp"] = np.zeros(4)
    with pytest.raises(DataError, match="dvs/data must be rows of three times bytes"):
        read_events(tmp_path / "a.hdf5")


def exported(path, t, frames_s):
    rng = np.random.default_rng(0)
    events = np.zeros((len(t), 4), np.uint32)
    events[:, 0], events[:, 1], events[:, 2] = t, np.arange(len(t)) % 346, np.arange(len(t)) % 260
    events[:, 3] = np.arange(len(t)) % 3 == 0
    with h5py.File(path, "w") as file:
        file["event"] = events
        file["frame"] = rng.integers(0, 256, (len(frames_s), 260, 346), np.uint8)
        file["frame_ts"] = np.array(frames_s, np.float32).reshape(-1, 1)
    return events


def test_exported_recordings(tmp_path):
    events = exported(tmp_path / "a.hdf5", np.arange(500) * 70, [0.0, 0.015625, 0.03125])
    recording = read_events(tmp_path / "a.hdf5")
    assert sorted(columns_of(recording)) == sorted(map(tuple, events.tolist()))
    assert recording.frame_times_ns.tolist() == [0, 15_625_000, 31_250_000]
    assert (recording.layout, recording.width, recording.height) == ("ddd20", 346, 260)
    with h5py.File(tmp_path / "a.hdf5") as file:
        for read, stored in zip(recording.frames(), file["frame"], strict=True):
            assert np.array_equal(read.image, stored)
    assert any("upside" in problem for problem in recording.problems)
    assert not any("single precision" in problem for problem in recording.problems)


def test_frame_times_of_exported_recordings_are_coarse(tmp_path):
    exported(tmp_path / "a.hdf5", 600_000_000 + np.arange(500), [600.0, 600.02])
    (told,) = [p for p in read_events(tmp_path / "a.hdf5").problems if "frame_ts" in p]
    assert "single precision: times of frames have steps of up to 61 us" in told
