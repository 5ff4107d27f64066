"""Structure of Ogg files: pages one after another, numbered and with a checksum each.

References
----------
.. [1] RFC 3533, "The Ogg Encapsulation Format Version 0", section 6.
"""

from __future__ import annotations

import mmap
import struct
import zlib

from adv2e.sources.video.containers.base import Container, DamagedError, chained

MAGIC = b"OggS"
_LAST = 4
_MIRRORED = bytes(int(f"{n:08b}"[::-1], 2) for n in range(256))
_NO_END = "its last page has no end mark: it may be cut short"


def examine(data: mmap.mmap) -> Container:
    """Return nothing but doubts; DamagedError if pages are missing or changed."""
    numbers: dict[int, int] = {}
    flags = _LAST
    for place, end in chained(data, 0, _size):
        flags, serial, number, stated = struct.unpack_from("<5xB8xIII", data, place)
        if number != numbers.get(serial, number - 1) + 1:
            raise DamagedError(f"damaged before byte {place}: pages are missing")
        numbers[serial] = number
        if _checksum(data[place : place + 22] + bytes(4) + data[place + 26 : end]) != stated:
            raise DamagedError(f"damaged between bytes {place} and {end}")
    return Container(whole=True, doubts=[] if flags & _LAST else [_NO_END])


def _size(data: mmap.mmap, place: int) -> int:
    if data[place : place + 4] != MAGIC:
        return 0
    segments = data[place + 26]
    return 27 + segments + sum(data[place + 27 : place + 27 + segments])


def _checksum(page: bytes) -> int:
    """Return the CRC of a page: that of zlib with all bits mirrored, from zero."""
    mirrored = zlib.crc32(page.translate(_MIRRORED), 0xFFFFFFFF) ^ 0xFFFFFFFF
    return int(f"{mirrored:032b}"[::-1], 2)
