"""Bags of ROS 1 (``.bag``) and ROS 2 (a folder with metadata.yaml, ``.mcap`` or ``.db3``).

What messages are read: :mod:`adv2e.formats.bag.messages`.  The container is read by the package
``rosbags``, the messages here: it would make an object of each event.  Events have their own times,
frames that of their header, both on the clock of ROS.

Of several topics with events, the first is taken, those named right last; of several with images,
one of the same camera, ``image_raw`` first; unless the user names one.

References
----------
.. [1] "Bag format 2.0", https://wiki.ros.org/Bags/Format/2.0; "MCAP", https://mcap.dev/spec.
.. [2] rosbags, https://gitlab.com/ternaris/rosbags.
"""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from adv2e.errors import Adv2eError, DataError, MissingExtraError
from adv2e.files.expansion import check_expansion, expand
from adv2e.formats.bag.messages import (
    COMPRESSED,
    EVENT_ARRAY,
    IMAGE,
    EventMessage,
    PacketReader,
    read_compressed,
    read_event_array,
    read_image,
    read_stamp,
)
from adv2e.formats.clock import shots_in_order
from adv2e.formats.event_file import MOST_COLUMNS, Columns, EventFile, Facts
from adv2e.process.machine import machine_complaint
from adv2e.sources.frame import Pixels, Shot
from adv2e.sources.tracks import Track, counted
from adv2e.ticks import check_time, check_us

_PACKETS = "event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray"
_EVENTS = EVENT_ARRAY, "prophesee_event_msgs/msg/EventArray", *_PACKETS
_IMAGES = {IMAGE: read_image, COMPRESSED: read_compressed}
_GATHERED = 1 << 20  # events yielded at once, or some more


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
    facts.stated_unit = "us"
    if bag.settings:
        facts.describe(bag.settings, f"{path}: adv2e", "the file")
        facts.stated_unit = "us"
    first = next(bag.events(), None)
    if first is not None:
        facts.state(_size(first.size), "its first message of events")
    elif bag.images is not None and bag.images.count:
        height, width = bag.pixels(0, f"{path}: the first image").image.shape[:2]
        facts.state((width, height), "its first image")

    def parts() -> Iterator[Columns]:
        held: list[Columns] = []
        total = bag.events_count
        for number, message in enumerate(bag.events(), 1):
            held.append(message.columns)
            if sum(columns[0].size for columns in held) >= _GATHERED:
                yield _joined(held)
                held = []
                facts.progress(number, max(number, total))
        if held:
            yield _joined(held)
        facts.progress(max(total, 1), max(total, 1))

    shots = partial(_shots, bag, facts) if bag.images is not None and bag.images.count else None
    return EventFile("bag" if bag.is_ros1 else "ros2", facts, parts, shots)


def _size(size: tuple[int, int]) -> tuple[int, int] | None:
    return size if min(size) > 0 and max(size) <= MOST_COLUMNS else None


def _joined(held: list[Columns]) -> Columns:
    t, x, y, p = (np.concatenate(columns) for columns in zip(*held, strict=True))
    return t, x, y, p


def _shots(bag: _Bag, facts: Facts) -> Iterator[Shot]:
    shots = [
        Shot(t_ns, label, partial(bag.pixels, number, label))
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
    """Return the topics of the connections that the package found."""
    found: dict[tuple[str, str], list[Any]] = {}
    for connection in connections:
        found.setdefault((connection.topic, connection.msgtype), []).append(connection)
    return [_Topic(*key, held, sum(c.msgcount for c in held)) for key, held in found.items()]


class _Bag:
    """A bag that stays open as long as its frames may be loaded.

    Attributes
    ----------
    is_ros1 : bool
    settings : str
        What this program wrote inside, if it did.
    events_count : int
        Messages of events.
    images : _Topic or None
        The topic of the frames.
    """

    def __init__(self, path: Path, facts: Facts) -> None:
        self._path, self._reader, self._problems = path, None, facts.problems
        self.is_ros1 = path.suffix.lower() == ".bag"
        with _reading(path):
            self._reader = _opened(path, self.is_ros1)
            topics = _topics(self._reader.connections)
            about = None if self.is_ros1 else self._reader.storage.metadata
            self.settings = str((getattr(about, "custom", None) or {}).get("adv2e", ""))
        topics.sort(key=lambda t: ("trigger" in t.name, "right" in t.name, t.name))
        events, images = ([t for t in topics if t.holds in kind] for kind in (_EVENTS, _IMAGES))
        event, image = facts.choose([t.track for t in events], [t.track for t in images])
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
        packets = PacketReader(self._problems) if self._events.holds in _PACKETS else None
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
            t_ns = read_stamp(data, not self.is_ros1, label)
            check_time(t_ns, label)
            yield t_ns, label

    def pixels(self, number: int, label: str) -> Pixels:
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
