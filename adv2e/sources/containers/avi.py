"""Headers of AVI files.

References
----------
.. [1] OpenDML AVI file format extensions 1.02: one or more RIFF lists a file.
"""

from __future__ import annotations

import mmap
import struct

from adv2e.sources.containers.base import Container, cut_short


def examine(data: mmap.mmap) -> Container:
    """Return what the headers say; DamagedError if a list ends after the file does."""
    start = 0
    while data[start : start + 4] == b"RIFF":
        (size,) = struct.unpack_from("<I", data, start + 4)
        if size in (0, 0xFFFFFFFF):  # never finished: nothing is stated
            return Container()
        end = start + 8 + size
        if end > len(data):
            raise cut_short(end, len(data))
        start = end + size % 2
    return Container(exact_count=True)
