r"""AEDAT4 files: packets with events, frames and others, each a FlatBuffers table.

============ ========================================================================
first bytes  ``#!AER-DAT4.0\r\n``
header       size (uint32), table IOHE: compression, place of the data table, and XML that
             describes each stream by its number
packets      number of the stream, bytes (int32 each), then the table that the stream holds,
             compressed: EVTS (events), FRME (a frame), others (IMU, triggers)
data table   at the end, compressed: table FTAB, where each packet is and its times
============ ========================================================================

A table inside a packet stands behind its own size (uint32).  All numbers are little-endian, times
are microseconds of the camera's clock, mostly since 1970.

Why no library is used: dv-processing hangs and aborts on damaged files, takes its events one by one
from Python, and is 100 MB on macOS; aedat only reads.

A stream is called as its camera and its output: of several, DV takes the output ``events`` and so
does this.  A recording that was interrupted states no data table; its last packet may be cut, which
is told and left out.

Packets that are written hold 10,000 events, as those of cameras do, or a frame of 8 bits, which
lies before the first packet whose events begin at its time or later.  They are compressed with LZ4
where the optional package is installed; without it they are not compressed, which every reader
takes, too.  The configuration is an attribute of the stream of events.

References
----------
.. [1] iniVation, "AEDAT 4.0", https://docs.inivation.com/software/software-advanced-usage/
   file-formats/aedat-4.0.html; schemas of dv-processing: include/dv-processing/data.
.. [2] Google, "FlatBuffers internals", https://flatbuffers.dev/internals/.
"""

from __future__ import annotations

import copy
import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError, MissingExtraError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.files.regular import expand
from adv2e.formats.clock import shots_in_order
from adv2e.formats.columns import named_geometry
from adv2e.formats.event_file import Columns, EventFile, Facts, joined
from adv2e.formats.writing import Pieces, Request, Writer, to_line
from adv2e.label import left_out
from adv2e.light.pictures import eight_bit
from adv2e.sources.frame import Frame, Shot, Track, counted
from adv2e.ticks import US, check_time, check_us

MAGIC = b"#!AER-DAT4.0\r\n"
EVENT = np.dtype({
    "names": ["t", "x", "y", "p"], "formats": ["<i8", "<i2", "<i2", "u1"],
    "offsets": [0, 8, 10, 12], "itemsize": 16,
})  # fmt: skip
"""An event, as a packet holds it."""

NONE, LZ4 = 0, 1
_LZ4, _ZSTD = (1, 2), (3, 4)
"""Compressions, of two strengths each."""


class Table:
    """A table of FlatBuffers, whose fields are read by number.

    Parameters
    ----------
    data : bytes
    identifier : bytes
        Four letters by which it is known.
    label : str
        What it is called, for messages.

    Raises
    ------
    DataError
        From any method: it is damaged, or not of that kind.
    """

    def __init__(self, data: bytes, identifier: bytes, label: str) -> None:
        self._data, self._label = data, label
        if data[4:8] != identifier:
            raise DataError(f"{label}: holds no {identifier.decode()}: damaged")
        self._enter(self._number("<I", 0))

    def _enter(self, at: int) -> None:
        self._at = at
        self._fields = self._at - self._number("<i", self._at)
        self._size = self._number("<H", self._fields)

    def _number(self, kind: str, at: int) -> int:
        try:
            if at < 0:
                raise struct.error
            number: int = struct.unpack_from(kind, self._data, at)[0]
        except struct.error:
            raise DataError(f"{self._label}: damaged, or cut short") from None
        return number

    def _place(self, field: int) -> int:
        """Return the offset of a field; 0: the table does not have it."""
        entry = 4 + 2 * field
        offset = self._number("<H", self._fields + entry) if entry < self._size else 0
        return self._at + offset if offset else 0

    def number(self, field: int, kind: str, default: int = 0) -> int:
        """Return a number, of a kind that :mod:`struct` knows."""
        place = self._place(field)
        return self._number(kind, place) if place else default

    def array(self, field: int, dtype: Any) -> Any:
        """Return a vector as an array, or none of its elements where it is not there."""
        place = self._place(field)
        if not place:
            return np.empty(0, dtype)
        place += self._number("<I", place)
        count = self._number("<I", place)
        if place + 4 + count * np.dtype(dtype).itemsize > len(self._data):
            raise DataError(f"{self._label}: cut short: states {count:,} elements")
        return np.frombuffer(self._data, dtype, count, place + 4)

    def tables(self, field: int) -> Iterator[Table]:
        """Yield the tables of a vector of them."""
        place = self._place(field)
        place += self._number("<I", place) if place else 0
        for at, offset in enumerate(self.array(field, "<u4").tolist(), 1):
            table = copy.copy(self)
            table._enter(place + 4 * at + offset)
            yield table


