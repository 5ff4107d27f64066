"""Fragments of MP4 files: numbered, each with an index of its own samples.

References
----------
.. [1] ISO/IEC 14496-12, 8.8: ``moof``, ``mfhd``, ``traf``, ``tfhd``, ``trun``.
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
_MORE = "bytes follow its last box: fragments may be missing"


def count_pictures(data: mmap.mmap, boxes: Boxes, track: int | None, found: Container) -> None:
    """Note how many pictures the fragments list; DamagedError if one is missing or cut.

    Parameters
    ----------
    data : mmap
    boxes : callable
        Yields kind, start and end of the contents of each box between two places.
    track : int or None
        Number of the track with pictures; None where there are several.
    found : Container
        Where it is noted.
    """
    pictures, before, end = 0, None, 0
    for kind, start, stop in boxes(data, 0, len(data)):
        if kind not in _KINDS:
            break
        if stop > len(data):
            raise cut_short(stop, len(data))
        end = stop
        if kind == b"moof":
            number, count = _fragment(data, boxes, start, stop, track)
            if before is not None and number > before + 1:
                raise DamagedError(f"damaged before byte {start}: fragments are missing")
            before = number
            pictures += count
    if data.find(b"moof", end) >= 0:
        raise DamagedError(f"damaged at byte {end}")
    if end < len(data):
        found.doubts.append(_MORE)
    found.pictures = None if track is None else pictures


def _fragment(
    data: mmap.mmap, boxes: Boxes, start: int, stop: int, track: int | None
) -> tuple[int, int]:
    """Return the number of a fragment, and how many samples it has of a track."""
    number = pictures = 0
    end = start
    for kind, begin, end in boxes(data, start, stop):
        if kind == b"mfhd":
            (number,) = struct.unpack_from(">I", data, begin + 4)
        elif kind == b"traf":
            whose = None
            last = begin
            for inner, place, after in boxes(data, begin, end):
                last = after
                if inner == b"tfhd":
                    (whose,) = struct.unpack_from(">I", data, place + 4)
                elif inner == b"trun" and whose == track:
                    pictures += struct.unpack_from(">I", data, place + 4)[0]
            if last != end:
                raise DamagedError(f"damaged at byte {last}")
    if end != stop:
        raise DamagedError(f"damaged at byte {end}")
    return number, pictures
