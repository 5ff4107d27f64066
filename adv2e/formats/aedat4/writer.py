"""AEDAT4 files with events and, where they are asked for, frames.

What they are made of: :mod:`adv2e.formats.aedat4.packets`.  Packets hold 10,000 events, as those of
cameras do, or a frame of 8 bits, which lies before the first packet whose events begin at its time
or later.  They are compressed with LZ4 where the optional package is installed; without it they are
not compressed, which every reader takes, too.  The configuration is an attribute of the stream of
events.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import MissingExtraError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.formats.aedat4.packets import EVENT, LZ4, MAGIC, NONE, lz4_frame
from adv2e.formats.sink import Request, Writer
from adv2e.light.pictures import eight_bit

_PACKET = 10_000  # events
_EVENTS, _FRAMES = 0, 1  # numbers of the streams
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

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._request = request
        try:
            self._lz4 = lz4_frame("")
        except MissingExtraError:
            self._lz4 = None
        self._file = stack.enter_context(path.open("wb"))
        self._text = "".join(self._xml()).encode("ascii")
        self._file.write(MAGIC + self._header(0))
        self._frames = stack.enter_context(closing(Backlog(path.parent)))
        self._buffer = np.empty(_PACKET, EVENT_DTYPE)
        self._held = 0  # events in it
        self._rows: list[tuple[int, ...]] = []  # of the data table, without the first field

    def write_events(self, events: Events) -> None:
        """Append events."""
        while events.size:
            part, events = np.split(events, [_PACKET - self._held])
            self._buffer[self._held : self._held + part.size] = part
            self._held += part.size
            if self._held == _PACKET:
                self._write_packet()

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        self._frames.append((t_ns + 500) // 1000, eight_bit(image))

    def finish(self) -> None:
        """Write the remaining events and frames, and the data table."""
        if self._held:
            self._write_packet()
        self._write_frames(None)
        end = self._file.tell()
        self._file.write(self._packed(_data_table(self._rows)))
        self._file.seek(len(MAGIC))
        self._file.write(self._header(end))

    def _write_packet(self) -> None:
        held = self._buffer[: self._held]
        self._write_frames(int(held["t"][0]))
        packet = np.zeros(held.size, EVENT)
        for name in ("t", "x", "y", "p"):
            packet[name] = held[name]
        # 28 bytes: table of one field, which is a vector of events behind it
        table = struct.pack("<I4s2x3H", 16, b"EVTS", 6, 8, 4)
        table += struct.pack("<iII", 6, 4, held.size) + packet.tobytes()
        first, last = int(held["t"][0]), int(held["t"][-1])
        self._write(_EVENTS, table, (held.size, first, last))
        self._held = 0

    def _write_frames(self, until_us: int | None) -> None:
        """Write the frames up to a time, or all."""
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
            self._write(_FRAMES, fields + table + vector, (1, t_us, t_us))

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
        about = json.dumps(self._request.description, allow_nan=False)
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
            if number == _EVENTS:
                yield f'<attr key="adv2e" type="string">{escape(about)}</attr>'
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
