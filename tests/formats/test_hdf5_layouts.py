"""What all layouts of HDF5 that are written have in common."""

import h5py
import numpy as np
import pytest

from adv2e.errors import DataError, OutputError
from adv2e.events import make_events, sort_events
from adv2e.formats.hdf5_writer import CHUNK
from adv2e.formats.reading import read_events
from adv2e.formats.registry import FORMATS, layouts
from adv2e.formats.writing import open_sink

EPOCH_US = 1_468_941_032_229_165
WITH_FRAMES = [found.name for found in FORMATS if found.is_hdf5 and found.frames == "rw"]
LATEST = {found.name: found.last_us for found in FORMATS}
METADATA = {"adv2e": "9", "seed": 3}

every = pytest.mark.parametrize("layout", layouts())
with_frames = pytest.mark.parametrize("layout", WITH_FRAMES)


def write(path, layout, steps, width=346, height=260):
    """Write events and frames (pairs) in the order given."""
    with open_sink(
        path, width=width, height=height, metadata=METADATA, layout=layout, with_frames=True
    ) as sink:
        for step in steps:
            if isinstance(step, tuple):
                sink.write_frame(*step)
            else:
                sink.write_events(step)
    return path


def many(count, begin=0):
    rng = np.random.default_rng(count)
    t = begin + np.cumsum(rng.integers(0, 4, count))
    x, y = rng.integers(0, 346, count), rng.integers(0, 260, count)
    return sort_events(make_events(t, x, y, rng.integers(0, 2, count)))


def grey(seed):
    return np.random.default_rng(seed).integers(0, 256, (260, 346), np.uint8)


def test_all_layouts_are_here():
    assert layouts() == ["monash", "dsec", "v2e", "mvsec", "m3ed"]
    assert WITH_FRAMES == ["monash", "v2e", "mvsec"]


def test_a_layout_is_known_by_the_datasets_that_are_read():
    here = [found for found in FORMATS if found.reader.startswith("hdf5_layouts:")]
    assert len(here) == len(layouts()) + 1
    for found in here:
        layout = found.load(found.reader).__self__
        assert (layout.name, layout.datasets) == (found.name, list(found.datasets))


@every
@pytest.mark.parametrize("begin", [0, 1 << 24, (1 << 32) + 1, EPOCH_US])
def test_corners_come_back_or_are_refused(tmp_path, layout, begin):
    t = begin + np.array([0, 0, 7, 7, 7])
    events = make_events(t, [0, 345, 0, 345, 345], [0, 0, 259, 259, 259], [1, 0, 0, 1, 1])
    path = tmp_path / "a.h5"
    if t[-1] > LATEST[layout]:
        with pytest.raises(OutputError, match=r"a\.h5: an event at .* does not fit"):
            write(path, layout, [events])
        assert list(tmp_path.iterdir()) == []
        return
    recording = read_events(write(path, layout, [events]))
    assert recording.layout == layout
    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height) == (346, 260)
    assert recording.metadata == {**METADATA, "width": 346, "height": 260}
    assert recording.problems == ["1 events repeat another one exactly: kept"]


@every
@pytest.mark.parametrize("count", [0, 1, CHUNK, 2 * CHUNK + 9])
def test_any_number_of_events_comes_back(tmp_path, layout, count):
    events = many(count)
    recording = read_events(write(tmp_path / "a.h5", layout, np.array_split(events, 5)))
    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height) == (346, 260)


