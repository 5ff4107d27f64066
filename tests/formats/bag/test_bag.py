import tempfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from damage import damages, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError, MissingExtraError, OutputError
from adv2e.events import make_events, sort_events
from adv2e.formats.bag import EVENT_ARRAY, EVENT_ARRAY_TEXT, EVENT_TEXT
from adv2e.formats.frames import open_frames
from adv2e.formats.reading import open_events, read_events
from adv2e.formats.writing import open_sink

rosbags = pytest.importorskip("rosbags")

from rosbags import rosbag1, rosbag2  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

EPOCH_US = 1_468_941_032_229_165
METADATA = {"adv2e": "9", "note": "π <&>\"'\n"}
CORNERS = make_events(
    [EPOCH_US, EPOCH_US, EPOCH_US + 2**24 + 1, EPOCH_US + 2**32 + 1, EPOCH_US + 2**33],
    [0, 345, 0, 345, 7], [0, 0, 259, 259, 3], [1, 0, 0, 1, 1],
)  # fmt: skip
GREY = np.arange(346 * 260, dtype=np.uint32).astype(np.uint8).reshape(260, 346)
RED = np.stack([GREY, 0 * GREY, 255 - GREY], axis=2)
FRAMES = [(EPOCH_US * 1000 + 1, GREY), (EPOCH_US * 1000 + 5_000_003, RED)]
KINDS = ["a.bag", "a"]
STREAMS = {"corners": CORNERS, "one": CORNERS[:1], "none": CORNERS[:0]}


def many(count=35_000, seed=0):
    draw = np.random.default_rng(seed)
    t = EPOCH_US + np.cumsum(draw.integers(0, 3, count))
    x, y, p = (draw.integers(0, most, count) for most in (346, 260, 2))
    return sort_events(make_events(t, x, y, p))


STREAMS["many"] = many()


def write(path, events, frames=FRAMES, cuts=()):
    with open_sink(
        path, width=346, height=260, metadata=METADATA, with_frames=bool(frames),
        format=None if path.suffix else "ros2",
    ) as sink:  # fmt: skip
        for frame in frames:
            sink.write_frame(*frame)
        for part in np.split(events, cuts):
            sink.write_events(part)
    return path


def content(path):
    files = [path] if path.is_file() else sorted(path.iterdir())
    return [(file.name, file.read_bytes()) for file in files]


def by_library(path):
    """What the package itself makes of all messages: events, frames, and times of recording."""
    events, frames, times, sizes = [], [], [], set()
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            times.append(time)
            if connection.topic == "/dvs/events":
                sizes.add((message.width, message.height))
                events += [
                    (e.ts.sec * 10**6 + e.ts.nanosec // 1000, e.x, e.y, int(e.polarity))
                    for e in message.events
                ]
            else:
                stamp = message.header.stamp
                shape = (message.height, message.width, -1)
                image = message.data.reshape(shape).squeeze()
                frames.append((stamp.sec * 10**9 + stamp.nanosec, message.encoding, image))
    return events, frames, times, sizes


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("events", STREAMS.values(), ids=STREAMS)
def test_the_library_reads_what_is_written_in_the_order_of_time(tmp_path, name, events):
    found, frames, times, sizes = by_library(write(tmp_path / name, events))

    assert found == events.tolist()
    assert sizes == ({(346, 260)} if events.size else set())
    assert times == sorted(times)
    assert [(t_ns, kind) for t_ns, kind, _ in frames] == [
        (FRAMES[0][0], "mono8"), (FRAMES[1][0], "rgb8"),
    ]  # fmt: skip
    assert all(np.array_equal(a, b) for (_, _, a), (_, b) in zip(frames, FRAMES, strict=True))


def test_events_are_recorded_after_they_came(tmp_path):
    """So that who plays the bag gets a frame before the events after it, and none too early."""
    frames = [((EPOCH_US + k * 4_000) * 1000, GREY) for k in range(9)]
    path = write(tmp_path / "a.bag", many(), frames)

    with AnyReader([path]) as reader:
        last = 0
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/dvs/events":
                stamps = [e.ts.sec * 10**9 + e.ts.nanosec for e in message.events]
                assert last <= stamps[0] and stamps[-1] == time
            last = time


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("events", STREAMS.values(), ids=STREAMS)
def test_what_is_written_is_read(tmp_path, name, events):
    recording = read_events(write(tmp_path / name, events))

    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height) == (346, 260)
    assert recording.layout == ("bag" if name == "a.bag" else "ros2")
    assert recording.metadata == {**METADATA, "width": 346, "height": 260}
    if events.size < 10:
        assert recording.problems == ([] if events.size else ["no events"])
    assert recording.frame_times_ns.tolist() == [t_ns for t_ns, _ in FRAMES]
    for _ in range(2):
        for frame, (_, image) in zip(recording.frames(), FRAMES, strict=True):
            assert np.array_equal(frame.image, image)


