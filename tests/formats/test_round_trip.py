"""What a sink writes, a reader returns."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.events import make_events, sort_events
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

EPOCH_US = 1_468_941_032_229_165
NAMES = ["out.txt", "out", "out.zip", "out.h5", "out.npz", "out.csv"]
METADATA = {"adv2e": "9", "config": {"pixel": {"leak": None}}, "seed": 3}


def write(path, events, width, height, frames=()):
    with open_sink(
        path, width=width, height=height, metadata=METADATA, with_frames=True, threads=1
    ) as sink:
        for t_ns, image in frames:
            sink.write_frame(t_ns, image)
        sink.write_events(events)


@st.composite
def streams(draw):
    width, height = draw(st.tuples(st.integers(1, 1300), st.integers(1, 800)))
    begin = draw(st.sampled_from([0, -7_000_000, 999_999, EPOCH_US]))
    steps = draw(st.lists(st.integers(0, 2_000_000), max_size=40))
    count = len(steps) + 4
    t = begin + np.cumsum([0, 0, 0, 0, *steps])
    x = draw(st.lists(st.integers(0, width - 1), min_size=count, max_size=count))
    y = draw(st.lists(st.integers(0, height - 1), min_size=count, max_size=count))
    p = draw(st.lists(st.integers(0, 1), min_size=count, max_size=count))
    x[:4], y[:4], p[:4] = [0, width - 1] * 2, [0, 0, height - 1, height - 1], [1, 0, 0, 1]
    return width, height, sort_events(make_events(t, x, y, p))


@settings(max_examples=15, deadline=None)
@given(streams())
@pytest.mark.thorough
def test_events_and_geometry_survive(stream):
    width, height, events = stream
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            path = Path(folder) / name
            write(path, events, width, height)
            recording = read_events(path)

            assert np.array_equal(recording.events, events)
            assert recording.events.dtype == events.dtype
            assert (recording.width, recording.height) == (width, height)


@pytest.mark.parametrize("name", NAMES)
def test_corners_at_epoch_times_with_nothing_to_complain_of(tmp_path, name):
    t = EPOCH_US + np.arange(4) * 7
    events = make_events(t, [0, 345, 0, 345], [0, 0, 259, 259], [1, 0, 0, 1])
    write(tmp_path / name, events, 346, 260)

    recording = read_events(tmp_path / name)

    assert np.array_equal(recording.events, events)
    assert recording.problems == []
    assert recording.frame_times_ns is None
    assert list(recording.frames()) == []


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.quick_cases(1)
def test_many_blocks_and_chunks(tmp_path, name):
    rng = np.random.default_rng(0)
    count = 300_000
    t = np.cumsum(rng.integers(0, 30, count))
    x, y = rng.integers(0, 346, count), rng.integers(0, 260, count)
    events = sort_events(make_events(t, x, y, rng.integers(0, 2, count)))
    write(tmp_path / name, events, 346, 260)

    assert np.array_equal(read_events(tmp_path / name).events, events)


@pytest.mark.parametrize("name", NAMES)
def test_metadata_survive(tmp_path, name):
    write(tmp_path / name, make_events([1], [0], [0], [1]), 4, 3)

    assert read_events(tmp_path / name).metadata == {**METADATA, "width": 4, "height": 3}


@pytest.mark.parametrize("name", NAMES)
def test_no_events_keep_their_geometry(tmp_path, name):
    write(tmp_path / name, make_events([], [], [], []), 4, 3)

    recording = read_events(tmp_path / name)

    assert (recording.width, recording.height, recording.events.size) == (4, 3, 0)
    assert recording.problems == ["no events"]


@pytest.mark.parametrize("name", ["out", "out.zip", "out.h5"])
@pytest.mark.parametrize("colour", [False, True])
def test_frames_survive(tmp_path, name, colour):
    rng = np.random.default_rng(1)
    shape = (3, 4, 3) if colour else (3, 4)
    frames = [
        (EPOCH_US * 1000 + k * 38_766_001, rng.integers(0, 256, shape, dtype=np.uint8))
        for k in range(3)
    ]
    write(tmp_path / name, make_events([1], [0], [0], [1]), 4, 3, frames)

    recording = read_events(tmp_path / name)

    assert recording.frame_times_ns.tolist() == [t_ns for t_ns, _ in frames]
    for _ in range(2):  # as often as asked
        read = list(recording.frames())
        assert [frame.t_ns for frame in read] == [t_ns for t_ns, _ in frames]
        assert all(np.array_equal(a.image, b) for a, (_, b) in zip(read, frames, strict=True))


@pytest.mark.parametrize("name", ["out", "out.zip"])
def test_sixteen_bit_frames_survive_as_png(tmp_path, name):
    image = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    write(tmp_path / name, make_events([1], [0], [0], [1]), 4, 3, [(0, image)])

    (frame,) = read_events(tmp_path / name).frames()

    assert frame.image.dtype == np.uint16
    assert np.array_equal(frame.image, image)
