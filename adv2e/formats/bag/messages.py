"""Messages of ROS, as ROS 1 packs them and as ROS 2 does (CDR), with arrays in place of objects.

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

References
----------
.. [1] github.com/uzh-rpg/rpg_dvs_ros: dvs_msgs/msg; github.com/ros-event-camera/event_camera_msgs.
.. [2] Object Management Group, "Common Object Request Broker Architecture", part 2, CDR, 2021.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.binary import DECODERS
from adv2e.formats.event_file import Columns
from adv2e.sources.frame import Pixels
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.times.rates import NS_PER_S

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
    data : bytes
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
        """Return so many bytes."""
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


def read_stamp(data: bytes, is_cdr: bool, label: str) -> int:
    """Return the time in the header of a message [ns]."""
    return _Cursor(data, is_cdr, label).stamp_ns()


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
    problems : list of str
        Is added what is to be told.
    """

    def __init__(self, problems: list[str]) -> None:
        self._problems = problems
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
            self._tell(f"{label}: {lost:,} packets before it are missing")
        return t + self._shift_us, x, y, p

    def end(self) -> None:
        """Report the problems of all packets."""
        for text in self._decoder.problems() if self._decoder is not None else ():
            self._tell(text)

    def _tell(self, text: str) -> None:
        if text not in self._problems:  # packets may be read more than once
            self._problems.append(text)


def _of_mono(words: NDArray[np.uint64], stamp_ns: int) -> Columns:
    t = (stamp_ns + (words & np.uint64(0xFFFFFFFF)).astype(np.int64) + 500) // 1000
    x = (words >> np.uint64(32) & np.uint64(0xFFFF)).astype(np.uint16)
    y = (words >> np.uint64(48) & np.uint64(0x7FFF)).astype(np.uint16)
    return t, x, y, (words >> np.uint64(63)).astype(np.uint8)


def read_image(data: bytes, is_cdr: bool, label: str) -> Pixels:
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
    return Pixels(np.ascontiguousarray(image[..., chosen]).astype(kind))


def read_compressed(data: bytes, is_cdr: bool, label: str) -> Pixels:
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
