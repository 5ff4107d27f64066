"""How large a picture its file says it is, before a decoder makes room for it.

Decoders make the room first and fill it with whatever comes: a JPEG of 600 bytes became 2.7 GB.  A
picture of one colour packs well, so that a small file may hold a large one; up to the size of the
largest sensors it is let be.

References
----------
.. [1] W3C, "Portable Network Graphics (PNG) Specification", IHDR.
.. [2] ITU-T T.81 (JPEG), frame header.
.. [3] TIFF Revision 6.0, Adobe, 1992; libtiff, "The BigTIFF file format".
.. [4] Google, "WebP Container Specification" and "Specification for WebP Lossless Bitstream".
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from adv2e.errors import DataError

FREE = 1 << 25
"""Pixels of a picture that its file may hold in as few bytes as it likes: 8192x4096."""

MOST = 100
"""Pixels that one byte may stand for, of a larger one."""


def check_claim(data: bytes, label: str) -> None:
    """Raise DataError if a file states a picture far larger than what it can hold.

    Parameters
    ----------
    data : bytes
        The file.  Formats whose decoders look first are not looked into.
    label : str
        Its name, for messages.
    """
    for begin, read in _READERS.items():
        if data.startswith(begin):
            try:
                width, height = read(data)
            except (struct.error, IndexError):
                return  # the decoder will not get far either
            if width * height > max(FREE, MOST * len(data)):
                raise DataError(
                    f"{label}: states {width}x{height} pixels in {len(data):,} bytes: damaged, or"
                    " made to fill the memory"
                )


def _png(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _jpeg(data: bytes) -> tuple[int, int]:
    at = 2
    while True:
        while data[at] == 0xFF:  # any number of them begins a marker
            at += 1
        marker = data[at]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 4)
            return width, height
        alone = marker in (0x00, 0x01) or 0xD0 <= marker <= 0xD9
        at += 1 if alone else 1 + struct.unpack_from(">H", data, at + 1)[0]
        at = data.find(b"\xff", at)
        if at < 0:
            raise IndexError


def _tiff(data: bytes) -> tuple[int, int]:
    order = "<" if data[:1] == b"I" else ">"
    big = struct.unpack_from(order + "H", data, 2)[0] == 43
    at = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)[0]
    count = struct.unpack_from(order + ("Q" if big else "H"), data, at)[0]
    first, size, value = (8, 20, 12) if big else (2, 12, 8)
    found = {256: 0, 257: 0}
    for n in range(min(count, 4096)):
        place = at + first + n * size
        tag, kind = struct.unpack_from(order + "HH", data, place)
        if tag in found and kind in (3, 4, 16):
            layout = order + {3: "H", 4: "I", 16: "Q"}[kind]
            found[tag] = struct.unpack_from(layout, data, place + value)[0]
    return found[256], found[257]


def _webp(data: bytes) -> tuple[int, int]:
    kind = data[12:16]
    if kind == b"VP8X":
        return 1 + int.from_bytes(data[24:27], "little"), 1 + int.from_bytes(data[27:30], "little")
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack_from("<HH", data, 26)
    return width & 0x3FFF, height & 0x3FFF


_READERS: dict[bytes, Callable[[bytes], tuple[int, int]]] = {
    b"\x89PNG": _png,
    b"\xff\xd8": _jpeg,
    b"II": _tiff,
    b"MM": _tiff,
    b"RIFF": _webp,
}
