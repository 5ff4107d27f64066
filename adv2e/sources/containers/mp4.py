"""Headers of MP4 and MOV files.

References
----------
.. [1] ISO/IEC 14496-12, ISO base media file format (MP4, MOV): boxes, ``mvhd``, ``tkhd``.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator

from adv2e.sources.containers.base import Container, DamagedError, cut_short
from adv2e.sources.times import NS_PER_S


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


def examine(data: mmap.mmap) -> Container:
    """Return what the index says; DamagedError if it is missing or a box ends after the file."""
    top = list(_boxes(data, 0, len(data)))
    if top[-1][2] > len(data):
        raise cut_short(top[-1][2], len(data))
    index = [(start, stop) for kind, start, stop in top if kind == b"moov"]
    if not index:
        raise DamagedError("cut short or never finished: its index ('moov') is missing")
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
