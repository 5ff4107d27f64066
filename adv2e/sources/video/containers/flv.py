"""Structure of Flash video: tags one after another, each followed by its size.

References
----------
.. [1] Adobe, "Flash Video File Format Specification", version 10.1, annex E.
"""

from __future__ import annotations

import mmap
import struct

from adv2e.sources.video.containers.base import Container, chained, cut_short

MAGIC = b"FLV"
_AUDIO, _VIDEO, _SCRIPT = 8, 9, 18
_NOTHING_SHOWN, _AVC, _PICTURES = 5, 7, 1
_FILE_SIZE = b"filesize\0"


def examine(data: mmap.mmap) -> Container:
    """Return how many pictures there are; DamagedError if the tags do not follow one another."""
    (start,) = struct.unpack_from(">I", data, 5)
    pictures: int | None = 0
    for number, (place, end) in enumerate(chained(data, start + 4, _size)):
        kind, body = data[place] & 0x1F, place + 11
        if kind == _SCRIPT and number == 0:
            _check_size(data, place, end)
        if kind == _VIDEO and end > body + 6 and pictures is not None:
            first = data[body]
            if first & 0x80:  # the layout of enhanced RTMP
                pictures = None
            elif first >> 4 != _NOTHING_SHOWN:
                pictures += first & 15 != _AVC or data[body + 1] == _PICTURES
    return Container(pictures=pictures)


def _size(data: mmap.mmap, place: int) -> int:
    length = int.from_bytes(data[place + 1 : place + 4], "big")
    if data[place] & 0xDF not in (_AUDIO, _VIDEO, _SCRIPT) or data[place + 10] + data[place + 9]:
        return 0
    return 11 + length + 4


def _check_size(data: mmap.mmap, place: int, end: int) -> None:
    found = data.find(_FILE_SIZE, place, end)
    if found >= 0:
        (stated,) = struct.unpack_from(">d", data, found + len(_FILE_SIZE))
        if stated > len(data):
            raise cut_short(int(min(stated, 2.0**62)), len(data))
