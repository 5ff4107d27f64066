"""Fragments of MP4 files: numbered, one after another.

References
----------
.. [1] ISO/IEC 14496-12, 8.8: ``moof``, ``mfhd``, ``traf``.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Iterator

from adv2e.sources.video.containers.base import Container, DamagedError, cut_short

Boxes = Callable[[mmap.mmap, int, int], Iterator[tuple[bytes, int, int]]]

_KINDS = frozenset(
    b"ftyp moov moof mdat sidx ssix styp mfra free skip emsg prft uuid udta meta wide pdin".split()
)


def check_fragments(data: mmap.mmap, boxes: Boxes, found: Container) -> None:
    """Doubt what follows the last one; DamagedError if one is missing or cut.

    `boxes` yields kind, start and end of the contents of each box between two places.
    """
    before, end = None, 0
    for kind, start, stop in boxes(data, 0, len(data)):
        if kind not in _KINDS:
            break
        if stop > len(data):
            raise cut_short(stop, len(data))
        end = stop
        if kind == b"moof":
            number = _number(data, boxes, start, stop)
            if before is not None and number > before + 1:
                raise DamagedError(f"damaged before byte {start}: fragments are missing")
            before = number
    if data.find(b"moof", end) >= 0:
        raise DamagedError(f"damaged at byte {end}")
    if end < len(data):
        found.doubts.append("bytes follow its last box: fragments may be missing")


def _number(data: mmap.mmap, boxes: Boxes, start: int, stop: int) -> int:
    """Return the number of a fragment, whose boxes fill it."""
    number, end = 0, start
    for kind, begin, end in boxes(data, start, stop):
        if kind == b"mfhd":
            (number,) = struct.unpack_from(">I", data, begin + 4)
        elif kind == b"traf":
            _number(data, boxes, begin, end)
    if end != stop:
        raise DamagedError(f"damaged at byte {end}")
    return number
