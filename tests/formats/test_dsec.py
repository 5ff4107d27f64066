"""The layout ``dsec``, sliced as loaders of the data set do it, and read by other libraries."""

import math
import sys

import h5py
import numpy as np
import pytest

from adv2e import __version__
from adv2e.errors import DataError, OutputError
from adv2e.events import make_events, sort_events
from adv2e.formats.hdf5_writer import CHUNK
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

EPOCH_US = 1_468_941_032_229_165


def write(path, events, pieces=1, width=346, height=260):
    with open_sink(path, width=width, height=height, metadata={"seed": 3}, layout="dsec") as sink:
        for part in np.array_split(events, pieces):
            sink.write_events(part)
    return path


def many(count, begin=0, step=40):
    rng = np.random.default_rng(count)
    t = begin + np.cumsum(rng.integers(0, step, count))
    x, y = rng.integers(0, 346, count), rng.integers(0, 260, count)
    return sort_events(make_events(t, x, y, rng.integers(0, 2, count)))


class Slicer:
    """Finds times as DSEC does: looks milliseconds around a part up, and cuts what is between."""

    def __init__(self, file):
        self.times = file["events/t"][:].astype(np.int64)
        self.index, self.offset = file["ms_to_idx"][:].astype(np.int64), int(file["t_offset"][()])

    def __call__(self, begin_us, end_us):
        """Return times from `begin_us` to before `end_us`; None: the index does not tell."""
        begin, end = begin_us - self.offset, end_us - self.offset
        first, last = begin // 1000, math.ceil(end / 1000)
        if not (0 <= first < self.index.size and 0 <= last < self.index.size):
            return None
        t = self.times[self.index[first] : self.index[last]]
        return t[(t >= begin) & (t < end)] + self.offset


def test_types(tmp_path):
    with h5py.File(write(tmp_path / "a.h5", many(10))) as file:
        assert {name: file["events"][name].dtype for name in "xytp"} == {
            "x": np.uint16,
            "y": np.uint16,
            "t": np.uint32,
            "p": np.uint8,
        }
        assert file["ms_to_idx"].dtype == np.uint64
        assert (file["t_offset"].dtype, file["t_offset"].shape) == (np.int64, ())
        assert (file["events/width"][()].item(), file["events/height"][()].item()) == (346, 260)
        assert file["events/t"].compression == "gzip"


@pytest.mark.parametrize("begin", [0, 700_000, -5_000, EPOCH_US, 2**32 + 100_000])
@pytest.mark.parametrize("count", [1, 1000, CHUNK, 2 * CHUNK + 5])
def test_every_part_is_found_to_the_last_event(tmp_path, begin, count):
    events = many(count, begin)
    with h5py.File(write(tmp_path / "a.h5", events, pieces=3)) as file:
        sliced = Slicer(file)
        first, last = int(events["t"][0]), int(events["t"][-1])
        assert np.array_equal(sliced(first, last + 1), events["t"])
        rng = np.random.default_rng(1)
        for a, b in np.sort(rng.integers(first, last + 1, (50, 2))):
            wanted = events["t"][(events["t"] >= a) & (events["t"] < b + 1)]
            assert np.array_equal(sliced(int(a), int(b) + 1), wanted)
        t, index = file["events/t"][:], file["ms_to_idx"][:]
        assert np.array_equal(index, np.searchsorted(t, np.arange(index.size) * 1000))
        assert index.size == int(t[-1]) // 1000 + 2


def test_a_last_event_at_a_whole_millisecond_is_found(tmp_path):
    events = make_events([500, 9000, 9000], [1, 2, 3], [1, 2, 3], [1, 0, 1])
    with h5py.File(write(tmp_path / "a.h5", events)) as file:
        assert Slicer(file)(0, 9001).tolist() == [500, 9000, 9000]
        assert file["ms_to_idx"][:].tolist() == [0, *[1] * 9, 3]


@pytest.mark.parametrize("begin", [0, 4_000_000_000, -3, EPOCH_US])
@pytest.mark.quick_cases(1)
def test_times_beyond_32_bits(tmp_path, begin):
    t = begin + np.array([0, 5, 2**32 - 1, 2**32, 2**32 + 1, 3 * 2**32 + 7, 3 * 2**32 + 8])
    events = make_events(t, np.arange(7), np.arange(7), [1, 0] * 3 + [1])
    path = write(tmp_path / "a.h5", events)
    with h5py.File(path) as file:
        assert file["events/t"].dtype == np.int64
        assert np.array_equal(file["events/t"][:] + file["t_offset"][()], t)
        assert Slicer(file)(begin + 2**32, begin + 3 * 2**32 + 8).tolist() == t[3:6].tolist()
    assert np.array_equal(read_events(path).events, events)