def unpacked(data: bytes, compression: int, label: str) -> bytes:
    """Return the uncompressed content of a packet, without the size at its beginning.

    Raises
    ------
    DataError
        It is damaged, or compressed in an unknown way.
    MissingExtraError
        The package that uncompresses it is not installed.
    """
    if compression != NONE:
        reader, errors = _decompressor(compression, label)
        data = expand(reader, data, label, errors)
    (size,) = struct.unpack_from("<I", data) if len(data) >= 4 else (0,)
    if size != len(data) - 4:
        raise DataError(f"{label}: states {size:,} bytes and holds {max(0, len(data) - 4):,}")
    return data[4:]


def _decompressor(compression: int, label: str) -> tuple[Any, tuple[type[Exception], ...]]:
    """Return the decompressor for one packet, and its exceptions."""
    if compression in _LZ4:
        return lz4_frame(label).LZ4FrameDecompressor(), (RuntimeError, EOFError)
    if compression in _ZSTD:
        zstd = _zstd(label)
        return zstd.ZstdDecompressor(), (zstd.ZstdError, EOFError)
    raise DataError(f"{label}: compressed in a way that is not known, number {compression}")


def lz4_frame(label: str) -> Any:
    """Return the module ``lz4.frame``; MissingExtraError names `label`."""
    try:
        import lz4.frame  # noqa: PLC0415 - an optional package
    except ImportError:
        raise MissingExtraError(f"{label}: LZ4", "aedat4") from None
    return lz4.frame


def _zstd(label: str) -> Any:
    try:
        from compression import zstd  # noqa: PLC0415 - of Python 3.14
    except ImportError:
        try:
            from backports import zstd  # noqa: PLC0415 - an optional package
        except ImportError:
            raise MissingExtraError(f"{label}: Zstandard", "aedat4") from None
    return zstd


_MOST_HEADER = 1 << 24  # bytes
_EVENTS, _FRAME = "EVTS", "FRME"

_TYPES = {0: np.uint8, 2: np.uint16}
"""Depths of a frame, as OpenCV numbers them."""


@dataclass(frozen=True)
class _Stream:
    """Stream as the header describes it: number, type, source, output, size."""

    number: int
    holds: str
    source: str
    output: str
    size: tuple[int, int] | None
    description: str


@dataclass(frozen=True)
class _Head:
    """Header of a file; its packets lie from `begin` to `end` [bytes]."""

    compression: int
    begin: int
    end: int
    interrupted: bool
    streams: list[_Stream]


def open_aedat4(path: Path, facts: Facts) -> EventFile:
    """Open an AEDAT4 file.

    Raises
    ------
    DataError
        It is damaged, or holds neither events nor frames.
    MissingExtraError
        Its packets are compressed, and the package for it is not installed.
    """
    head = _head(path)
    events, frames = _chosen(path, head, facts)
    first = events or frames
    if first is None:
        kinds = ", ".join(stream.holds for stream in head.streams) or "nothing"
        raise DataError(f"{path}: holds neither events (EVTS) nor frames ({_FRAME}), but {kinds}")
    if first.description:
        facts.describe(first.description, f"{path}: adv2e", "the file")
    facts.state(first.size, "the header")
    facts.stated_unit = "us"
    others = [s for s in head.streams if s.holds not in (_EVENTS, _FRAME)]
    facts.uncarried += [f"{s.output or s.number} ({s.holds})" for s in others]
    shots = [] if frames is None else list(_shots(path, head, frames.number, facts))
    shots = shots_in_order(shots, facts, "frames are not in the order of time: sorted")

    def parts() -> Iterator[Columns]:
        if events is None:
            return
        with path.open("rb") as file:
            for begin, label, data in _packets(path, file, head, events.number, facts):
                table = Table(unpacked(data, head.compression, label), _EVENTS.encode(), label)
                part = table.array(0, EVENT)
                check_us(part["t"], label)
                yield part["t"], part["x"], part["y"], (part["p"] != 0).astype(np.uint8)
                facts.progress(begin, head.end)
            facts.progress(head.end, head.end)

    gathered = partial(joined, parts)
    return EventFile("aedat4", facts, gathered, (lambda: iter(shots)) if shots else None)


