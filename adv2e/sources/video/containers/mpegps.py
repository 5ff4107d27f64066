"""Structure of MPEG program streams: packs and packets one after another.

References
----------
.. [1] ISO/IEC 13818-1, 2.5.3 (program stream) and 2.4.3.6 (PES packet); ISO/IEC 11172-1.
"""

from __future__ import annotations

import mmap

from adv2e.sources.video.containers.base import Container, chained

MAGIC = b"\x00\x00\x01\xba"
_SECTOR = 2048
_TICK_NS = 11_112  # of 90 kHz
_PACK, _END, _LEAST = 0xBA, 0xB9, 0xBB


def examine(data: mmap.mmap) -> Container:
    """Return that not all times are stated; DamagedError if packets do not follow one another."""
    for _ in chained(data, 0, _size, padding=_SECTOR):
        pass
    return Container(decoding_times=True, tick_ns=_TICK_NS)


def _size(data: mmap.mmap, place: int) -> int:
    start = place
    while data[place : place + 3] == b"\0\0\0" and place - start < 2048:
        place += 1  # stuffing
    if data[place : place + 3] != b"\0\0\1":
        return 0
    code, stuffed = data[place + 3], place - start
    if code == _END:
        return stuffed + 4
    if code == _PACK:
        newer = data[place + 4] >> 6 == 1
        return stuffed + (14 + (data[place + 13] & 7) if newer else 12)
    if code < _LEAST:
        return 0
    return stuffed + 6 + int.from_bytes(data[place + 4 : place + 6], "big")