def test_mcap_alone_is_read(tmp_path):
    write(tmp_path / "a", CORNERS)

    recording = read_events(tmp_path / "a" / "a.mcap")

    assert np.array_equal(recording.events, CORNERS)
    assert [frame.t_ns for frame in recording.frames()] == [t_ns for t_ns, _ in FRAMES]


@pytest.mark.parametrize("name", KINDS)
def test_bytes_do_not_depend_on_parts(tmp_path, name):
    write(tmp_path / "x" / name, many(), FRAMES)
    write(tmp_path / "y" / name, many(), FRAMES, [1, 9999, 10_000, 33_000])

    assert content(tmp_path / "x" / name) == content(tmp_path / "y" / name)


@pytest.mark.parametrize("name", KINDS)
def test_a_bag_of_nothing_keeps_its_size(tmp_path, name):
    recording = read_events(write(tmp_path / name, CORNERS[:0], ()))

    assert (recording.width, recording.height, recording.problems) == (346, 260, ["no events"])


@pytest.mark.parametrize("name", KINDS)
def test_without_frames_there_is_no_topic_of_them(tmp_path, name):
    with AnyReader([write(tmp_path / name, CORNERS, ())]) as reader:
        assert [connection.topic for connection in reader.connections] == ["/dvs/events"]


@pytest.mark.parametrize("name", KINDS)
def test_nothing_is_left_where_writing_fails(tmp_path, name):
    for t_us in (-1, 2**32 * 10**6):
        with pytest.raises(OutputError, match="does not fit"):
            write(tmp_path / name, make_events([t_us], [0], [0], [1]), ())
        with pytest.raises(OutputError, match="does not fit"):
            write(tmp_path / name, CORNERS[:0], [(t_us * 1000, GREY)])
    assert list(tmp_path.iterdir()) == []


# bags that others wrote

PACKET = """std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
"""