@pytest.mark.parametrize("begin", [0, -7_000_000, EPOCH_US])
def test_what_is_written_is_read(tmp_path, begin):
    events = many(3 * CHUNK + 17, begin)
    recording = read_events(write(tmp_path / "a.h5", events, pieces=11))
    assert recording.layout == "dsec"
    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height) == (346, 260)
    about = {"adv2e": __version__, "seed": 3, "width": 346, "height": 260}
    assert recording.metadata == about
    assert [p for p in recording.problems if "below zero" not in p and "repeat" not in p] == []


def test_bytes_do_not_depend_on_how_events_come(tmp_path):
    events = many(2 * CHUNK + 9)
    one, other = (write(tmp_path / f"{n}.h5", events, pieces=n) for n in (1, 13))
    assert one.read_bytes() == other.read_bytes()


def test_no_events(tmp_path):
    path = write(tmp_path / "a.h5", many(0))
    with h5py.File(path) as file:
        assert file["events/t"].shape == (0,)
        assert file["ms_to_idx"][:].tolist() == [0]
    assert read_events(path).problems == ["no events"]


def test_events_weeks_apart_have_no_index(tmp_path):
    events = make_events([0, 13 * 86_400_000_000], [0, 0], [0, 0], [1, 0])
    with pytest.raises(OutputError, match=r"a\.h5: an event 13\.0 days after.*layout dsec"):
        write(tmp_path / "a.h5", events)
    assert list(tmp_path.iterdir()) == []


def original(path, **filters):
    """Write what a file of the data set holds; return its times."""
    t = np.array([3, 500, 2100, 2100], np.uint32)
    with h5py.File(path, "w") as file:
        file["t_offset"] = np.int64(49_000_000_000)
        file["ms_to_idx"] = np.array([0, 2, 2, 4], np.uint64)
        file.create_dataset("events/t", data=t, **filters)
        for name, values in {"x": [0, 639, 5, 6], "y": [479, 0, 5, 6], "p": [1, 0, 1, 1]}.items():
            kind = np.uint8 if name == "p" else np.uint16
            file.create_dataset(f"events/{name}", data=np.array(values, kind), **filters)
    return t.astype(np.int64) + 49_000_000_000


def test_files_of_the_data_set_state_no_size(tmp_path):
    times = original(tmp_path / "events.h5")
    recording = read_events(tmp_path / "events.h5")
    assert recording.events["t"].tolist() == times.tolist()
    assert recording.events["x"].tolist() == [0, 639, 5, 6]
    assert recording.events["p"].tolist() == [1, 0, 1, 1]
    assert recording.problems == ["no geometry stated: 640x480 from the largest coordinates"]


def test_blosc_is_read(tmp_path):
    hdf5plugin = pytest.importorskip("hdf5plugin")
    times = original(tmp_path / "events.h5", **hdf5plugin.Blosc(cname="zstd"))
    assert read_events(tmp_path / "events.h5").events["t"].tolist() == times.tolist()


def test_without_the_package_blosc_is_an_error_that_names_it(tmp_path, monkeypatch):
    hdf5plugin = pytest.importorskip("hdf5plugin")
    original(tmp_path / "events.h5", **hdf5plugin.Blosc())
    monkeypatch.setattr(h5py.h5z, "filter_avail", lambda code: False)
    monkeypatch.setitem(sys.modules, "hdf5plugin", None)
    with pytest.raises(DataError, match=r"events/t: .*Blosc \(filter 32001\).*'adv2e\[blosc\]'"):
        read_events(tmp_path / "events.h5")


def test_what_is_no_offset_is_an_error(tmp_path):
    original(tmp_path / "events.h5")
    with h5py.File(tmp_path / "events.h5", "r+") as file:
        del file["t_offset"]
        file["t_offset"] = np.array([1.5])
    with pytest.raises(DataError, match="t_offset must hold one whole number"):
        read_events(tmp_path / "events.h5")


def test_evlib_reads_it(tmp_path):
    evlib = pytest.importorskip("evlib")
    events = many(5000)
    table = evlib.load_events(str(write(tmp_path / "a.h5", events))).collect()
    assert table["t"].dt.total_microseconds().to_list() == events["t"].tolist()
    assert table["x"].to_list() == events["x"].tolist()
    assert table["y"].to_list() == events["y"].tolist()
    assert (table["polarity"] > 0).to_list() == (events["p"] == 1).tolist()


def test_eventcv_reads_it(tmp_path):
    eventcv = pytest.importorskip("eventcv")
    events = many(5000)
    path = write(tmp_path / "a.h5", events)
    table = eventcv.load(str(path), time_unit="microseconds").numpy()
    for column, name in enumerate("xyt"):
        assert table[:, column].tolist() == events[name].tolist()
    assert (table[:, 3] > 0).tolist() == (events["p"] == 1).tolist()
