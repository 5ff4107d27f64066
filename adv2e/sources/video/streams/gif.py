"""GIF: whether pixels can be transparent.

References
----------
.. [1] CompuServe, Graphics Interchange Format 89a: 18 (screen), 20 (image), 23 (graphic control).
"""

from __future__ import annotations

import struct

from adv2e.sources.video.streams.base import Findings

_SIGNATURE, _EXTENSION, _IMAGE = b"GIF8", 0x21, 0x2C
_CONTROL, _TO_BACKGROUND = 0xF9, 2


class Gif:
    """Parser of GIF.

    A transparent pixel of a later image shows the one before, which is opaque if the first image
    covers all with none, and none is taken back to the background.
    """

    def __init__(self) -> None:
        self._size: tuple[int, int] | None = None
        self._first = True

    def header(self, data: bytes, findings: Findings) -> None:
        """Nothing stands before the pictures."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read what stands before the numbers of one image."""
        place, holes = 0, False
        if data.startswith(_SIGNATURE):
            width, height, flags = struct.unpack_from("<HHB", data, 6)
            self._size = width, height
            place = 13 + (6 << (flags & 7) if flags & 0x80 else 0)
        while data[place] == _EXTENSION:
            if data[place + 1] == _CONTROL:
                flags = data[place + 3]
                holes = bool(flags & 1)
                findings.transparent |= flags >> 2 & 7 == _TO_BACKGROUND
            place += 2
            while data[place]:
                place += 1 + data[place]
            place += 1
        if data[place] == _IMAGE and self._first:
            self._first = False
            box = struct.unpack_from("<HHHH", data, place + 1)
            findings.transparent |= holes or box != (0, 0, *(self._size or ()))