def _chosen(path: Path, head: _Head, facts: Facts) -> tuple[_Stream | None, _Stream | None]:
    """Return the streams of events and of frames that are read."""
    events, frames = ([s for s in head.streams if s.holds == kind] for kind in (_EVENTS, _FRAME))
    counts = _counts(path, head) if max(len(events), len(frames)) > 1 else Counter()

    def track(stream: _Stream, what: str) -> Track:
        count = counts[stream.number]
        return Track(
            "/".join(filter(None, (stream.source, stream.output))) or what,
            counted(count, what) if counts else "",
            is_usual=stream.output == what,
            is_empty=bool(counts) and not count,
        )

    event, frame = facts.choose(
        [track(stream, "events") for stream in events],
        [track(stream, "frames") for stream in frames],
    )
    return None if event is None else events[event], None if frame is None else frames[frame]


def _counts(path: Path, head: _Head) -> Counter[int]:
    """Return the number of elements of each stream by the data table; none if it is damaged."""
    counts: Counter[int] = Counter()
    label = f"{path}: its data table"
    try:
        with path.open("rb") as file:
            file.seek(head.end)
            data = unpacked(file.read(), head.compression, label)
        for packet in Table(data, b"FTAB", label).tables(0):
            counts[packet.number(1, "<i")] += packet.number(2, "<q")
    except DataError:
        return Counter()
    return counts


def _head(path: Path) -> _Head:
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        (length,) = struct.unpack("<I", file.read(4).ljust(4, b"\0"))
        if not 8 <= length <= min(_MOST_HEADER, size - file.tell()):
            raise DataError(f"{path}: the header states {length:,} bytes, which cannot be: damaged")
        data, begin = file.read(length), file.tell()
    table = Table(data, b"IOHE", f"{path}: the header")
    end = table.number(1, "<q", -1)
    interrupted = end <= 0
    if interrupted:
        end = size
    elif not begin <= end <= size:
        raise DataError(
            f"{path}: states its data table at byte {end:,}, and has {size:,}: damaged, or cut"
            " short"
        )
    text = table.array(2, np.uint8).tobytes()
    return _Head(table.number(0, "<i", NONE), begin, end, interrupted, list(_streams(path, text)))


def _streams(path: Path, text: bytes) -> Iterator[_Stream]:
    """Yield the streams that the XML in the header describes."""
    if b"<!" in text:  # entities may grow without end
        raise DataError(f"{path}: the description of its streams declares things: damaged")
    try:
        root = ElementTree.fromstring(text)
        for node in root.iterfind("./node[@name='outInfo']/node"):
            attributes = {attr.get("key"): attr.text or "" for attr in node.iter("attr")}
            pairs = (("width", "sizeX"), ("height", "sizeY"))
            sides = {side: int(attributes[key]) for side, key in pairs if key in attributes}
            yield _Stream(
                int(node.get("name", "")),
                attributes.get("typeIdentifier", ""),
                attributes.get("source", ""),
                attributes.get("originalOutputName", ""),
                named_geometry(sides)[1],
                attributes.get("adv2e", ""),
            )
    except (ElementTree.ParseError, ValueError) as error:
        raise DataError(f"{path}: the description of its streams is damaged: {error}") from error


def _packets(
    path: Path, file: IO[bytes], head: _Head, wanted: int, facts: Facts
) -> Iterator[tuple[int, str, bytes]]:
    """Yield place, name and content of the packets of a stream, in the order of the file."""
    known = {stream.number for stream in head.streams}
    at = head.begin
    while at < head.end:
        file.seek(at)
        label = f"{path}: packet at byte {at}"
        start = file.read(8)
        number, size = struct.unpack("<ii", start) if len(start) == 8 else (0, 0)
        if at + 8 > head.end or len(start) < 8 or (size >= 0 and at + 8 + size > head.end):
            if head.interrupted:
                told = "the recording was interrupted: its last packet is cut, left out"
                facts.tell(left_out(told))
                return
            raise DataError(f"{label}: states {size:,} bytes, more than there are: damaged")
        if number not in known or size < 0:
            raise DataError(f"{label}: is of stream {number} and {size} bytes long: damaged")
        if number == wanted:
            yield at, label, file.read(size)
        at += 8 + size


