"""Headers and index of AVI files: the exact rate, and how many pictures there are.

References
----------
.. [1] Microsoft, AVI RIFF file reference: ``strh``, ``idx1``.
.. [2] OpenDML AVI file format extensions 1.02: several RIFF lists a file.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from adv2e.sources.times.rates import FrameRate
from adv2e.sources.video.containers.base import Container, cut_short


def examine(data: mmap.mmap, found: Container) -> None:
    """Note what the headers say; DamagedError if a list ends after the file does."""
    start, ends = 0, []
    while data[start : start + 4] == b"RIFF":
        (size,) = struct.unpack_from("<I", data, start + 4)
        if size in (0, 0xFFFFFFFF):  # never finished: nothing is stated
            return
        end = start + 8 + size
        if end > len(data):
            raise cut_short(end, len(data))
        ends.append((start + 12, end))
        start = end + size % 2
    number = 0
    for kind, begin, stop in _chunks(data, *ends[0]):
        if kind == b"strl":
            header = {name: a for name, a, _ in _chunks(data, begin, stop)}
            at = header.get(b"strh", 0)
            if at and data[at : at + 4] == b"vids":
                scale, hz, length = struct.unpack_from("<II4xI", data, at + 20)
                if not scale or not hz:
                    return
                found.rate, found.decoding_times = Fraction(hz, scale), True
                if len(ends) == 1:
                    found.pictures = _listed(data, *ends[0], b"%02d" % number)
                if length and found.pictures is None:
                    found.end_ns = FrameRate(found.rate).time_ns(length)
                return
            number += 1


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
