"""Files as cameras write them: what is written, others read, and what is damaged, is refused."""

import tempfile
from functools import cache
from pathlib import Path

import event_readers
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError, OutputError
from adv2e.events import make_events, sort_events
from adv2e.formats import registry
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

READERS = {
    "aedat2": [],  # others know only sizes of chips: test_aedat2.py
    "es": [event_readers.faery, event_readers.event_stream],
    "dat": [
        event_readers.faery,
        event_readers.eventcv,
        event_readers.expelliarmus("dat"),
    ],
    "evt3": [event_readers.faery, event_readers.eventcv, event_readers.evlib],
    "evt2": [
        event_readers.faery,
        event_readers.eventcv,
        event_readers.evlib,
        event_readers.expelliarmus("evt2"),
    ],
}
FORMATS = {found.name: found for found in registry.FORMATS if found.name in READERS}
NAMES = sorted(READERS)
BY_OTHERS = [(name, reader) for name in NAMES for reader in READERS[name]]
METADATA = {"adv2e": "9", "config": {"pixel": {"leak": None}}, "note": "π\n% end\n"}


def write(path, name, events, size=(12, 7), cuts=()):
    with open_sink(
        path, width=size[0], height=size[1], metadata=METADATA, format=name, overwrite=True
    ) as sink:
        for part in np.split(events, cuts):
            sink.write_events(part)
    return path


def file_of(folder, name):
    return Path(folder) / f"a{FORMATS[name].suffixes[0]}"


def late(name):
    """Events in the corners, of unequal polarity, and late ones, as far as the format has times."""
    t = [0, 3, 3, 70_000, 2**24 + 5, 2**25 - 1, 2**31 - 2, 2**32 - 2, 2**32 + 9, 2**33]
    x, y = [0, 0, 11, 11, 5, 5, 6, 0, 3, 4], [0, 6, 0, 6, 3, 3, 3, 2, 1, 1]
    events = sort_events(make_events(t, x, y, [1, 0, 0, 1, 1, 0, 1, 1, 0, 1]))
    return events[events["t"] <= FORMATS[name].last_us]


def random(count, seed=0, most_step=40):
    draw = np.random.default_rng(seed)
    t = np.cumsum(draw.integers(0, most_step, count))
    x, y, p = (draw.integers(0, n, count) for n in (12, 7, 2))
    return sort_events(make_events(t, x, y, p))


def crowd():
    """Every pixel of the sensor in one microsecond."""
    y, x = np.divmod(np.arange(84), 12)
    return make_events(np.full(84, 4095), x, y, (x + y) % 2)


@pytest.mark.parametrize(("name", "reader"), BY_OTHERS)
@pytest.mark.parametrize("events", [late, lambda _: random(9000), lambda _: crowd()])
@pytest.mark.quick_cases(1)
def test_others_read_what_is_written(tmp_path, name, reader, events):
    path = write(file_of(tmp_path, name), name, events(name))

    size, found = reader(path)

    assert size in ((12, 7), None)
    assert np.array_equal(found, events(name))


@pytest.mark.parametrize(("name", "reader"), BY_OTHERS)
@pytest.mark.parametrize("count", [0, 1])
def test_others_read_few_events(tmp_path, name, reader, count):
    path = write(file_of(tmp_path, name), name, late(name)[1 : 1 + count])

    assert np.array_equal(reader(path)[1], late(name)[1 : 1 + count])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("events", [late, lambda _: random(300_000), lambda _: crowd()])
@pytest.mark.quick_cases(1)
def test_what_is_written_is_read(tmp_path, name, events):
    path = write(file_of(tmp_path, name), name, events(name))

    recording = read_events(path)

    assert np.array_equal(recording.events, events(name))
    assert (recording.width, recording.height) == (12, 7)
    assert recording.layout == name
    assert [p for p in recording.problems if "repeat" not in p] == []
    assert recording.metadata == {**METADATA, "width": 12, "height": 7}


@pytest.mark.parametrize("name", NAMES)
def test_no_events_keep_their_geometry(tmp_path, name):
    recording = read_events(write(file_of(tmp_path, name), name, random(0)))

    assert (recording.width, recording.height, recording.events.size) == (12, 7, 0)
    assert recording.problems == ["no events"]


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(0, 210), max_size=6), steps=st.sampled_from([2, 9000, 9_000_000]))
@pytest.mark.thorough
def test_bytes_do_not_depend_on_parts(name, cuts, steps):
    events = random(200, 1, steps)
    with tempfile.TemporaryDirectory() as folder:
        whole = write(file_of(folder, name), name, events).read_bytes()
        assert write(file_of(folder, name), name, events, cuts=sorted(cuts)).read_bytes() == whole
        found = read_events(file_of(folder, name))
    assert np.array_equal(found.events, events)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("t", ["before", "after"])
def test_times_that_do_not_fit_leave_nothing(tmp_path, name, t):
    time = -1 if t == "before" else FORMATS[name].last_us + 1
    events = make_events([time], [0], [0], [1])

    with pytest.raises(OutputError, match=f"an event at {time / 1e6:.6f} s does not fit"):
        write(file_of(tmp_path, name), name, events)

    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_sensors_that_do_not_fit_leave_nothing(tmp_path, name):
    width, height = FORMATS[name].most
    path = file_of(tmp_path, name)
    for size in ((width, 5), (5, height)):
        farthest = make_events([7], [size[0] - 1], [size[1] - 1], [1])
        assert np.array_equal(read_events(write(path, name, farthest, size)).events, farthest)
    path.unlink()

    for size in ((width + 1, height), (width, height + 1)):
        with pytest.raises(OutputError, match=f"holds {width}x{height} at most"):
            write(path, name, farthest, size)

    assert [left for left in tmp_path.iterdir() if left.suffix != ".json"] == []


@cache
def good_file(name):
    with tempfile.TemporaryDirectory() as folder:
        return write(file_of(folder, name), name, random(60, 2)).read_bytes()


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=200, deadline=None)
@given(data=st.data())
@pytest.mark.quick_cases(1)
def test_damaged_files_are_read_or_refused(name, data):
    with tempfile.TemporaryDirectory() as folder:
        path = file_of(folder, name)
        good = bytearray(good_file(name))
        for _ in range(data.draw(st.integers(0, 4))):
            good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
        begin, end = data.draw(st.tuples(st.sampled_from([0, 0, 5]), st.integers(0, len(good))))
        path.write_bytes(good[begin:end] + data.draw(st.binary(max_size=9)))
        try:
            recording = read_events(path)
        except DataError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert recording.events.size <= 12 * len(good)
