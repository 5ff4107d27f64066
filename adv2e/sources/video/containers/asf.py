"""Headers of ASF files (WMV): their size, and packets of one size.

References
----------
.. [1] Microsoft, "Advanced Systems Format (ASF) Specification", 01.20.06: 3.2 (file properties),
   5.1 (data object), 5.2 (data packets).
"""

from __future__ import annotations

import mmap
import struct

import numpy as np

from adv2e.sources.video.containers.base import Container, DamagedError, cut_short

MAGIC = bytes.fromhex("3026b2758e66cf11a6d900aa0062ce6c")
_PROPERTIES = bytes.fromhex("a1dcab8c47a9cf118ee400c00c205365")
_STREAM = bytes.fromhex("9107dcb7b7a9cf118ee600c00c205365")
_DATA = bytes.fromhex("3626b2758e66cf11a6d900aa0062ce6c")
_TICK_NS = 1_000_000
_BROADCAST = 1


def examine(data: mmap.mmap) -> Container:
    """Return that times are those of decoding; DamagedError if packets are missing."""
    (head,) = struct.unpack_from("<Q", data, 16)
    found = data.find(_PROPERTIES, 30, min(head, len(data)))
    end_ns = None
    if found >= 0:
        layout = "<40xQ8xQQ8xQI4xI"
        size, packets, duration, early_ms, flags, bytes_each = struct.unpack_from(
            layout, data, found
        )
        if not flags & _BROADCAST:
            if size > len(data):
                raise cut_short(size, len(data))
            _check_packets(data, head, packets, bytes_each)
            if data[:head].count(_STREAM) == 1:  # else the sound may be longer
                end_ns = max(duration * 100 - early_ms * 1_000_000, 0)
    return Container(decoding_times=True, tick_ns=_TICK_NS, end_ns=end_ns)


def _check_packets(data: mmap.mmap, start: int, count: int, size: int) -> None:
    """Raise DamagedError unless all packets begin as the first does, with a byte of flags."""
    first = start + 50
    if data[start : start + 16] != _DATA or not size or first + count * size > len(data):
        raise DamagedError("its headers are damaged")
    begins = first + size * np.arange(count)
    wrong = [int(place) for place in begins if data[int(place)] != data[first]]
    if wrong:
        raise DamagedError(f"damaged at byte {wrong[0]}")