class Bag:
    """A bag as the package writes it, whose messages it packs, too."""

    def __init__(self, path, **options):
        self.path, self.is_ros1 = path, path.suffix == ".bag"
        self.types = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        time = "time " if self.is_ros1 else "builtin_interfaces/Time "
        for text, name in (
            (EVENT_TEXT.replace("time ", time), "dvs_msgs/msg/Event"),
            (EVENT_ARRAY_TEXT, EVENT_ARRAY),
            (EVENT_TEXT.replace("time ", time), "prophesee_event_msgs/msg/Event"),
            (
                EVENT_ARRAY_TEXT.replace("dvs_msgs", "prophesee_event_msgs"),
                "prophesee_event_msgs/msg/EventArray",
            ),
            (PACKET, "event_camera_msgs/msg/EventPacket"),
            (PACKET, "event_array_msgs/msg/EventArray"),
        ):
            self.types.register(get_types_from_msg(text, name))
        if self.is_ros1:
            self.writer = rosbag1.Writer(path)
        else:
            self.writer = rosbag2.Writer(path, version=8, **options)
        if options and self.is_ros1:
            self.writer.set_compression(options["compression"])
        self.topics = {}

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *raised):
        self.writer.close()

    def make(self, kind, **values):
        kind = self.types.types[kind]
        return kind(**values)

    def header(self, t_ns):
        stamp = self.make("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        more = {"seq": 0} if self.is_ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="camera", **more)

    def write(self, topic, kind, t_ns, recorded=None, **values):
        if topic not in self.topics:
            self.topics[topic] = self.writer.add_connection(topic, kind, typestore=self.types)
        message = self.make(kind, header=self.header(t_ns), **values)
        pack = self.types.serialize_ros1 if self.is_ros1 else self.types.serialize_cdr
        self.writer.write(self.topics[topic], recorded or t_ns, pack(message, kind))

    def packet(self, topic, t_us, encoding, data, kind="event_camera_msgs/msg/EventPacket", **more):
        values = {"height": 260, "width": 346, "seq": 0, "time_base": 0, "is_bigendian": False}
        self.write(
            topic, kind, t_us * 1000, encoding=encoding, events=np.frombuffer(data, np.uint8),
            **(values | more),
        )  # fmt: skip

    def events(self, topic, events, package="dvs_msgs"):
        made = [
            self.make(
                f"{package}/msg/Event", x=x, y=y, polarity=bool(p),
                ts=self.header(t * 1000).stamp,
            )
            for t, x, y, p in events.tolist()
        ]  # fmt: skip
        kind = f"{package}/msg/EventArray"
        self.write(topic, kind, EPOCH_US * 1000, height=260, width=346, events=made)

    def image(self, topic, t_ns, encoding, array, **options):
        data = np.frombuffer(array.tobytes(), np.uint8)
        self.write(
            topic, "sensor_msgs/msg/Image", t_ns, height=array.shape[0], width=array.shape[1],
            encoding=encoding, is_bigendian=0, step=data.size // array.shape[0], data=data,
            **options,
        )  # fmt: skip


WRITTEN = {
    "ros1": ("o.bag", {}),
    "ros1 bz2": ("o.bag", {"compression": rosbag1.Writer.CompressionFormat.BZ2}),
    "ros1 lz4": ("o.bag", {"compression": rosbag1.Writer.CompressionFormat.LZ4}),
    "mcap": ("o", {"storage_plugin": rosbag2.StoragePlugin.MCAP}),
    "sqlite": ("o", {"storage_plugin": rosbag2.StoragePlugin.SQLITE3}),
}


@pytest.mark.parametrize(("name", "options"), WRITTEN.values(), ids=WRITTEN)
def test_bags_of_the_library_are_read(tmp_path, name, options):
    events, deep = many(25), GREY.astype(np.uint16) * 200
    with Bag(tmp_path / name, **options) as bag:
        bag.events("/dvs/events", events[:12])
        bag.image("/dvs/image_raw", EPOCH_US * 1000, "mono8", GREY)
        bag.image("/dvs/image_raw", EPOCH_US * 1000 + 7, "mono16", deep)
        bag.image("/dvs/image_raw", EPOCH_US * 1000 + 7, "bgr8", RED[..., ::-1])
        bag.image("/dvs/image_raw", EPOCH_US * 1000 + 8, "rgba8", np.dstack([RED, GREY]))
        bag.events("/dvs/events", events[12:])

    recording = read_events(tmp_path / name)

    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height) == (346, 260)
    frames = list(recording.frames())
    assert [frame.t_ns - EPOCH_US * 1000 for frame in frames] == [0, 7, 7, 8]
    for frame, expected in zip(frames, (GREY, deep, RED, RED), strict=True):
        assert frame.image.dtype == expected.dtype
        assert np.array_equal(frame.image, expected)


@pytest.mark.parametrize("name", ["o.bag", "o"])
@pytest.mark.parametrize("is_big", [False, True])
def test_event_packets_of_mono(tmp_path, name, is_big):
    events = many(9)
    words = (
        events["p"].astype(np.uint64) << np.uint64(63)
        | events["y"].astype(np.uint64) << np.uint64(48)
        | events["x"].astype(np.uint64) << np.uint64(32)
        | ((events["t"] - EPOCH_US) * 1000).astype(np.uint64)
    )
    data = np.frombuffer(words.astype(">u8" if is_big else "<u8").tobytes(), np.uint8)
    with Bag(tmp_path / name) as bag:
        bag.write(
            "/camera/events", "event_camera_msgs/msg/EventPacket", EPOCH_US * 1000, height=260,
            width=346, seq=0, time_base=123, encoding="mono", is_bigendian=is_big, events=data,
        )  # fmt: skip

    assert np.array_equal(read_events(tmp_path / name).events, events)


