import itertools
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from damage import damages, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError, MissingExtraError
from adv2e.events import make_events, sort_events
from adv2e.formats.reading import open_events, read_events
from adv2e.formats.writing import open_sink

EPOCH_US = 1_468_941_032_229_165
METADATA = {"adv2e": "9", "note": "π <&>\"'\n"}
CORNERS = make_events(
    [EPOCH_US, EPOCH_US, EPOCH_US + 2**24 + 1, EPOCH_US + 2**32 + 1, EPOCH_US + 2**33],
    [0, 345, 0, 345, 7], [0, 0, 259, 259, 3], [1, 0, 0, 1, 1],
)  # fmt: skip
GREY = np.arange(346 * 260, dtype=np.uint32).astype(np.uint8).reshape(260, 346)
RED = np.stack([GREY, 0 * GREY, 0 * GREY], axis=2)
FRAMES = [(EPOCH_US * 1000, GREY), ((EPOCH_US + 5) * 1000, RED)]


def many(count=35_000):
    draw = np.random.default_rng(0)
    t = EPOCH_US + np.cumsum(draw.integers(0, 3, count))
    x, y, p = (draw.integers(0, most, count) for most in (346, 260, 2))
    return sort_events(make_events(t, x, y, p))


def write(path, events, frames=FRAMES, cuts=()):
    with open_sink(
        path, width=346, height=260, metadata=METADATA, with_frames=bool(frames)
    ) as sink:
        for frame in frames:
            sink.write_frame(*frame)
        for part in np.split(events, cuts):
            sink.write_events(part)
    return path


@pytest.fixture(params=["lz4", "plain"])
def packed(request, monkeypatch):
    """Write with the optional package, or without."""
    if request.param == "lz4":
        pytest.importorskip("lz4")
    else:
        monkeypatch.setitem(sys.modules, "lz4", None)
    yield request.param
    monkeypatch.undo()


def by_dv_processing(path):
    library = pytest.importorskip("dv_processing")
    recording = library.io.MonoCameraRecording(str(path))
    parts = []
    while (batch := recording.getNextEventBatch()) is not None:
        parts.append(batch.numpy())
    names = ("timestamp", "x", "y", "polarity")
    columns = ([part[name] for part in parts] for name in names)
    frames = []
    while recording.isFrameStreamAvailable() and (frame := recording.getNextFrame()) is not None:
        image = frame.image if frame.image.ndim == 2 else frame.image[..., ::-1]
        frames.append((frame.timestamp * 1000, image))
    size = recording.getEventResolution()
    return size, [np.concatenate(c) if c else np.empty(0) for c in columns], frames


def by_aedat(path):
    decoder = pytest.importorskip("aedat").Decoder(str(path))
    size = next((s["width"], s["height"]) for s in decoder.id_to_stream().values())
    packets = list(decoder)
    events = [packet["events"] for packet in packets if "events" in packet]
    columns = ([part[name] for part in events] for name in ("t", "x", "y", "on"))
    frames = [(p["frame"]["t"] * 1000, p["frame"]["pixels"]) for p in packets if "frame" in p]
    return size, [np.concatenate(c) if c else np.empty(0) for c in columns], frames


def by_faery(path):
    stream = pytest.importorskip("faery").events_stream_from_file(path)
    events = stream.to_array()
    return stream.dimensions(), [events[name] for name in ("t", "x", "y", "on")], None


@pytest.mark.parametrize("library", [by_dv_processing, by_aedat, by_faery])
@pytest.mark.parametrize(
    "events", [CORNERS, CORNERS[:1], CORNERS[:0], many()], ids=["corners", "one", "none", "many"]
)
def test_libraries_read_what_is_written(tmp_path, packed, library, events):
    path = write(tmp_path / "a.aedat4", events)

    size, columns, frames = library(path)

    assert tuple(size) == (346, 260)
    for column, name in zip(columns, "txyp", strict=True):
        assert np.array_equal(column, events[name])
    if frames is not None:
        assert [t_ns for t_ns, _ in frames] == [t_ns for t_ns, _ in FRAMES]
        for (_, image), (_, expected) in zip(frames, FRAMES, strict=True):
            assert np.array_equal(image, expected)


@pytest.mark.parametrize(
    "events", [CORNERS, CORNERS[:1], CORNERS[:0], many()], ids=["corners", "one", "none", "many"]
)
def test_what_is_written_is_read(tmp_path, packed, events):
    recording = read_events(write(tmp_path / "a.aedat4", events))

    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height, recording.layout) == (346, 260, "aedat4")
    assert recording.metadata == {**METADATA, "width": 346, "height": 260}
    if events.size < 10:
        assert recording.problems == ([] if events.size else ["no events"])
    assert recording.frame_times_ns.tolist() == [t_ns for t_ns, _ in FRAMES]
    for frame, (_, image) in zip(recording.frames(), FRAMES, strict=True):
        assert np.array_equal(frame.image, image)


