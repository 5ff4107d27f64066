"""What a video file says of itself: whether all of it is there, and when its pictures end.

FFmpeg decodes a file that was cut short without complaint, up to the cut.  The sizes written in
the file tell beforehand.  Only headers are read here, never pictures.

References
----------
.. [1] ISO/IEC 14496-12, ISO base media file format (MP4, MOV): boxes, ``mvhd``, ``tkhd``.
.. [2] RFC 8794 (EBML) and RFC 9559 (Matroska, WebM): elements, clusters, blocks.
.. [3] OpenDML AVI file format extensions 1.02: one or more RIFF lists a file.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.times import NS_PER_S


@dataclass(frozen=True)
class Container:
    """What the headers of a video file say.

    Attributes
    ----------
    stamps_ns : list of int or None
        Times of all pictures in the order they are shown [ns], where the file lists them
        cheaply (Matroska).
    tick_ns : int
        Step of those times [ns].
    end_ns : int or None
        When the last picture ends, from the first (MP4, Matroska) [ns].
    exact_count : bool
        The number of pictures that FFmpeg reports was read from the file, not estimated.
    """

    stamps_ns: list[int] | None = None
    tick_ns: int = 0
    end_ns: int | None = None
    exact_count: bool = False


def examine(path: Path) -> Container:
    """Return what the headers of a video file say; families other than three say nothing.

    Raises
    ------
    DataError
        If the file is empty, cut short, or its structure is broken.
    """
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise DataError(f"{path}: an empty file")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _examine(data)
    except _DamagedError as error:
        raise DataError(f"{path}: {error}") from error
    except (struct.error, IndexError) as error:
        raise DataError(f"{path}: its headers are damaged") from error
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error


class _DamagedError(Exception):
    """What is wrong with the structure of a file."""


def _examine(data: mmap.mmap) -> Container:
    if data[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
        return _examine_mp4(data)
    if data[:4] == b"RIFF" and data[8:12] == b"AVI ":
        return _examine_avi(data)
    if data[:4] == b"\x1a\x45\xdf\xa3":
        return _examine_matroska(data)
    return Container()


def _cut_short(needed: int, present: int) -> _DamagedError:
    return _DamagedError(
        f"cut short: it holds {present} bytes where at least {needed} belong; copy it again"
    )


# AVI


def _examine_avi(data: mmap.mmap) -> Container:
    start = 0
    while data[start : start + 4] == b"RIFF":
        (size,) = struct.unpack_from("<I", data, start + 4)
        if size in (0, 0xFFFFFFFF):  # never finished: nothing is stated
            return Container()
        end = start + 8 + size
        if end > len(data):
            raise _cut_short(end, len(data))
        start = end + size % 2
    return Container(exact_count=True)


# MP4, MOV


def _boxes(data: mmap.mmap, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, start and end of the contents of each box between two places."""
    while start + 8 <= end:
        size, kind = struct.unpack_from(">I4s", data, start)
        head = 8
        if size == 1 and start + 16 <= end:
            (size,) = struct.unpack_from(">Q", data, start + 8)
            head = 16
        if not kind.strip(b"\0") or (size < head and size != 0):
            return  # padding after the last box
        stop = start + size if size else end
        yield kind, start + head, stop
        start = stop


def _examine_mp4(data: mmap.mmap) -> Container:
    top = list(_boxes(data, 0, len(data)))
    if top[-1][2] > len(data):
        raise _cut_short(top[-1][2], len(data))
    index = [(start, stop) for kind, start, stop in top if kind == b"moov"]
    if not index:
        raise _DamagedError("cut short or never finished: its index ('moov') is missing")
    if any(kind == b"moof" for kind, _, _ in top):  # fragments: the index counts no pictures
        return Container()
    return Container(end_ns=_mp4_end_ns(data, *index[0]), exact_count=True)


