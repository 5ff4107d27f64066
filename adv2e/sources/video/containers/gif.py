"""Structure of GIF files: blocks one after another, an image in some.

References
----------
.. [1] CompuServe, "Graphics Interchange Format, Version 89a", 1990.
"""

from __future__ import annotations

import mmap

from adv2e.sources.video.containers.base import Container, chained

MAGIC = b"GIF8"
_EXTENSION, _IMAGE, _TRAILER = 0x21, 0x2C, 0x3B
_MORE = "bytes follow its end mark: it may be damaged there"
_NO_END = "it has no end mark: it may be cut short"


def examine(data: mmap.mmap) -> Container:
    """Return how many images there are; DamagedError if the blocks do not follow one another."""
    images = 0
    for place, end in chained(data, 13 + _table(data[10]), _size):
        if data[place] == _TRAILER:
            return Container(pictures=images, doubts=[_MORE] if end < len(data) else [])
        images += data[place] == _IMAGE
    return Container(pictures=images, doubts=[_NO_END])


def _table(flags: int) -> int:
    """Return the bytes of a colour table."""
    return 3 << ((flags & 7) + 1) if flags & 0x80 else 0


def _size(data: mmap.mmap, place: int) -> int:
    kind = data[place]
    if kind == _TRAILER:
        return 1
    if kind == _EXTENSION:
        end = place + 2
    elif kind == _IMAGE:
        end = place + 11 + _table(data[place + 9])
    else:
        return 0
    while data[end]:
        end += 1 + data[end]
    return end + 1 - place