def test_without_frames_there_is_no_stream_of_them(tmp_path):
    path = write(tmp_path / "a.aedat4", CORNERS, frames=())

    assert b"FRME" not in path.read_bytes()
    assert read_events(path).frame_times_ns is None


def test_bytes_do_not_depend_on_parts(tmp_path):
    whole = write(tmp_path / "a.aedat4", many(), []).read_bytes()

    assert write(tmp_path / "b.aedat4", many(), [], [1, 9999, 10_000, 33_000]).read_bytes() == whole


def test_frames_lie_among_the_events_around_them(tmp_path):
    """Who reads a file once, front to back, needs no more than a packet of memory."""
    library = pytest.importorskip("aedat")
    late = [((EPOCH_US + k * 10_000) * 1000, GREY) for k in range(6)]
    path = write(tmp_path / "a.aedat4", many(), late)

    kinds = ["F" if "frame" in packet else "e" for packet in library.Decoder(str(path))]

    assert "".join(kinds) == "FeFeeFeFFF"


def write_by_library(path, *, events=True):
    library = pytest.importorskip("dv_processing")
    config = library.io.MonoCameraWriter.Config("DAVIS346_sample")
    if events:
        config.addEventStream((346, 260))
    config.addFrameStream((346, 260))
    writer = library.io.MonoCameraWriter(str(path), config)
    if events:
        store = library.EventStore()
        for t, x, y, p in CORNERS.tolist():
            store.push_back(t, x, y, bool(p))
        writer.writeEvents(store)
    for t_ns, image in FRAMES:
        ordered = image[..., ::-1] if image.ndim == 3 else image
        writer.writeFrame(library.Frame(t_ns // 1000, ordered))
    del writer
    return path


def test_a_file_of_the_library_is_read(tmp_path):
    recording = read_events(write_by_library(tmp_path / "a.aedat4"))

    assert np.array_equal(recording.events, CORNERS)
    assert (recording.width, recording.height, recording.problems) == (346, 260, [])
    assert recording.frame_times_ns.tolist() == [t_ns for t_ns, _ in FRAMES]
    for frame, (_, image) in zip(recording.frames(), FRAMES, strict=True):
        assert np.array_equal(frame.image, image)


def test_a_file_of_frames_alone_has_no_events(tmp_path):
    recording = read_events(write_by_library(tmp_path / "a.aedat4", events=False))

    assert (recording.width, recording.height) == (346, 260)
    assert recording.problems == ["no events"]
    assert recording.frame_times_ns.tolist() == [t_ns for t_ns, _ in FRAMES]


STEREO = (
    "4 streams of events: 0 = L/denoised (1 event), 1 = L/events (2 events), 2 = R/denoised"
    " (3 events), 3 = R/events (4 events)"
)


def stereo(path):
    """Two cameras of the library; each has two streams of events, and one of frames."""
    library = pytest.importorskip("dv_processing")
    streams = ("denoised", "events")
    configs = []
    for camera in "LR":
        config = library.io.MonoCameraWriter.Config(camera)
        for stream in streams:
            config.addEventStream((346, 260), stream)
        config.addFrameStream((346, 260))
        configs.append(config)
    writer = library.io.StereoCameraWriter(str(path), *configs)
    for number, (side, stream) in enumerate(itertools.product(("left", "right"), streams), 1):
        store = library.EventStore()
        for t, x, y, p in CORNERS[:number].tolist():
            store.push_back(t, x, y, bool(p))
        getattr(writer, side).writeEvents(store, stream)
    for side in ("right", "left"):
        frame = library.Frame(EPOCH_US + (side == "right"), GREY)
        getattr(writer, side).writeFrame(frame)
    del writer
    return path


@pytest.mark.parametrize(
    ("track", "count", "is_right"),
    [
        (None, 2, False),
        ("0", 1, False),
        (3, 4, True),
        ("R", 4, True),
        ("R/denoised", 3, True),
        ("L/denoised", 1, False),
        ("denoised", 1, False),
        ("R/frames", 4, True),
    ],
)
def test_of_several_streams_that_called_events_or_the_one_named(tmp_path, track, count, is_right):
    recording = read_events(stereo(tmp_path / "a.aedat4"), track=track)

    assert len(recording.events) == count
    assert recording.frame_times_ns.tolist() == [(EPOCH_US + is_right) * 1000]
    told = [problem for problem in recording.problems if problem.startswith(STEREO)]
    assert len(told) == (track in (None, "R", "denoised", "R/frames"))


def test_streams_of_a_recording_that_was_interrupted_have_names_without_counts(tmp_path):
    path = stereo(tmp_path / "a.aedat4")
    path.write_bytes(interrupted(path))
    names = "0 = L/denoised, 1 = L/events, 2 = R/denoised, 3 = R/events, L/frames, R/frames"
    assert len(read_events(path).events) == 2
    with pytest.raises(DataError, match=f"--track 4: it holds no such track, but {names}$"):
        read_events(path, track=4)


def test_the_command_line_names_streams(adv2e, tmp_path):
    path = stereo(tmp_path / "a.aedat4")
    made = adv2e("convert", path, "-o", tmp_path / "b.csv", "--from", "events")
    assert (made.status, STEREO in made.err) == (0, True)
    for _ in range(2):
        made = adv2e(
            "convert", path, "-o", tmp_path / "b.csv", "--overwrite", "--stream", "R/denoised",
            "--from", "events",
        )  # fmt: skip
        assert (made.status, "taken" in made.err) == (0, False)
        assert len((tmp_path / "b.csv").read_text().splitlines()) == 4
    wrong = adv2e("info", path, "--track", "4")
    assert (wrong.status, wrong.err.count("\n"), STEREO.partition(": ")[2] in wrong.err) == (
        1,
        1,
        True,
    )


def interrupted(path):
    """A recording whose end was never written: no data table is stated."""
    data = bytearray(path.read_bytes())
    header = 14 + 4
    root = header + struct.unpack_from("<I", data, header)[0]
    fields = root - struct.unpack_from("<i", data, root)[0]
    at = root + struct.unpack_from("<H", data, fields + 4 + 2 * 1)[0]
    (end,) = struct.unpack_from("<q", data, at)
    struct.pack_into("<q", data, at, -1)
    return data[:end]


def test_the_cut_packet_of_an_interrupted_recording_is_left_out(tmp_path):
    path = write(tmp_path / "a.aedat4", many(), ())
    whole = interrupted(path)
    path.write_bytes(whole)
    assert np.array_equal(read_events(path).events, many())
    path.write_bytes(whole[:-7])

    recording = read_events(path)

    assert np.array_equal(recording.events, many()[:30_000])
    assert "the recording was interrupted: its last packet is cut, left out" in recording.problems


def test_a_file_cut_short_is_refused(tmp_path):
    path = write(tmp_path / "a.aedat4", many())
    path.write_bytes(path.read_bytes()[:-30_000])

    with pytest.raises(DataError, match=r"a\.aedat4: states its data table at byte"):
        read_events(path)


def test_the_package_that_is_missing_is_named(tmp_path, monkeypatch):
    pytest.importorskip("lz4")
    path = write(tmp_path / "a.aedat4", CORNERS)
    monkeypatch.setitem(sys.modules, "lz4", None)

    with pytest.raises(MissingExtraError, match=r"adv2e\[aedat4\]"):
        read_events(path)


def test_a_packet_that_fills_the_memory(tmp_path):
    frame = pytest.importorskip("lz4.frame")
    path = write(tmp_path / "a.aedat4", CORNERS[:0], ())
    data = bytearray(path.read_bytes())
    header = 14 + 4
    root = header + struct.unpack_from("<I", data, header)[0]
    fields = root - struct.unpack_from("<i", data, root)[0]
    at = root + struct.unpack_from("<H", data, fields + 4 + 2 * 1)[0]
    (end,) = struct.unpack_from("<q", data, at)
    bomb = frame.compress(bytes(100 << 20))
    struct.pack_into("<q", data, at, end + 8 + len(bomb))
    path.write_bytes(data[:end] + struct.pack("<ii", 0, len(bomb)) + bomb + data[end:])

    with pytest.raises(DataError, match="grows more than 200-fold"):
        read_events(path)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "a.aedat4"
    small = np.zeros((2, 3), np.uint8)
    return write(path, CORNERS, [(EPOCH_US * 1000, small)]).read_bytes()


@settings(max_examples=200, deadline=None)
@given(data=st.data())
@pytest.mark.thorough
def test_damaged_files(good, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.aedat4")
        path.write_bytes(data.draw(damages(good)))
        read_or_refused(path, 1000)


@pytest.mark.thorough
def test_parts_are_bounded(tmp_path):
    events = many(2_500_000)

    sizes = [part[0].size for part in open_events(write(tmp_path / "a.aedat4", events, ())).parts()]

    assert sum(sizes) == events.size
    assert max(sizes) < 1.1 * 2**20