@pytest.mark.parametrize("name", ["o.bag", "o"])
def test_arrays_of_prophesee(tmp_path, name):
    with Bag(tmp_path / name) as bag:
        bag.events("/prophesee/camera/cd_events_buffer", many(9), "prophesee_event_msgs")

    recording = read_events(tmp_path / name)

    assert np.array_equal(recording.events, many(9))
    assert (recording.width, recording.height, recording.problems) == (346, 260, [])


def sent(events, encoding):
    """What a camera sends of events, word for word."""
    words = []
    for t, x, y, p in events.tolist():
        if encoding == "evt3":
            words += [(0x8 << 12 | t >> 12 & 0xFFF, 2), (0x6 << 12 | t & 0xFFF, 2)]
            words += [(y, 2), (0x2 << 12 | p << 11 | x, 2)]
            words += [(0xA << 12 | 1, 2)]  # a trigger
        elif encoding == "evt2":
            words += [(0x8 << 28 | t >> 6 & 0xFFFFFFF, 4)]
            words += [(p << 28 | (t & 63) << 22 | x << 11 | y, 4)]
        else:
            words += [(0x8 << 60 | (t >> 6 & 0xFFFFFFF) << 32, 8)]
            place = p << 60 | (t & 63) << 54 | (x & ~31) << 43 | y << 32
            words += [(place | 1 << (x & 31), 8)]
    return [word.to_bytes(size, "little") for word, size in words]


KINDS_OF_PACKETS = ["event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray"]


