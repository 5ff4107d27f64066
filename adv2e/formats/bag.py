"""Bags of ROS 1 (``.bag``) and ROS 2 (a folder with metadata.yaml, ``.mcap`` or ``.db3``).

The containers are read and written by the package ``rosbags``, the messages here, with arrays in
place of objects: it would make an object of each event.

============================== ====================================================================
dvs_msgs/EventArray            header, height, width, events: x, y, time, polarity; the same of
                               prophesee_event_msgs
event_camera_msgs/EventPacket  header, height, width, sequence number, time, encoding, bytes; called
                               event_array_msgs/EventArray before
sensor_msgs/Image              header, height, width, encoding, byte order, bytes a row, bytes
sensor_msgs/CompressedImage    header, format, bytes of PNG or JPEG
============================== ====================================================================

Encodings of packets are ``mono`` (words of 64 bits, from the top polarity 1, y 15, x 16,
nanoseconds since the stamp of the header 32), ``evt3``, ``evt2`` and ``evt21``, which are what the
camera sent, cut anywhere, and ``trigger``, which holds no events.  What a camera sent has times of
its own clock.  They are shifted, all alike, so that the first event is at the stamp of its packet.

ROS 1 packs numbers without gaps.  CDR aligns each to its own size, so that of 16 bytes an event
takes, two lie between those of its neighbours; strings end with a zero.

Events have their own times, frames that of their header, both on the clock of ROS.  Of several
topics with events, the first is taken, those named right last; of several with images, one of the
same camera, ``image_raw`` first; unless the user names one.

What is written:

======================= ====================== ====================================================
topic                   message                when it was recorded
======================= ====================== ====================================================
``/dvs/events``         dvs_msgs/EventArray    at its last event; of 10,000 events at most
``/dvs/image_raw``      sensor_msgs/Image      at its time; mono8 or rgb8
======================= ====================== ====================================================

Messages are written in the order of time, not compressed, which every reader takes: to a ``.bag``,
or to a folder with metadata.yaml and MCAP, of which ``custom_data`` holds the configuration.

References
----------
.. [1] github.com/uzh-rpg/rpg_dvs_ros: dvs_msgs/msg; github.com/ros-event-camera/event_camera_msgs.
.. [2] Object Management Group, "Common Object Request Broker Architecture", part 2, CDR, 2021.
.. [3] "Bag format 2.0", https://wiki.ros.org/Bags/Format/2.0; "MCAP", https://mcap.dev/spec.
.. [4] rosbags, https://gitlab.com/ternaris/rosbags.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import Adv2eError, DataError, MissingExtraError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.files.regular import check_expansion, expand
from adv2e.files.staging import Staging
from adv2e.formats.binary import DECODERS
from adv2e.formats.clock import shots_in_order
from adv2e.formats.event_file import MOST_COLUMNS, Columns, EventFile, Facts, joined
from adv2e.formats.writing import Pieces, Request, Writer, to_json
from adv2e.label import left_out
from adv2e.light.pictures import eight_bit
from adv2e.process.machine import machine_complaint
from adv2e.sources.frame import Frame, Shot, Track, counted
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.times.rates import NS_PER_S
from adv2e.ticks import check_time, check_us

EVENT_ARRAY = "dvs_msgs/msg/EventArray"
IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

EVENT_TEXT = "uint16 x\nuint16 y\ntime ts\nbool polarity\n"
EVENT_ARRAY_TEXT = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
"""Definitions of the messages that ROS itself does not have."""

_PACKED = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
"""An event of ROS 1."""
_ALIGNED = np.dtype({
    "names": ["y", "first_y", "s", "ns", "p", "next_x"],
    "formats": ["<u2", "<u2", "<i4", "<u4", "u1", "<u2"],
    "offsets": [0, 2, 4, 8, 12, 14], "itemsize": 16,
})  # fmt: skip
"""16 bytes of CDR: the first hold x and y of the first event where others have y and nothing."""
_SURPLUS = 3  # bytes that the last event does not have

_ENCODINGS: dict[str, tuple[str, int, slice | int]] = {
    "mono8": ("u1", 1, 0), "8UC1": ("u1", 1, 0), "mono16": ("u2", 1, 0), "16UC1": ("u2", 1, 0),
    "rgb8": ("u1", 3, slice(0, 3)), "rgba8": ("u1", 4, slice(0, 3)),
    "bgr8": ("u1", 3, slice(2, None, -1)), "bgra8": ("u1", 4, slice(2, None, -1)),
    "8UC3": ("u1", 3, slice(2, None, -1)),
    "rgb16": ("u2", 3, slice(0, 3)), "bgr16": ("u2", 3, slice(2, None, -1)),
}  # fmt: skip
"""Type, channels, and which of them are the grey or red, green, blue."""


@dataclass(frozen=True)
class EventMessage:
    """Events of one message: its sensor, and columns with the time [us]."""

    size: tuple[int, int]
    columns: Columns


class _Cursor:
    """Reads a message from front to back.

    Parameters
    ----------
    is_cdr : bool
        It is of ROS 2.
    label : str
        What it is called, for messages.
    """

    def __init__(self, data: bytes, is_cdr: bool, label: str) -> None:
        self._data, self._is_cdr, self.label = data, is_cdr, label
        self._at = 0
        if is_cdr:
            if data[1:2] not in (b"\1", b"\3", b"\7", b"\x0b"):
                raise DataError(f"{label}: is not little-endian CDR, which alone is read")
            self._data = data[4:]

    def number(self, kind: str) -> int:
        """Return a number, of a kind that :mod:`struct` knows."""
        size = struct.calcsize("<" + kind)
        if self._is_cdr:
            self._at += -self._at % size
        try:
            value: int = struct.unpack_from("<" + kind, self._data, self._at)[0]
        except struct.error:
            raise DataError(f"{self.label}: cut short") from None
        self._at += size
        return value

    def string(self) -> str:
        return self.bytes(self.number("I")).rstrip(b"\0").decode("utf-8", "replace")

    def bytes(self, count: int) -> bytes:
        """Return the next bytes; DataError if the message ends before."""
        if self._at + count > len(self._data):
            raise DataError(f"{self.label}: cut short: states {count:,} bytes")
        self._at += count
        return self._data[self._at - count : self._at]

    def stamp_ns(self) -> int:
        """Return the time of the header [ns], and pass the header."""
        if not self._is_cdr:
            self.number("I")  # sequence number
        seconds = self.number("i" if self._is_cdr else "I")
        stamp = seconds * NS_PER_S + self.number("I")
        self.string()
        return stamp


def read_event_array(data: bytes, is_cdr: bool, label: str) -> EventMessage:
    """Return the events of a dvs_msgs/EventArray; DataError if it is damaged."""
    cursor = _Cursor(data, is_cdr, label)
    cursor.stamp_ns()
    height, width, count = cursor.number("I"), cursor.number("I"), cursor.number("I")
    if is_cdr and count:
        stored = cursor.bytes(_ALIGNED.itemsize * count - _SURPLUS) + bytes(_SURPLUS)
        events = np.frombuffer(stored, _ALIGNED)
        y, x = events["y"].copy(), np.roll(events["next_x"], 1)
        x[0], y[0] = events["y"][0], events["first_y"][0]
    else:
        events = np.frombuffer(cursor.bytes(_PACKED.itemsize * count), _PACKED)
        x, y = events["x"], events["y"]
    t = events["s"].astype(np.int64) * 1_000_000 + (events["ns"].astype(np.int64) + 500) // 1000
    return EventMessage((width, height), (t, x, y, (events["p"] != 0).astype(np.uint8)))


class PacketReader:
    """Reads the packets of a topic, one after another.

    Parameters
    ----------
    tell : callable
        Takes what is to be told; packets may be read more than once.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._decoder: Any = None
        self._shift_us: int | None = None
        self._number: int | None = None

    def __call__(self, data: bytes, is_cdr: bool, label: str) -> EventMessage:
        """Return the events of an event_camera_msgs/EventPacket; DataError if it cannot be read."""
        cursor = _Cursor(data, is_cdr, label)
        stamp_ns = cursor.stamp_ns()
        height, width = cursor.number("I"), cursor.number("I")
        number = cursor.number("Q")
        cursor.number("Q")  # time on the clock of the sensor; that of the header is on ROS's
        encoding = cursor.string()
        name, *options = encoding.upper().split(";")
        is_big = bool(cursor.number("B"))
        content = cursor.bytes(cursor.number("I"))
        if name == "TRIGGER":
            content, name = b"", "MONO"
        if name != "MONO" and name not in DECODERS:
            known = ", ".join(DECODERS).lower()
            raise DataError(
                f"{label}: events in the encoding {encoding!r}; mono, {known} are read, and"
                " event_camera_tools of ROS converts bags to dvs_msgs/EventArray"
            )
        word = np.dtype((">u8" if is_big else "<u8") if name == "MONO" else DECODERS[name].word)
        if len(content) % word.itemsize:
            raise DataError(
                f"{label}: damaged: {len(content):,} bytes of {encoding} are no whole words of"
                f" {word.itemsize}"
            )
        words = np.frombuffer(content, word)
        if name == "MONO":
            return EventMessage((width, height), _of_mono(words.astype(np.uint64), stamp_ns))
        if self._decoder is None:
            stated = (option.lower().partition("endianness=")[2] for option in options)
            self._decoder = DECODERS[name](next(filter(None, stated), ""))
        columns = self._decoder.events_of(words)
        lost = 0 if self._number is None else number - self._number - 1
        self._number = number
        return EventMessage((width, height), self._on_ros(columns, stamp_ns // 1000, lost, label))

    def _on_ros(self, columns: Columns, stamp_us: int, lost: int, label: str) -> Columns:
        """Return events with times on the clock of ROS."""
        t, x, y, p = columns
        if not t.size:
            return columns
        first = int(t[0])
        if self._shift_us is None:
            self._shift_us = stamp_us - first
            self._tell(
                f"times are those of the camera's clock, shifted by {self._shift_us / 1e6:.6f} s:"
                " the first event is at the stamp of its packet"
            )
        elif lost > 0:  # and with them, perhaps, turns of the clock
            turn = 1 << self._decoder.bits
            self._shift_us += round((stamp_us - first - self._shift_us) / turn) * turn
            self._tell(left_out(f"{label}: {lost:,} packets before it are missing", "packets"))
        return t + self._shift_us, x, y, p

    def end(self) -> None:
        """Report the problems of all packets."""
        for text in self._decoder.problems() if self._decoder is not None else ():
            self._tell(text)


def _of_mono(words: NDArray[np.uint64], stamp_ns: int) -> Columns:
    t = (stamp_ns + (words & np.uint64(0xFFFFFFFF)).astype(np.int64) + 500) // 1000
    x = (words >> np.uint64(32) & np.uint64(0xFFFF)).astype(np.uint16)
    y = (words >> np.uint64(48) & np.uint64(0x7FFF)).astype(np.uint16)
    return t, x, y, (words >> np.uint64(63)).astype(np.uint8)


def read_image(data: bytes, is_cdr: bool, label: str) -> Frame:
    """Return the picture of a sensor_msgs/Image; DataError if that cannot be read."""
    cursor = _Cursor(data, is_cdr, label)
    cursor.stamp_ns()
    height, width, encoding = cursor.number("I"), cursor.number("I"), cursor.string()
    is_big, step = bool(cursor.number("B")), cursor.number("I")
    content = cursor.bytes(cursor.number("I"))
    if encoding not in _ENCODINGS:
        raise DataError(
            f"{label}: an image in the encoding {encoding!r}, must be one of"
            f" {', '.join(_ENCODINGS)}"
        )
    kind, channels, chosen = _ENCODINGS[encoding]
    dtype = np.dtype((">" if is_big else "<") + kind)
    row = width * channels * dtype.itemsize
    if not (width and height and row <= step and step * height == len(content)):
        raise DataError(
            f"{label}: an image of {width}x{height} {encoding} in {len(content):,} bytes, {step:,}"
            " a row: damaged"
        )
    rows = np.frombuffer(content, np.uint8).reshape(height, step)[:, :row]
    image = np.ascontiguousarray(rows).view(dtype).reshape(height, width, channels)
    return Frame(np.ascontiguousarray(image[..., chosen]).astype(kind))


def read_compressed(data: bytes, is_cdr: bool, label: str) -> Frame:
    """Return the picture of a sensor_msgs/CompressedImage; DataError if that cannot be read."""
    cursor = _Cursor(data, is_cdr, label)
    cursor.stamp_ns()
    cursor.string()
    return decode_image(cursor.bytes(cursor.number("I")), label)


def event_array(events: Events, size: tuple[int, int], is_cdr: bool) -> bytes:
    """Return a dvs_msgs/EventArray of one event or more, stamped with the last."""
    seconds, us = np.divmod(events["t"], 1_000_000)
    begin = _header(int(events["t"][-1]) * 1000, is_cdr)
    begin += struct.pack("<III", size[1], size[0], events.size)
    stored = np.zeros(events.size, _ALIGNED if is_cdr else _PACKED)
    stored["s"], stored["ns"], stored["p"] = seconds, us * 1000, events["p"]
    stored["y"] = events["y"]
    if not is_cdr:
        stored["x"] = events["x"]
        return begin + stored.tobytes()
    stored["next_x"][:-1] = events["x"][1:]
    stored["y"][0], stored["first_y"][0] = events["x"][0], events["y"][0]
    return begin + stored.tobytes()[:-_SURPLUS]


def image(picture: NDArray[np.uint8], t_ns: int, is_cdr: bool) -> bytes:
    """Return a sensor_msgs/Image of a grey or RGB picture."""
    height, width = picture.shape[:2]
    encoding = b"rgb8" if picture.ndim == 3 else b"mono8"
    begin = _header(t_ns, is_cdr) + struct.pack("<II", height, width)
    end = b"\0" if is_cdr else b""
    begin += struct.pack("<I", len(encoding + end)) + encoding + end + b"\0"  # little-endian
    if is_cdr:
        begin += bytes(-len(begin) % 4)
    step = width * (3 if picture.ndim == 3 else 1)
    return begin + struct.pack("<II", step, picture.size) + picture.tobytes()


def _header(t_ns: int, is_cdr: bool) -> bytes:
    """Return the beginning of a message: a std_msgs/Header with no name of a place."""
    seconds, ns = divmod(t_ns, NS_PER_S)
    if is_cdr:
        return b"\0\1\0\0" + struct.pack("<iII", seconds, ns, 1) + bytes(4)
    return struct.pack("<IIII", 0, seconds, ns, 0)


_PACKETS = "event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray"
_EVENTS = EVENT_ARRAY, "prophesee_event_msgs/msg/EventArray", *_PACKETS
_IMAGES = {IMAGE: read_image, COMPRESSED: read_compressed}


def open_bag(path: Path, facts: Facts) -> EventFile:
    """Open a bag.

    Raises
    ------
    DataError
        It is damaged, or holds neither events nor images.
    MissingExtraError
        The package ``rosbags`` is not installed.
    """
    bag = _Bag(path, facts)
    facts.inputs += (file for kind in ("*.yaml", "*.db3*", "*.mcap*") for file in path.glob(kind))
    if bag.settings:
        facts.describe(bag.settings, f"{path}: adv2e", "the file")
    facts.stated_unit = "us"
    first = next(bag.events(), None)
    if first is not None:
        facts.state(_size(first.size), "its first message of events")
    elif bag.images is not None and bag.images.count:
        height, width = bag.frame(0, f"{path}: the first image").image.shape[:2]
        facts.state((width, height), "its first image")

    def parts() -> Iterator[Columns]:
        total = bag.events_count
        for number, message in enumerate(bag.events(), 1):
            yield message.columns
            facts.progress(number, max(number, total))
        facts.progress(max(total, 1), max(total, 1))

    shots = partial(_shots, bag, facts) if bag.images is not None and bag.images.count else None
    return EventFile("bag" if bag.is_ros1 else "ros2", facts, partial(joined, parts), shots)


def _size(size: tuple[int, int]) -> tuple[int, int] | None:
    return size if min(size) > 0 and max(size) <= MOST_COLUMNS else None


def _shots(bag: _Bag, facts: Facts) -> Iterator[Shot]:
    shots = [
        Shot(t_ns, label, partial(bag.frame, number, label))
        for number, (t_ns, label) in enumerate(bag.stamps())
    ]
    name = bag.images.name if bag.images is not None else ""
    text = f"{name}: images are not in the order of their stamps: sorted"
    yield from shots_in_order(shots, facts, text)


@dataclass(frozen=True)
class _Topic:
    """A topic: its messages may come from several publishers."""

    name: str
    holds: str
    connections: list[Any]
    count: int

    @property
    def track(self) -> Track:
        """Track of the topic: name, number of messages, whether it is a usual one."""
        is_usual = self.holds != COMPRESSED and self.name.endswith(("/image_raw", "/events"))
        return Track(self.name, counted(self.count, "messages"), is_usual, not self.count)


def _topics(connections: list[Any]) -> list[_Topic]:
    found: dict[tuple[str, str], list[Any]] = {}
    for connection in connections:
        found.setdefault((connection.topic, connection.msgtype), []).append(connection)
    return [_Topic(*key, held, sum(c.msgcount for c in held)) for key, held in found.items()]


class _Bag:
    """A bag that stays open as long as its frames may be loaded.

    Attributes
    ----------
    settings : str
        What this program wrote inside, if it did.
    events_count : int
        Messages of events.
    images : _Topic or None
        The topic of the frames.
    """

    def __init__(self, path: Path, facts: Facts) -> None:
        self._path, self._reader, self._tell = path, None, facts.tell
        self.is_ros1 = path.suffix.lower() == ".bag"
        with _reading(path):
            self._reader = _opened(path, self.is_ros1)
            topics = _topics(self._reader.connections)
            about = None if self.is_ros1 else self._reader.storage.metadata
            self.settings = str((getattr(about, "custom", None) or {}).get("adv2e", ""))
        topics.sort(key=lambda t: ("trigger" in t.name, "right" in t.name, t.name))
        events, images = ([t for t in topics if t.holds in kind] for kind in (_EVENTS, _IMAGES))
        event, image = facts.choose([t.track for t in events], [t.track for t in images])
        others = (t for t in topics if t.holds not in (*_EVENTS, *_IMAGES))
        facts.uncarried += [f"{t.name} ({t.holds})" for t in others]
        self._events = None if event is None else events[event]
        self.images = None if image is None else images[image]
        if self._events is None and self.images is None:
            known = ", ".join(f"{t.name} ({t.holds})" for t in topics) or "nothing"
            raise DataError(
                f"{path}: holds neither events ({', '.join(_EVENTS)}) nor images, but {known}"
            )
        self.events_count = self._events.count if self._events is not None else 0
        self._times: list[int] = []  # when the images were recorded [ns]
        self._running: Iterator[tuple[int, bytes]] = iter(())
        self._next = -1  # number of the image that comes from it next

    def __del__(self) -> None:
        if self._reader is not None:
            with suppress(Exception):
                self._running = iter(())
                self._reader.close()

    def _messages(self, topic: _Topic, start: int | None = None) -> Iterator[tuple[int, bytes]]:
        """Yield time of recording [ns] and content of each message of a topic."""
        with _reading(self._path):
            assert self._reader is not None
            for _, time, data in self._reader.messages(topic.connections, start=start):
                yield time, bytes(data)

    def events(self) -> Iterator[EventMessage]:
        """Yield the messages of events."""
        if self._events is None:
            return
        packets = PacketReader(self._tell) if self._events.holds in _PACKETS else None
        read: Callable[[bytes, bool, str], EventMessage] = packets or read_event_array
        for number, (_, data) in enumerate(self._messages(self._events)):
            label = f"{self._path}: {self._events.name} message {number}"
            message = read(data, not self.is_ros1, label)
            check_us(message.columns[0], label)
            yield message
        if packets is not None:
            packets.end()

    def stamps(self) -> Iterator[tuple[int, str]]:
        """Yield the times in the headers of the images [ns], and what they are called."""
        assert self.images is not None
        self._times = []
        for number, (time, data) in enumerate(self._messages(self.images)):
            self._times.append(time)
            label = f"{self._path}: {self.images.name} message {number}"
            t_ns = _Cursor(data, not self.is_ros1, label).stamp_ns()
            check_time(t_ns, label)
            yield t_ns, label

    def frame(self, number: int, label: str) -> Frame:
        """Load an image; faster if those before it were loaded last."""
        assert self.images is not None
        if number != self._next:
            start = self._times[number] if self._times else None
            begin = self._times.index(start) if start is not None else 0
            self._running = self._messages(self.images, start)
            for _ in range(begin, number):
                next(self._running, None)
        self._next = number + 1
        found = next(self._running, None)
        if found is None:
            raise DataError(f"{label}: is missing")
        return _IMAGES[self.images.holds](found[1], not self.is_ros1, label)


def _opened(path: Path, is_ros1: bool) -> Any:
    """Return a reader of the package; DataError if it reads no such file."""
    try:
        from rosbags import rosbag1, rosbag2  # noqa: PLC0415 - an optional package
    except ImportError:
        raise MissingExtraError(f"{path}: a bag of ROS", "bag") from None
    reader: Any = rosbag1.Reader(path) if is_ros1 else rosbag2.Reader(path)
    reader.open()
    if is_ros1 and getattr(reader, "chunks", None):
        for place, chunk in reader.chunks.items():
            expanded = partial(_expanded, chunk.decompressor, f"{path}: chunk at byte {place}")
            reader.chunks[place] = chunk._replace(decompressor=expanded)
    for storage in [] if is_ros1 else getattr(reader.storage, "storages", [reader.storage]):
        for chunk in getattr(storage, "chunks", ()):
            stated, held = chunk.uncompressed_size, chunk.compressed_size
            check_expansion(stated, held, f"{path}: chunk at byte {chunk.chunk_start_offset}")
    return reader


def _expanded(decompress: Any, label: str, data: bytes) -> bytes:
    """Return the uncompressed chunk; DataError if it grows beyond the limit of :func:`expand`."""
    if data.startswith(b"BZh"):
        return expand(bz2.BZ2Decompressor(), data, label, (OSError, ValueError, EOFError))
    if data.startswith(b"\x04\x22\x4d\x18"):
        import lz4.frame  # noqa: PLC0415 - an optional package

        return expand(lz4.frame.LZ4FrameDecompressor(), data, label, (RuntimeError, EOFError))
    whole: bytes = decompress(data)
    return whole


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn exceptions of the package for a damaged bag into a DataError."""
    try:
        yield
    except Adv2eError:
        raise
    except MemoryError as error:  # the package allocates what a record states
        raise DataError(f"{path}: a part states more than there is memory for: damaged") from error
    except Exception as error:
        if machine_complaint(error):
            raise
        why = str(error).strip().split("\n")[0] or type(error).__name__
        raise DataError(f"{path}: not a bag that can be read, or damaged: {why}") from error


_MESSAGE = 10_000  # events
_EVENTS_TOPIC, _IMAGES_TOPIC = "/dvs/events", "/dvs/image_raw"


class _BagWriter(Writer):
    """Base of the writers of both bags: messages in the order of time."""

    _is_cdr = False

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._request = request
        self._frames = stack.enter_context(closing(Backlog(path.parent)))
        self._pieces = Pieces(_MESSAGE, EVENT_DTYPE)
        try:
            import rosbags  # noqa: F401, PLC0415 - an optional package
        except ImportError:
            raise MissingExtraError(f"{request.path}: a bag of ROS", "bag") from None
        self._bag = self._opened(path)
        stack.callback(self._abandon)
        types = self._types()
        self._topics = {
            name: self._bag.add_connection(name, kind, typestore=types)
            for name, kind in ((_EVENTS_TOPIC, EVENT_ARRAY), (_IMAGES_TOPIC, IMAGE))
            if request.with_frames or name == _EVENTS_TOPIC
        }

    def _opened(self, path: Path) -> Any:
        raise NotImplementedError

    def _types(self) -> Any:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

        types = get_typestore(Stores.ROS2_HUMBLE if self._is_cdr else Stores.ROS1_NOETIC)
        text = (
            EVENT_TEXT.replace("time ", "builtin_interfaces/Time ") if self._is_cdr else EVENT_TEXT
        )
        types.register(get_types_from_msg(text, "dvs_msgs/msg/Event"))
        types.register(get_types_from_msg(EVENT_ARRAY_TEXT, EVENT_ARRAY))
        return types

    def write_events(self, events: Events) -> None:
        """Append events."""
        for piece in self._pieces.add(events):
            self._write_piece(piece)

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        self._frames.append(t_ns, eight_bit(image))

    def finish(self) -> None:
        """Write the remaining events and frames, and close the bag."""
        self._write_piece(self._pieces.take())
        while len(self._frames):
            self._write_frame()
        bag, self._bag = self._bag, None
        bag.close()

    def _write_piece(self, held: Events) -> None:
        """Write events, and the frames among them."""
        while held.size and len(self._frames):
            cut = int(np.searchsorted(held["t"] * 1000, self._frames.time(0)))
            if cut == held.size:
                break
            self._write_events(held[:cut])
            self._write_frame()
            held = held[cut:]
        self._write_events(held)

    def _write_events(self, events: Events) -> None:
        if events.size:
            size = self._request.width, self._request.height
            data = event_array(events, size, self._is_cdr)
            self._bag.write(self._topics[_EVENTS_TOPIC], int(events["t"][-1]) * 1000, data)

    def _write_frame(self) -> None:
        t_ns = self._frames.time(0)
        data = image(self._frames.take(), t_ns, self._is_cdr)
        self._bag.write(self._topics[_IMAGES_TOPIC], t_ns, data)

    def _abandon(self) -> None:
        """Close the open files of a bag where writing failed."""
        raise NotImplementedError


class BagWriter(_BagWriter):
    """Writes a bag of ROS 1; its bytes follow from its content."""

    def _opened(self, path: Path) -> Any:
        from rosbags import rosbag1  # noqa: PLC0415 - an optional package

        bag = rosbag1.Writer(path)
        bag.open()
        return bag

    def _abandon(self) -> None:
        if self._bag is not None and self._bag.bio is not None:
            self._bag.bio.close()


class Ros2Writer(_BagWriter):
    """Writes a bag of ROS 2, a folder; its bytes follow from its content."""

    _is_cdr = True

    @staticmethod
    def stage(path: Path, staging: Staging) -> list[Path]:
        """Return the temporary name of the folder."""
        return [staging.folder(path, _foreign)]

    def _opened(self, path: Path) -> Any:
        from rosbags import rosbag2  # noqa: PLC0415 - an optional package

        path.mkdir()
        # the package calls the file as its folder, which has its final name when all is written
        self._folder = path / (self._request.path.name or "bag")
        plugin = rosbag2.StoragePlugin.MCAP
        bag = rosbag2.Writer(self._folder, version=8, storage_plugin=plugin)
        bag.open()
        return bag

    def finish(self) -> None:
        """Write the remaining events and frames, and close the bag."""
        self._bag.set_custom_data("adv2e", to_json(self._request.description))
        super().finish()
        for file in sorted(self._folder.iterdir()):
            file.rename(self._folder.parent / file.name)
        self._folder.rmdir()

    def _abandon(self) -> None:
        if self._bag is not None:
            self._bag.abort()


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that this layout, as written here, does not have."""
    ours = (f"{folder.name}.mcap", "metadata.yaml")
    return next((e.name for e in sorted(folder.iterdir()) if e.name not in ours), None)