def _mp4_end_ns(data: mmap.mmap, start: int, stop: int) -> int | None:
    timescale = 0
    for kind, begin, end in _boxes(data, start, stop):
        if kind == b"mvhd":
            wide = data[begin] == 1
            (timescale,) = struct.unpack_from(">I", data, begin + (20 if wide else 12))
        elif kind == b"trak":
            for inner, head, tail in _boxes(data, begin, end):
                if inner != b"tkhd" or not any(data[tail - 8 : tail]):
                    continue  # only a track with pictures has a width and a height
                layout, offset = (">Q", 28) if data[head] == 1 else (">I", 20)
                (duration,) = struct.unpack_from(layout, data, head + offset)
                return duration * NS_PER_S // timescale if timescale and duration else None
    return None


# Matroska, WebM

_SEGMENT, _INFO, _TIMESTAMP_SCALE = 0x18538067, 0x1549A966, 0x2AD7B1
_TRACKS, _TRACK_ENTRY, _TRACK_NUMBER, _TRACK_TYPE = 0x1654AE6B, 0xAE, 0xD7, 0x83
_CLUSTER, _TIMESTAMP, _SIMPLE_BLOCK, _BLOCK_GROUP, _BLOCK = 0x1F43B675, 0xE7, 0xA3, 0xA0, 0xA1
_MASTERS = (_SEGMENT, _INFO, _TRACKS, _TRACK_ENTRY, _CLUSTER, _BLOCK_GROUP)
_VIDEO, _INVISIBLE = 1, 0x08


def _examine_matroska(data: mmap.mmap) -> Container:
    scale_ns, number, video, cluster = 1_000_000, 0, None, 0
    ticks: list[int] = []
    for kind, start, stop in _elements(data):
        if kind == _TIMESTAMP_SCALE:
            scale_ns = _unsigned(data, start, stop)
        elif kind == _TRACK_NUMBER:
            number = _unsigned(data, start, stop)
        elif kind == _TRACK_TYPE and video is None and _unsigned(data, start, stop) == _VIDEO:
            video = number
        elif kind == _TIMESTAMP:
            cluster = _unsigned(data, start, stop)
        elif kind in (_SIMPLE_BLOCK, _BLOCK):
            track, after = _variable(data, start, keep_marker=False)
            relative, flags = struct.unpack_from(">hB", data, after)
            if track == video and not flags & _INVISIBLE:
                ticks.append(cluster + relative)
    stamps_ns = [tick * scale_ns for tick in sorted(ticks)]
    if not stamps_ns:
        return Container()
    return Container(stamps_ns, scale_ns, stamps_ns[-1] - stamps_ns[0], exact_count=True)


def _elements(data: mmap.mmap) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of the contents of every element, going into the masters."""
    place, ends = 0, [len(data)]
    while place < len(data):
        while place >= ends[-1]:
            ends.pop()
            if len(ends) == 1:
                return  # past the segment: anything may follow
        kind, after = _variable(data, place, keep_marker=True)
        size, start = _variable(data, after, keep_marker=False)
        unknown = size == (1 << 7 * (start - after)) - 1
        stop = ends[-1] if unknown else start + size
        if stop > ends[-1]:
            if ends[-1] == len(data):
                raise _cut_short(stop, len(data))
            raise _DamagedError(f"damaged at byte {place}: a part is larger than what holds it")
        yield kind, start, stop
        if kind not in _MASTERS:
            place = stop
            continue
        place = start
        if not unknown or kind == _SEGMENT:  # a streamed cluster ends where the next begins
            ends.append(stop)


def _variable(data: mmap.mmap, place: int, *, keep_marker: bool) -> tuple[int, int]:
    """Return a number of variable length and the place after it."""
    if place >= len(data):
        raise _cut_short(place + 1, len(data))
    first = data[place]
    if first == 0:
        raise _DamagedError(f"damaged at byte {place}")
    length = 9 - first.bit_length()
    value = int.from_bytes(data[place : place + length], "big")
    return value if keep_marker else value & ((1 << 7 * length) - 1), place + length


def _unsigned(data: mmap.mmap, start: int, stop: int) -> int:
    return int.from_bytes(data[start:stop], "big")
