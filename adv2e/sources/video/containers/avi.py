"""Headers and index of AVI files: the exact rate, and how many pictures there are.

References
----------
.. [1] Microsoft, AVI RIFF file reference: ``strh``, ``idx1``.
.. [2] OpenDML AVI file format extensions 1.02: several RIFF lists a file; ``indx``, ``ix##``.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from adv2e.sources.times.rates import FrameRate
from adv2e.sources.video.containers.base import Container, cut_short

_INDEX_OF_INDEXES = 0


def examine(data: mmap.mmap) -> Container:
    """Return what the headers say; DamagedError if a list ends after the file does."""
    start, ends = 0, []
    while data[start : start + 4] == b"RIFF":
        (size,) = struct.unpack_from("<I", data, start + 4)
        if size in (0, 0xFFFFFFFF):  # never finished: nothing is stated
            return Container()
        end = start + 8 + size
        if end > len(data):
            raise cut_short(end, len(data))
        ends.append((start + 12, end))
        start = end + size % 2
    if not ends:
        return Container()
    number, rate, indexes, length = 0, None, None, 0
    for kind, begin, stop in _chunks(data, *ends[0]):
        if kind == b"strl":
            header = {name: (a, b) for name, a, b in _chunks(data, begin, stop)}
            at = header.get(b"strh", (0, 0))[0]
            if at and data[at : at + 4] == b"vids":
                scale, hz, length = struct.unpack_from("<II4xI", data, at + 20)
                rate = Fraction(hz, scale) if scale and hz else None
                indexes = header.get(b"indx")
                break
            number += 1
    if rate is None:
        return Container()
    pictures = _counted(data, indexes) if indexes else None
    if pictures is None and len(ends) == 1:
        pictures = _listed(data, *ends[0], b"%02d" % number)
    end_ns = FrameRate(rate).time_ns(length) if length and pictures is None else None
    return Container(rate=rate, decoding_times=True, pictures=pictures, end_ns=end_ns)


def _chunks(data: mmap.mmap, start: int, stop: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, start and end of each chunk; of lists their own kind; goes into the headers."""
    while start + 8 <= stop:
        kind, size = struct.unpack_from("<4sI", data, start)
        begin, end = start + 8, min(start + 8 + size, stop)
        if kind == b"LIST":
            kind, begin = data[begin : begin + 4], begin + 4
        if kind == b"hdrl":
            yield from _chunks(data, begin, end)
        else:
            yield kind, begin, end
        start += 8 + size + size % 2


def _listed(data: mmap.mmap, start: int, stop: int, number: bytes) -> int | None:
    """Return how many chunks with something in them the old index lists for a stream."""
    for kind, begin, end in _chunks(data, start, stop):
        if kind == b"idx1":
            entry = np.dtype([("kind", "S4"), ("flags", "<u4"), ("place", "<u4"), ("size", "<u4")])
            table = np.frombuffer(data[begin : begin + (end - begin) // 16 * 16], entry)
            video = np.isin(table["kind"], [number + b"dc", number + b"db"])
            return int(np.count_nonzero(video & (table["size"] > 0)))
    return None


def _counted(data: mmap.mmap, span: tuple[int, int]) -> int | None:
    """Return how many chunks with something in them the indexes of a large file list."""
    words, _, kind, entries = struct.unpack_from("<HBBI", data, span[0])
    if kind != _INDEX_OF_INDEXES or words != 4 or span[0] + 24 + 16 * entries > span[1]:
        return None
    count = 0
    for n in range(entries):
        (place,) = struct.unpack_from("<Q", data, span[0] + 24 + 16 * n)
        wide, _, _, used = struct.unpack_from("<HBBI", data, place + 8)
        if wide not in (2, 3) or place + 32 + 4 * wide * used > len(data):
            return None
        table = np.frombuffer(data[place + 32 : place + 32 + 4 * wide * used], "<u4")
        count += int(np.count_nonzero(table.reshape(-1, wide)[:, 1] & 0x7FFFFFFF))
    return count
