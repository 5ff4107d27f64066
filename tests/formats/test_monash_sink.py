import json

import h5py
import numpy as np
import pytest

from adv2e.errors import OutputError
from adv2e.events import empty_events, make_events
from adv2e.formats.hdf5_writer import CHUNK
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

METADATA = {"adv2e": "9", "config": {"pixel": {"low_pass": {"cutoff_hz": 300.0}}}, "seed": 3}


def write(path, steps, width=346, height=260, **options):
    """Write events (arrays) and frames (pairs) in the order given; return the open file."""
    with open_sink(path, width=width, height=height, metadata=METADATA, **options) as sink:
        for step in steps:
            if isinstance(step, tuple):
                sink.write_frame(*step)
            else:
                sink.write_events(step)
    return h5py.File(path, "r")


def many(count, begin=0):
    rng = np.random.default_rng(count)
    t = begin + np.cumsum(rng.integers(0, 4, count))
    x, y = rng.integers(0, 346, count), rng.integers(0, 260, count)
    return make_events(t, x, y, rng.integers(0, 2, count))


def grey(value=0):
    image = np.full((260, 346), value, np.uint8)
    image[3, 5] = 200
    return image


def test_columns_and_types(tmp_path):
    events = make_events([-2_000_000, 5], [0, 345], [259, 0], [1, 0])
    with write(tmp_path / "a.h5", [events]) as file:
        group = file["events"]
        assert {name: group[name].dtype for name in group} == {
            "xs": np.int16,
            "ys": np.int16,
            "ts": np.float64,
            "ps": np.int8,
        }
        assert group["ts"][:].tolist() == [-2.0, 5e-06]
        assert group["xs"][:].tolist() == [0, 345]
        assert group["ys"][:].tolist() == [259, 0]
        assert group["ps"][:].tolist() == [1, 0]


def test_loaders_get_minus_one_and_one(tmp_path):
    with write(tmp_path / "a.h5", [make_events([1, 5], [0, 345], [259, 0], [1, 0])]) as file:
        ps = file["events/ps"]
        assert (ps[:] * 2 - 1).tolist() == [1, -1]
        assert (ps[:] * 2.0 - 1.0).tolist() == [1, -1]
        assert np.where(ps[:], 1, -1).tolist() == [1, -1]
        assert ps.id.get_type().get_class() == h5py.h5t.INTEGER


def test_polarities_of_files_of_before_are_read(tmp_path):
    events = many(10)
    write(tmp_path / "a.h5", [events]).close()
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        on = file["events/ps"][:] == 1
        del file["events/ps"]
        file["events/ps"] = on
    assert np.array_equal(read_events(tmp_path / "a.h5").events, events)


def test_columns_are_chunked_resizable_and_compressed_with_standard_filters(tmp_path):
    with write(tmp_path / "a.h5", [many(10)]) as file:
        for column in file["events"].values():
            assert column.chunks == (65536,)
            assert column.maxshape == (None,)
            assert (column.compression, column.compression_opts) == ("gzip", 1)
            assert column.shuffle


@pytest.mark.parametrize("count", [CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK + 17])
@pytest.mark.parametrize("slower", [1, 1000], ids=["busy", "sparse"])
def test_chunks_hold_every_event(tmp_path, count, slower):
    events = many(count)
    events["t"] *= slower
    with write(tmp_path / "a.h5", np.array_split(events, 7)) as file:
        group = file["events"]
        assert np.array_equal(group["xs"][:], events["x"])
        assert np.array_equal(group["ys"][:], events["y"])
        assert np.array_equal(group["ts"][:], events["t"] / 1e6)
        assert np.array_equal(group["ps"][:], events["p"])


def test_last_chunk_can_be_extended_by_other_programs(tmp_path):
    write(tmp_path / "a.h5", [many(10)]).close()
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["events/xs"].resize((20,))
        assert file["events/xs"][10:].tolist() == [0] * 10


def test_wide_sensors_need_unsigned_columns(tmp_path):
    events = make_events([1], [39_999], [0], [1])
    with write(tmp_path / "a.h5", [events], width=40_000) as file:
        assert file["events/xs"].dtype == np.uint16
        assert file["events/xs"][0] == 39_999


def test_attributes_of_the_file(tmp_path):
    events = make_events([1_000_000, 2_000_000, 4_500_000], [1, 2, 3], [1, 2, 3], [1, 0, 1])
    with write(tmp_path / "a.h5", [events, (5_000_000_000, grey())], with_frames=True) as file:
        attributes = dict(file.attrs)
        description = json.loads(attributes.pop("adv2e"))
        assert attributes.pop("sensor_resolution").tolist() == [260, 346]
        assert attributes == {
            "num_events": 3,
            "num_pos": 2,
            "num_neg": 1,
            "duration": 3.5,
            "t0": 1.0,
            "tk": 4.5,
            "num_imgs": 1,
            "num_flow": 0,
            "source": "unknown",
            "layout": "monash",
            "layout_version": "2",
        }
        assert description == {**METADATA, "width": 346, "height": 260}