@pytest.mark.parametrize("name", ["o.bag", "o"])
@pytest.mark.parametrize("kind", KINDS_OF_PACKETS)
@pytest.mark.parametrize("encoding", ["evt3", "evt2", "evt21", "evt3;height=260;width=346"])
def test_packets_of_what_the_camera_sent_are_laid_on_the_clock_of_ros(
    tmp_path, name, kind, encoding
):
    """Packets are cut anywhere; the clock of the camera begins again, and drifts."""
    events = many(60)
    events["t"] += 5_000_000 * (np.arange(60) // 20)
    clock = events.copy()
    clock["t"] += 2**34 - 7_000_000 - events["t"][0]  # begins again in all encodings
    words = sent(clock, encoding.partition(";")[0])
    per_event = len(words) // 60
    with Bag(tmp_path / name) as bag:
        for k, cut in enumerate(range(0, 60, 20)):
            begin = max(0, cut * per_event - (k > 0))
            data = b"".join(words[begin : (cut + 20) * per_event - 1 if cut < 40 else None])
            bag.packet("/camera/events", int(events["t"][cut]) + 3 * k, encoding, data, kind, seq=k)
            bag.packet("/camera/triggers", EPOCH_US, "trigger", b"x", kind, seq=k)

    recording = read_events(tmp_path / name)

    assert np.array_equal(recording.events, events)
    assert (recording.width, recording.height) == (346, 260)
    shift = (
        int(events["t"][0]) - int(clock["t"][0]) % (2**24 if "evt3" in encoding else 2**34)
    ) / 1e6
    assert recording.problems[1:] == [
        f"times are those of the camera's clock, shifted by {shift:.6f} s: the first event is at"
        " the stamp of its packet"
    ]


def test_turns_of_the_clock_in_packets_that_are_missing(tmp_path):
    events = many(40)
    events["t"][20:] += 40_000_000  # more than two turns of 2^24 us
    words = sent(events, "evt3")
    with Bag(tmp_path / "o.bag") as bag:
        for seq, cut in ((0, 0), (900, 20)):
            data = b"".join(words[cut * 5 : (cut + 20) * 5])
            bag.packet("/events", int(events["t"][cut]) + seq, "evt3", data, seq=seq)

    recording = read_events(tmp_path / "o.bag")

    assert np.array_equal(recording.events, events)
    assert any("message 1: 899 packets before it are missing" in p for p in recording.problems)


def test_the_user_may_name_a_topic_without_events(tmp_path):
    with Bag(tmp_path / "o.bag") as bag:
        bag.packet("/camera/events", EPOCH_US, "evt3", b"".join(sent(many(3), "evt3")))
        bag.packet("/camera/triggers", EPOCH_US, "trigger", b"x")

    assert read_events(tmp_path / "o.bag", track="triggers").problems == ["no events"]


def test_other_encodings_are_named(tmp_path):
    with Bag(tmp_path / "o.bag") as bag:
        bag.packet("/camera/events", 1, "libcaer_cmp", bytes(4))
        bag.image("/camera/image", 0, "bayer_rggb8", GREY)
    with pytest.raises(
        DataError,
        match=r"/camera/events message 0: events in the encoding 'libcaer_cmp'; mono, evt2",
    ):
        read_events(tmp_path / "o.bag")
    with Bag(tmp_path / "q.bag") as bag:
        bag.packet("/camera/events", 1, "evt3", bytes(3))
    with pytest.raises(DataError, match=r"damaged: 3 bytes of evt3 are no whole words of 2"):
        read_events(tmp_path / "q.bag")

    with Bag(tmp_path / "p.bag") as bag:
        bag.events("/camera/events", CORNERS)
        bag.image("/camera/image", 0, "bayer_rggb8", GREY)
    with pytest.raises(DataError, match=r"/camera/image message 0: an image in the .*bayer_rggb8"):
        list(read_events(tmp_path / "p.bag").images())


def test_of_several_topics_those_of_one_camera_are_taken(tmp_path):
    with Bag(tmp_path / "o.bag") as bag:
        for side in ("right", "left"):
            bag.events(f"/davis/{side}/events", CORNERS if side == "left" else CORNERS[:2])
            for n, name in enumerate(("depth_map", "image_raw")):
                picture = GREY if (side, name) == ("left", "image_raw") else 0 * GREY
                bag.image(f"/davis/{side}/{name}", n, "mono8", picture)

    recording = read_events(tmp_path / "o.bag")

    assert np.array_equal(recording.events, CORNERS)
    assert [np.array_equal(frame.image, GREY) for frame in recording.frames()] == [True]
    assert recording.problems[:2] == [
        "2 streams of events: 0 = /davis/left/events (1 message), 1 = /davis/right/events"
        " (1 message): 0 = /davis/left/events is taken, --track chooses another",
        "4 tracks of frames: /davis/left/depth_map (1 message), /davis/left/image_raw (1 message),"
        " /davis/right/depth_map (1 message), /davis/right/image_raw (1 message):"
        " /davis/left/image_raw is taken, --track chooses another",
    ]


@pytest.mark.parametrize("name", ["o.bag", "o"])
@pytest.mark.parametrize("track", [1, "right", "/davis/right/events", "/davis/right/image_raw"])
def test_the_topic_that_the_user_names_is_taken(tmp_path, name, track):
    with Bag(tmp_path / name) as bag:
        for side in ("right", "left"):
            bag.events(f"/davis/{side}/events", CORNERS if side == "right" else CORNERS[:2])
            bag.image(f"/davis/{side}/image_raw", 7, "mono8", GREY if side == "right" else 0 * GREY)

    recording = read_events(tmp_path / name, track=track)

    assert np.array_equal(recording.events, CORNERS)
    assert [np.array_equal(frame.image, GREY) for frame in recording.frames()] == [True]
    assert not any("taken" in problem for problem in recording.problems)
    with pytest.raises(
        DataError, match=r"--track /dvs/events: it holds no such track, but 0 = /davis"
    ):
        read_events(tmp_path / name, track="/dvs/events")


def test_of_topics_of_images_alone_the_user_chooses(tmp_path):
    with Bag(tmp_path / "o.bag") as bag:
        for side in ("left", "right"):
            for stamp in (7, 8):
                bag.image(f"/{side}/image_raw", stamp, "mono8", GREY * (side == "right"))
    first, second = (open_frames(tmp_path / "o.bag", track=track) for track in (None, "1"))

    assert not any(frame.image.any() for frame in first.frames())
    assert all(np.array_equal(frame.image, GREY) for frame in second.frames())
    assert first.doubts == [
        f"{tmp_path / 'o.bag'}: 2 tracks of frames: 0 = /left/image_raw (2 messages), 1 ="
        " /right/image_raw (2 messages): 0 = /left/image_raw is taken, --track chooses another"
    ]
    assert second.doubts == []


def test_compressed_images_and_stamps_that_go_back(tmp_path):
    done, png = cv2.imencode(".png", RED[..., ::-1])
    assert done
    with Bag(tmp_path / "o.bag") as bag:
        bag.events("/events", CORNERS)
        for stamp, recorded in ((9, 1), (5, 2)):
            bag.write(
                "/image/compressed", "sensor_msgs/msg/CompressedImage", stamp, recorded,
                format="png", data=png.ravel(),
            )  # fmt: skip

    recording = read_events(tmp_path / "o.bag")

    assert [frame.t_ns for frame in recording.frames()] == [5, 9]
    assert all(np.array_equal(frame.image, RED) for frame in recording.frames())
    assert any("not in the order of their stamps" in told for told in recording.problems)


def test_a_bag_of_images_alone_is_opened(tmp_path):
    with Bag(tmp_path / "o.bag") as bag:
        for n in range(2):
            bag.image("/image", n * 10**7, "mono8", GREY)

    file = open_events(tmp_path / "o.bag")

    assert file.facts.geometry == (346, 260)
    assert list(file.parts()) == []
    assert [shot.t_ns for shot in file.shots()] == [0, 10**7]


def test_what_else_a_bag_holds_is_named(tmp_path):
    with Bag(tmp_path / "o.bag") as bag:
        stamp = bag.make("std_msgs/msg/String", data="hello")
        topic = bag.writer.add_connection("/talk", "std_msgs/msg/String", typestore=bag.types)
        bag.writer.write(topic, 1, bag.types.serialize_ros1(stamp, "std_msgs/msg/String"))

    with pytest.raises(DataError, match=r"neither events .* nor images, but /talk \(std_msgs"):
        read_events(tmp_path / "o.bag")


@pytest.mark.thorough
def test_a_chunk_that_fills_the_memory(tmp_path):
    path = tmp_path / "o.bag"
    with Bag(path, compression=rosbag1.Writer.CompressionFormat.BZ2) as bag:
        bag.image("/image", 1, "mono8", np.zeros((10_000, 10_000), np.uint8))

    with pytest.raises(DataError, match=r"o\.bag: chunk at byte 4109: .* more than 200-fold"):
        read_events(path)


def test_the_package_that_is_missing_is_named(tmp_path, monkeypatch):
    import sys

    path = write(tmp_path / "a.bag", CORNERS)
    monkeypatch.setitem(sys.modules, "rosbags", None)

    with pytest.raises(MissingExtraError, match=r"adv2e\[bag\]"):
        read_events(path)
    with pytest.raises(MissingExtraError, match=r"adv2e\[bag\]"):
        write(tmp_path / "b.bag", CORNERS)
    assert sorted(tmp_path.iterdir()) == [path, tmp_path / "a.bag.json"]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    small = [(EPOCH_US * 1000, np.zeros((2, 3), np.uint8))]
    bag, mcap = write(folder / "a.bag", CORNERS, small), write(folder / "a", CORNERS, small)
    return {".bag": bag.read_bytes(), ".mcap": (mcap / "a.mcap").read_bytes()}


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
@settings(max_examples=200, deadline=None)
@given(data=st.data())
@pytest.mark.quick_cases(1)
def test_damaged_bags(good, suffix, data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"a{suffix}")
        path.write_bytes(data.draw(damages(good[suffix])))
        read_or_refused(path, 1000)