@every
def test_many_events_at_one_time_come_back(tmp_path, layout):
    place = np.arange(346 * 260)
    events = sort_events(make_events(place * 0 + 5, place % 346, place // 346, place % 2))
    recording = read_events(write(tmp_path / "a.h5", layout, [events]))
    assert np.array_equal(recording.events, events)


@every
def test_bytes_do_not_depend_on_how_events_and_frames_come(tmp_path, layout):
    events = many(2 * CHUNK + 9)
    frames = [(int(t) * 1000, grey(n)) for n, t in enumerate(events["t"][:: CHUNK // 3])]
    pieces = np.array_split(events, 3)
    orders = [
        [*frames, events],
        [*frames[:2], *pieces[:1], *frames[2:], *pieces[1:]],
        [*np.array_split(events, 17), *frames],
    ]
    one, *others = (
        write(tmp_path / f"{n}.h5", layout, order).read_bytes() for n, order in enumerate(orders)
    )
    assert others == [one, one]


@every
def test_files_hold_no_time_of_the_day_and_need_no_plug_in(tmp_path, layout):
    path = write(tmp_path / "a.h5", layout, [(0, grey(0)), many(100)])
    with h5py.File(path) as file:
        assert file.attrs["layout"] == layout
        found = []
        file.visititems(lambda name, item: found.append(item))
        for item in found:
            if isinstance(item, h5py.Dataset) and item.chunks:
                assert item.compression == "gzip"
            assert h5py.h5o.get_info(item.id).mtime == 0


@with_frames
def test_frames_come_back(tmp_path, layout):
    frames = [(n * 38_766_000, grey(n)) for n in range(4)]
    events = make_events(np.arange(300) * 500, np.arange(300), np.arange(300) % 260, [0, 1] * 150)
    recording = read_events(write(tmp_path / "a.h5", layout, [*frames, events]))
    assert recording.frame_times_ns.tolist() == [t_ns for t_ns, _ in frames]
    for read, (_, image) in zip(recording.frames(), frames, strict=True):
        assert np.array_equal(read.image, image)


@with_frames
def test_what_is_of_the_width_of_no_byte_is_stored_in_eight_bits(tmp_path, layout):
    deep = np.full((260, 346), 257 * 9, np.uint16)
    (frame,) = read_events(write(tmp_path / "a.h5", layout, [(0, deep), many(9)])).frames()
    assert frame.image.dtype == np.uint8
    assert (frame.image == 9).all()


@pytest.mark.parametrize("layout", ["v2e", "mvsec"])
def test_of_colour_the_luma_is_stored(tmp_path, layout):
    colour = np.zeros((260, 346, 3), np.uint8)
    colour[0, :4] = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]
    (frame,) = read_events(write(tmp_path / "a.h5", layout, [(0, colour), many(9)])).frames()
    assert frame.image[0, :5].tolist() == [76, 150, 29, 255, 0]


@pytest.mark.parametrize("layout", ["v2e", "mvsec"])
def test_frames_of_several_sizes_are_refused(tmp_path, layout):
    steps = [(0, grey(0)), (5_000, grey(0)[:-1]), many(9)]
    with pytest.raises(OutputError, match=r"a\.h5: frames of several sizes"):
        write(tmp_path / "a.h5", layout, steps)
    assert list(tmp_path.iterdir()) == []


def test_v2e_as_its_readers_have_it(tmp_path):
    events = make_events([10, 20, 20, 4_000_000_000], [0, 345, 3, 4], [259, 0, 3, 4], [1, 0, 0, 1])
    frames = [(0, grey(0)), (20_000, grey(1)), (20_600, grey(2)), (4_294_967_295_000, grey(3))]
    with h5py.File(write(tmp_path / "a.h5", "v2e", [*frames, events])) as file:
        assert file["events"].dtype == np.uint32
        assert file["events"][:].tolist() == [
            [10, 0, 259, 1],
            [20, 345, 0, 0],
            [20, 3, 3, 0],
            [4_000_000_000, 4, 4, 1],
        ]
        assert (file["frame"].shape, file["frame"].dtype) == ((4, 260, 346), np.uint8)
        assert file["frame_ts"].dtype == np.uint32
        assert file["frame_ts"][:].tolist() == [0, 20, 21, 4_294_967_295]
        assert file["frame_idx"].dtype == np.uint64
        assert file["frame_idx"][:].tolist() == [0, 1, 3, 4]


@pytest.mark.parametrize("t_ns", [-1000, (1 << 32) * 1000])
def test_v2e_refuses_frames_whose_times_it_cannot_hold(tmp_path, t_ns):
    with pytest.raises(OutputError, match=r"a\.h5: a frame at .* does not fit HDF5 of v2e"):
        write(tmp_path / "a.h5", "v2e", [(t_ns, grey(0)), many(9)])
    assert list(tmp_path.iterdir()) == []


def of_v2e(path, t, p):
    """Write a file as v2e does, in part: its events."""
    rows = np.stack([t, np.arange(len(t)) % 346, np.arange(len(t)) % 260, p], axis=1)
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "events", data=rows.astype(np.uint32), maxshape=(None, 4), compression="gzip"
        )


def test_single_precision_of_v2e_is_told(tmp_path):
    exact = 15_000_000 + np.arange(4000) * 1001
    single = (np.float32(1e6) * (exact / 1e6).astype(np.float32)).astype(np.int64)
    of_v2e(tmp_path / "a.h5", np.sort(single), np.ones(4000))
    of_v2e(tmp_path / "b.h5", exact, np.ones(4000))
    (told,) = [p for p in read_events(tmp_path / "a.h5").problems if "precision" in p]
    assert told.endswith("from 16.8 s on they have steps of 2 us and more, at the end of 2 us")
    assert not any("precision" in p for p in read_events(tmp_path / "b.h5").problems)


def test_minus_one_without_a_sign_is_off(tmp_path):
    of_v2e(tmp_path / "a.h5", np.arange(4), np.array([1, 4_294_967_295, 1, 4_294_967_295]))
    recording = read_events(tmp_path / "a.h5")
    assert recording.events["p"].tolist() == [1, 0, 1, 0]
    assert not any("polarit" in problem for problem in recording.problems)


def test_mvsec_as_its_readers_have_it(tmp_path):
    t = EPOCH_US + np.array([10, 20, 20, 30])
    events = make_events(t, [0, 345, 3, 4], [259, 0, 3, 4], [1, 0, 0, 1])
    frames = [(int(EPOCH_US + after) * 1000, grey(after)) for after in (0, 20, 25, 40)]
    with h5py.File(write(tmp_path / "a.h5", "mvsec", [*frames, events])) as file:
        camera = file["davis/left"]
        assert camera["events"].dtype == np.float64
        assert camera["events"][:, :2].tolist() == [[0, 259], [345, 0], [3, 3], [4, 4]]
        assert camera["events"][:, 3].tolist() == [1, -1, -1, 1]
        assert np.array_equal(camera["events"][:, 2], t / 1e6)
        assert (camera["image_raw"].shape, camera["image_raw"].dtype) == ((4, 260, 346), np.uint8)
        assert np.array_equal(camera["image_raw_ts"], [t_ns / 1e9 for t_ns, _ in frames])
        assert camera["image_raw_event_inds"].dtype == np.int64
        assert camera["image_raw_event_inds"][:].tolist() == [0, 0, 2, 3]


@pytest.mark.parametrize("layout", ["mvsec", "m3ed"])
def test_of_two_cameras_the_user_chooses(tmp_path, layout):
    events = many(9)
    names = "davis" if layout == "mvsec" else "prophesee"
    frames = [(7000, grey(1))] if layout == "mvsec" else []
    write(tmp_path / "a.h5", layout, [*frames, events])
    write(tmp_path / "b.h5", layout, [*frames, events[:3]])
    with h5py.File(tmp_path / "a.h5", "a") as left, h5py.File(tmp_path / "b.h5") as right:
        del left.attrs["adv2e"]
        right.copy(f"{names}/left", left[names], "right")

    unasked = read_events(tmp_path / "a.h5")
    assert len(unasked.events) == len(events)
    assert "is taken, --track chooses another" in unasked.problems[0]
    for track in ("1", "right", f"{names}/right"):
        chosen = read_events(tmp_path / "a.h5", track=track)
        assert np.array_equal(chosen.events, events[:3])
        assert not any("taken" in problem for problem in chosen.problems)
        assert (chosen.frame_times_ns is None) == (layout == "m3ed")
    with pytest.raises(
        DataError, match=rf"--track 2: it holds no such track, but 0 = {names}/left"
    ):
        read_events(tmp_path / "a.h5", track=2)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file[f"{names}/left"]
    alone = read_events(tmp_path / "a.h5")
    assert len(alone.events) == 3
    assert not any("taken" in problem for problem in alone.problems)


def test_m3ed_as_its_readers_have_it(tmp_path):
    events = make_events([0, 999, 1000, 3000], [0, 345, 3, 4], [259, 0, 3, 4], [1, 0, 0, 1])
    with h5py.File(write(tmp_path / "a.h5", "m3ed", [events])) as file:
        camera = file["prophesee/left"]
        kinds = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.int8}
        for name, kind in kinds.items():
            assert camera[name].dtype == kind
            assert np.array_equal(camera[name], events[name])
        assert camera["ms_map_idx"][:].tolist() == [0, 2, 3, 3, 4]
        assert camera["calib/resolution"][:].tolist() == [346, 260]
        # the part from 1000 ms to 1001 ms, as the examples published with the data have it
        begin, end = camera["ms_map_idx"][1], camera["ms_map_idx"][2]
        assert camera["t"][begin:end].tolist() == [1000]


def test_m3ed_of_other_makers_states_its_size(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, kind in {"t": "i8", "x": "u2", "y": "u2", "p": "i1"}.items():
            file.create_dataset(f"prophesee/left/{name}", data=np.arange(3, dtype=kind) % 2,
                                compression="lzf", chunks=True)  # fmt: skip
        file["prophesee/left/calib/resolution"] = np.array([1280, 720])
    recording = read_events(tmp_path / "a.h5")
    assert (recording.width, recording.height) == (1280, 720)