def _shots(path: Path, head: _Head, number: int, facts: Facts) -> Iterator[Shot]:
    with path.open("rb") as file:
        for begin, label, data in _packets(path, file, head, number, facts):
            t_us = _frame(head, label, data).number(0, "<q")
            check_time(t_us * US, label)
            yield Shot(t_us * US, label, partial(_load, path, head, begin, label, len(data)))


def _frame(head: _Head, label: str, data: bytes) -> Table:
    return Table(unpacked(data, head.compression, label), _FRAME.encode(), label)


def _load(path: Path, head: _Head, begin: int, label: str, size: int) -> Frame:
    with path.open("rb") as file:
        file.seek(begin + 8)
        frame = _frame(head, label, file.read(size))
    kind, width, height = frame.number(5, "<b"), frame.number(6, "<h"), frame.number(7, "<h")
    dtype, channels = _TYPES.get(kind % 8), kind // 8 + 1
    pixels = frame.array(10, np.uint8)
    if kind < 0 or dtype is None or channels not in (1, 3, 4):
        raise DataError(f"{label}: a frame of format {kind}, which is not known")
    nbytes = width * height * channels * np.dtype(dtype).itemsize
    if min(width, height) < 1 or nbytes != pixels.size:
        raise DataError(f"{label}: a frame of {width}x{height} in {pixels.size:,} bytes: damaged")
    image = pixels.view(dtype).reshape(height, width, channels)
    return Frame(np.ascontiguousarray(image[..., 0] if channels == 1 else image[..., 2::-1]))


_PACKET = 10_000  # events
_EVENT_STREAM, _FRAME_STREAM = 0, 1  # their numbers
_GREY, _BGR = 0, 16
"""Kinds of frames, as OpenCV numbers them."""

_DEFINITION = np.dtype([
    ("fields", "<i4"), ("stream", "<i4"), ("size", "<i4"), ("", "<i4"),
    ("begin", "<i8"), ("count", "<i8"), ("first", "<i8"), ("last", "<i8"),
])  # fmt: skip
"""A row of the data table, as FlatBuffers lays it out with the fields that _ROW says."""
_ROW = struct.pack("<7H", 14, 48, 16, 4, 24, 32, 40)


