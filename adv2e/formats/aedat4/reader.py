"""Events and frames of AEDAT4 files; what they are made of: :mod:`adv2e.formats.aedat4.packets`.

A stream is called as its camera and its output: of several, DV takes the output ``events`` and so
does this.  A recording that was interrupted states no data table; its last packet may be cut, which
is told and left out.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO
from xml.etree import ElementTree

import numpy as np

from adv2e.errors import DataError
from adv2e.formats.aedat4.packets import EVENT, MAGIC, NONE, Table, unpacked
from adv2e.formats.clock import shots_in_order
from adv2e.formats.event_file import Columns, EventFile, Facts, described_geometry
from adv2e.sources.frame import Pixels, Shot
from adv2e.sources.tracks import Track, counted
from adv2e.ticks import US, check_time, check_us

_MOST_HEADER = 1 << 24  # bytes
_EVENTS, _FRAME = "EVTS", "FRME"
_GATHERED = 1 << 20  # events yielded at once, or some more

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
    shots = [] if frames is None else list(_shots(path, head, frames.number, facts))
    shots = shots_in_order(shots, facts, "frames are not in the order of time: sorted")

    def parts() -> Iterator[Columns]:
        if events is None:
            return
        with path.open("rb") as file:
            held: list[np.ndarray[tuple[int], np.dtype[np.void]]] = []
            for begin, label, data in _packets(path, file, head, events.number, facts):
                table = Table(unpacked(data, head.compression, label), _EVENTS.encode(), label)
                held.append(table.array(0, EVENT))
                check_us(held[-1]["t"], label)
                if sum(map(len, held)) >= _GATHERED:
                    yield _columns(held)
                    held = []
                    facts.progress(begin, head.end)
            if held:
                yield _columns(held)
            facts.progress(head.end, head.end)

    return EventFile("aedat4", facts, parts, (lambda: iter(shots)) if shots else None)


def _columns(held: list[np.ndarray[tuple[int], np.dtype[np.void]]]) -> Columns:
    t, x, y, p = (np.concatenate([part[name] for part in held]) for name in ("t", "x", "y", "p"))
    return t, x, y, (p != 0).astype(np.uint8)


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
            sides = {
                side: int(attributes[key])
                for side, key in (("width", "sizeX"), ("height", "sizeY"))
                if key in attributes
            }
            yield _Stream(
                int(node.get("name", "")),
                attributes.get("typeIdentifier", ""),
                attributes.get("source", ""),
                attributes.get("originalOutputName", ""),
                described_geometry(dict(sides)),
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
                problem = "the recording was interrupted: its last packet is cut, left out"
                if problem not in facts.problems:
                    facts.problems.append(problem)
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


def _load(path: Path, head: _Head, begin: int, label: str, size: int) -> Pixels:
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
    return Pixels(np.ascontiguousarray(image[..., 0] if channels == 1 else image[..., 2::-1]))