@pytest.mark.parametrize("events", [[], [empty_events()]])
def test_no_events_and_no_frames(tmp_path, events):
    with write(tmp_path / "a.h5", events, with_frames=True) as file:
        assert [file["events"][name].shape for name in ("xs", "ys", "ts", "ps")] == [(0,)] * 4
        assert list(file["images"]) == []
        assert file["images"].attrs["num_images"] == 0
        assert file.attrs["num_imgs"] == 0
        assert file.attrs["num_events"] == 0
        assert file.attrs["duration"] == 0.0


def test_grey_images(tmp_path):
    frames = [(0, grey(1)), (40_000_000, grey(2))]
    with write(tmp_path / "a.h5", [*frames, many(10)], with_frames=True) as file:
        assert list(file["images"]) == ["image000000000", "image000000001"]
        assert file["images"].attrs["num_images"] == 2
        image = file["images/image000000001"]
        assert image.dtype == np.uint8
        assert np.array_equal(image[()], grey(2))
        assert image.attrs["size"].tolist() == [260, 346]
        assert image.attrs["timestamp"] == 0.04
        assert image.attrs["timestamp_ns"] == 40_000_000
        assert image.attrs["type"] == "greyscale"


def test_colour_images_are_blue_green_red(tmp_path):
    rgb = np.zeros((260, 346, 3), np.uint8)
    rgb[1, 2] = (10, 20, 30)
    with write(tmp_path / "a.h5", [(0, rgb)], with_frames=True) as file:
        image = file["images/image000000000"]
        assert image.shape == (260, 346, 3)
        assert image[1, 2].tolist() == [30, 20, 10]
        assert image.attrs["type"] == "color_bgr"
        assert image.attrs["size"].tolist() == [260, 346, 3]


def test_sixteen_bit_images_are_rounded_to_eight(tmp_path):
    deep = np.zeros((260, 346), np.uint16)
    deep[0, :5] = (65535, 257, 128, 129, 65406)
    with write(tmp_path / "a.h5", [(0, deep)], with_frames=True) as file:
        image = file["images/image000000000"]
        assert image.dtype == np.uint8
        assert image[0, :5].tolist() == [255, 1, 0, 1, 254]


def test_event_index_is_that_of_the_last_event_before_the_frame(tmp_path):
    times_us = [0, 10, 20, 25, 30, 1000]
    frames = [(t * 1000, grey()) for t in times_us]
    parts = [
        make_events(t, np.zeros(len(t)), np.zeros(len(t)), np.ones(len(t)))
        for t in ([10, 10], [20], [20, 21], [25, 26, 30, 31])
    ]
    orders = {
        "frames_first": [*frames, *parts],
        "events_first": [*parts, *frames],
        "late": [parts[0], *frames[:2], *parts[1:3], *frames[2:5], parts[3], frames[5]],
        "as_they_come": [*frames[:2], parts[0], *frames[2:4], *parts[1:3], *frames[4:], parts[3]],
    }
    for name, steps in orders.items():
        with write(tmp_path / f"{name}.h5", steps, with_frames=True) as file:
            ts = file["events/ts"][:]
            found = [image.attrs["event_idx"] for image in file["images"].values()]
            stamps = [image.attrs["timestamp"] for image in file["images"].values()]
            assert found == [max(np.searchsorted(ts, stamp) - 1, 0) for stamp in stamps]
            assert found == [0, 0, 1, 4, 6, 8]


def test_event_index_holds_over_many_chunks(tmp_path):
    events = many(3 * CHUNK + 5)
    stamps_us = np.unique([0, *events["t"][[0, CHUNK - 1, CHUNK, 2 * CHUNK, -1]], 10**9])
    frames = [(int(t) * 1000, grey()) for t in stamps_us]
    with write(tmp_path / "a.h5", [*frames, events], with_frames=True) as file:
        found = [image.attrs["event_idx"] for image in file["images"].values()]
    expected = np.searchsorted(events["t"], stamps_us) - 1
    assert found == np.maximum(expected, 0).tolist()


def test_metadata_may_be_long(tmp_path):
    long = {"config": "x" * 200_000}
    with open_sink(tmp_path / "a.h5", width=2, height=2, metadata=long):
        pass
    with h5py.File(tmp_path / "a.h5") as file:
        assert json.loads(file.attrs["adv2e"])["config"] == long["config"]


def test_existing_file_is_named(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"")
    with pytest.raises(OutputError, match=r"a\.h5: exists already"):
        open_sink(tmp_path / "a.h5", width=2, height=2, metadata={})