class Aedat4Writer(Writer):
    """Writes an AEDAT4 file; its bytes follow from its content."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._request = request
        try:
            self._lz4 = lz4_frame("")
        except MissingExtraError:
            self._lz4 = None
        self._file = stack.enter_context(path.open("wb"))
        self._text = "".join(self._xml()).encode("ascii")
        self._file.write(MAGIC + self._header(0))
        self._frames = stack.enter_context(closing(Backlog(path.parent)))
        self._pieces = Pieces(_PACKET, EVENT_DTYPE)
        self._rows: list[tuple[int, ...]] = []  # of the data table, without the first field

    def write_events(self, events: Events) -> None:
        """Append events."""
        for piece in self._pieces.add(events):
            self._write_packet(piece)

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        self._frames.append((t_ns + 500) // 1000, eight_bit(image))

    def finish(self) -> None:
        """Write the remaining events and frames, and the data table."""
        if (rest := self._pieces.take()).size:
            self._write_packet(rest)
        self._write_frames(None)
        end = self._file.tell()
        self._file.write(self._packed(_data_table(self._rows)))
        self._file.seek(len(MAGIC))
        self._file.write(self._header(end))

    def _write_packet(self, held: Events) -> None:
        self._write_frames(int(held["t"][0]))
        packet = np.zeros(held.size, EVENT)
        for name in ("t", "x", "y", "p"):
            packet[name] = held[name]
        # 28 bytes: table of one field, which is a vector of events behind it
        table = struct.pack("<I4s2x3H", 16, b"EVTS", 6, 8, 4)
        table += struct.pack("<iII", 6, 4, held.size) + packet.tobytes()
        first, last = int(held["t"][0]), int(held["t"][-1])
        self._write(_EVENT_STREAM, table, (held.size, first, last))

    def _write_frames(self, until_us: int | None) -> None:
        while len(self._frames) and (until_us is None or self._frames.time(0) <= until_us):
            t_us = self._frames.time(0)
            image = self._frames.take()
            pixels = image[..., ::-1] if image.ndim == 3 else image
            kind = _BGR if image.ndim == 3 else _GREY
            fields = struct.pack(
                "<I4s13H2x", 36, b"FRME", *(26, 24, 8), *(0,) * 4, 20, 16, 18, *(0, 0, 4)
            )
            table = struct.pack("<iIqhhb3x", 28, 20, t_us, image.shape[1], image.shape[0], kind)
            vector = struct.pack("<I", pixels.size) + pixels.tobytes()
            self._write(_FRAME_STREAM, fields + table + vector, (1, t_us, t_us))

    def _write(self, stream: int, table: bytes, told: tuple[int, int, int]) -> None:
        data = self._packed(table)
        self._rows.append((stream, len(data), self._file.tell() + 8, *told))
        self._file.write(struct.pack("<ii", stream, len(data)) + data)

    def _packed(self, table: bytes) -> bytes:
        data = struct.pack("<I", len(table)) + table
        if self._lz4 is None:
            return data
        packed: bytes = self._lz4.compress(data, store_size=False)
        return packed

    def _header(self, table_at: int) -> bytes:
        """Return the header, whose length does not depend on where the data table is."""
        compression = NONE if self._lz4 is None else LZ4
        fields = struct.pack("<I4s5H2x", 20, b"IOHE", 10, 24, 4, 8, 16)
        table = struct.pack("<iiqI4x", 12, compression, table_at, 8)
        data = fields + table + struct.pack("<I", len(self._text)) + self._text + b"\0"
        return struct.pack("<I", len(data)) + data

    def _xml(self) -> Iterator[str]:
        streams = [("events", "EVTS"), ("frames", "FRME")][: 1 + self._request.with_frames]
        compression = "NONE" if self._lz4 is None else "LZ4"
        about = to_line(self._request.description)
        yield '<dv version="2.0"><node name="outInfo" path="/outInfo/">'
        for number, (name, kind) in enumerate(streams):
            path = f"/outInfo/{number}/"
            yield f'<node name="{number}" path="{path}">'
            for key, text in (
                *(("compression", compression), ("originalModuleName", "adv2e")),
                *(("originalOutputName", name), ("typeDescription", name)),
                ("typeIdentifier", kind),
            ):
                yield f'<attr key="{key}" type="string">{text}</attr>'
            yield f'<node name="info" path="{path}info/">'
            yield f'<attr key="sizeX" type="int">{self._request.width}</attr>'
            yield f'<attr key="sizeY" type="int">{self._request.height}</attr>'
            yield '<attr key="source" type="string">adv2e</attr>'
            if number == _EVENT_STREAM:
                yield f'<attr key="adv2e" type="string">{about}</attr>'
            yield "</node></node>"
        yield "</node></dv>\n"


def _data_table(rows: list[tuple[int, ...]]) -> bytes:
    """Return the table that says where each packet is."""
    count = len(rows)
    # a table of one field, a vector of the places of the rows; then the fields of rows, then rows
    head = struct.pack("<I4s2x3H", 16, b"FTAB", 6, 8, 4) + struct.pack("<iII", 6, 4, count)
    fields_at = len(head) + 4 * count
    begin = fields_at + len(_ROW)
    begin += -(begin + 4 + 16) % 8  # that numbers of 64 bits are aligned
    places = begin + _DEFINITION.itemsize * np.arange(count)
    table = np.zeros(count, _DEFINITION)
    table["fields"] = places - fields_at
    for column, name in enumerate(("stream", "size", "begin", "count", "first", "last")):
        table[name] = [row[column] for row in rows]
    offsets = (places - (len(head) + 4 * np.arange(count))).astype("<u4")
    padding = bytes(begin - fields_at - len(_ROW))
    return head + offsets.tobytes() + _ROW + padding + table.tobytes()
