"""Structure of MXF files: keys, lengths and values one after another.

References
----------
.. [1] SMPTE ST 377-1, "Material Exchange Format (MXF)": 6.3 (KLV coding), 7.1 (partition pack).
"""

from __future__ import annotations

import mmap
import struct

from adv2e.sources.video.containers.base import Container, chained, cut_short

MAGIC = bytes.fromhex("060e2b34")
_PARTITION = bytes.fromhex("060e2b34020501010d01020101")
_HEADER_BODY_FOOTER = (2, 3, 4)
_TICK_NS = 1000


def examine(data: mmap.mmap) -> Container:
    """Return that times are those of decoding; DamagedError if the parts do not fit each other."""
    for place, end in chained(data, 0, _size):
        if data[place : place + 13] == _PARTITION and data[place + 13] in _HEADER_BODY_FOOTER:
            (footer,) = struct.unpack_from(">Q", data, end - _length(data, place)[0] + 24)
            if footer >= len(data):
                raise cut_short(footer + 1, len(data))
    return Container(decoding_times=True, tick_ns=_TICK_NS)


def _length(data: mmap.mmap, place: int) -> tuple[int, int]:
    """Return the bytes of the value, and those of the number that says so."""
    first = data[place + 16]
    if first < 0x80:
        return first, 1
    digits = first & 0x7F
    return int.from_bytes(data[place + 17 : place + 17 + digits], "big"), 1 + digits


def _size(data: mmap.mmap, place: int) -> int:
    if data[place : place + 4] != MAGIC:
        return 0
    value, number = _length(data, place)
    return 16 + number + value
