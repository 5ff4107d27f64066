"""Headers of Matroska and WebM files: when each picture is shown, and colours.

References
----------
.. [1] RFC 8794 (EBML) and RFC 9559 (Matroska, WebM): elements, clusters, blocks.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from dataclasses import replace

from adv2e.sources.video.containers.base import TINY_BYTES, Container, DamagedError, cut_short

MAGIC = b"\x1a\x45\xdf\xa3"
_SEGMENT, _INFO, _TIMESTAMP_SCALE = 0x18538067, 0x1549A966, 0x2AD7B1
_TRACKS, _TRACK_ENTRY, _TRACK_NUMBER, _TRACK_TYPE = 0x1654AE6B, 0xAE, 0xD7, 0x83
_VIDEO, _INTERLACED, _ALPHA = 0xE0, 0x9A, 0x53C0
_COLOUR, _MATRIX, _TRANSFER, _PRIMARIES = 0x55B0, 0x55B1, 0x55BA, 0x55BB
_CLUSTER, _TIMESTAMP, _SIMPLE_BLOCK, _BLOCK_GROUP, _BLOCK = 0x1F43B675, 0xE7, 0xA3, 0xA0, 0xA1
_HEADS = (_SEGMENT, _INFO, _TRACKS, _TRACK_ENTRY, _VIDEO, _COLOUR)
_MASTERS = (*_HEADS, _CLUSTER, _BLOCK_GROUP)
_IS_VIDEO, _INVISIBLE = 1, 0x08


def examine(data: mmap.mmap, found: Container) -> None:
    """Note the times of all pictures; DamagedError if the elements do not fit each other."""
    found.readable = False
    scale_ns, number, video, cluster = 1_000_000, 0, None, 0
    ticks: list[int] = []
    tiny = 0
    for kind, start, stop in _elements(data):
        if kind == _TIMESTAMP_SCALE:
            scale_ns = _unsigned(data, start, stop)
        elif kind == _TRACK_NUMBER:
            number = _unsigned(data, start, stop)
        elif kind == _TRACK_TYPE and video is None and _unsigned(data, start, stop) == _IS_VIDEO:
            video = number
            found.readable = True
        elif kind == _TIMESTAMP:
            cluster = _unsigned(data, start, stop)
        elif kind in (_SIMPLE_BLOCK, _BLOCK):
            track, after = variable(data, start, keep_marker=False)
            relative, flags = struct.unpack_from(">hB", data, after)
            if track == video and not flags & _INVISIBLE:
                ticks.append(cluster + relative)
                tiny += stop - after - 3 <= TINY_BYTES
        elif number == video:
            _describe(kind, data[stop - 1], found)
    if not ticks:
        return
    found.stamps_ns, found.tick_ns = [tick * scale_ns for tick in sorted(ticks)], scale_ns
    found.leading, found.tiny = sum(tick < ticks[0] for tick in ticks), tiny


def _describe(kind: int, value: int, found: Container) -> None:
    """Note what an element says of the video's colours and fields."""
    if kind == _INTERLACED:
        found.interlaced = value == 1
    elif kind == _ALPHA:
        found.alpha_apart = value == 1
    elif kind == _PRIMARIES:
        found.colours = replace(found.colours, primaries=value)
    elif kind == _TRANSFER:
        found.colours = replace(found.colours, transfer=value)
    elif kind == _MATRIX:
        found.colours = replace(found.colours, matrix=value)


def _elements(data: mmap.mmap) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of the contents of every element, going into the masters."""
    place, ends = 0, [len(data)]
    while place < len(data):
        while place >= ends[-1]:
            ends.pop()
            if len(ends) == 1:
                return  # past the segment: anything may follow
        kind, after = variable(data, place, keep_marker=True)
        size, start = variable(data, after, keep_marker=False)
        unknown = size == (1 << 7 * (start - after)) - 1
        if unknown and kind not in (_SEGMENT, _CLUSTER):
            raise DamagedError(f"damaged at byte {place}")
        stop = ends[-1] if unknown else start + size
        if stop > ends[-1]:
            if ends[-1] == len(data):
                raise cut_short(stop, len(data))
            raise DamagedError(f"damaged at byte {place}: a part is larger than what holds it")
        yield kind, start, stop
        if kind not in _MASTERS:
            place = stop
            continue
        place = start
        if not unknown or kind == _SEGMENT:  # a streamed cluster ends where the next begins
            ends.append(stop)


def variable(data: mmap.mmap, place: int, *, keep_marker: bool) -> tuple[int, int]:
    """Return a number of variable length and the place after it."""
    if place >= len(data):
        raise cut_short(place + 1, len(data))
    first = data[place]
    if first == 0:
        raise DamagedError(f"damaged at byte {place}")
    length = 9 - first.bit_length()
    value = int.from_bytes(data[place : place + length], "big")
    return value if keep_marker else value & ((1 << 7 * length) - 1), place + length


def _unsigned(data: mmap.mmap, start: int, stop: int) -> int:
    return int.from_bytes(data[start:stop], "big")
