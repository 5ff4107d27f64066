"""What the headers of PNG, JPEG, WebP and BMP say that OpenCV does not tell.

References
----------
.. [1] W3C, "Portable Network Graphics (PNG) Specification, third edition".
.. [2] CIPA DC-008, "Exchangeable image file format (Exif)".
.. [3] Google, "WebP Container Specification".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from adv2e.sources.images import tiff
from adv2e.sources.images.alpha import Alpha

_GREY, _GREY_ALPHA = 0, 4
_EXIF = b"Exif\0\0"
_V3 = 56  # bytes of the first header of BMP that has a mask for alpha


@dataclass(frozen=True)
class Header:
    """What is to be known of an image beside its pixels.

    Attributes
    ----------
    orientation : int
        As Exif counts it, 1 to 8, of a picture that OpenCV leaves as it is stored.
    pictures : int
        How many are in the file.
    alpha : Alpha
        What a fourth channel is.
    grey : bool
        OpenCV repeats grey three times.
    clear : int, optional
        Grey value of pixels that are not there, in the bits that OpenCV returns.
    bits : int, optional
        How many bits of each number the camera gave.
    """

    orientation: int = 1
    pictures: int = 1
    alpha: Alpha = Alpha.STRAIGHT
    grey: bool = False
    clear: int | None = None
    bits: int | None = None


def read_header(data: bytes) -> Header:
    """Return what the bytes of a file say, as far as they can be read."""
    try:
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            return _png(data)
        if data.startswith(b"\xff\xd8"):
            return Header(orientation=_jpeg_orientation(data))
        if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
            return _webp(data)
        if data[:2] == b"BM":
            (size,) = struct.unpack_from("<I", data, 14)
            return Header(alpha=Alpha.STRAIGHT if size >= _V3 else Alpha.NONE)
    except (struct.error, IndexError):  # cut short: OpenCV will say so
        pass
    return Header()


def _png(data: bytes) -> Header:
    depth, colours = data[24], data[25]
    pictures, orientation, clear, bits = 1, 1, None, None
    for kind, content in _png_chunks(data):
        if kind == b"acTL":
            (pictures,) = struct.unpack_from(">I", content)
        elif kind == b"eXIf":
            orientation = tiff.orientation(content.removeprefix(_EXIF))
        elif kind == b"tRNS" and colours == _GREY:
            (clear,) = struct.unpack_from(">H", content)
            clear *= 255 // ((1 << depth) - 1) if depth < 8 else 1
        elif kind == b"sBIT" and depth == 16:
            bits = max(content[:1] if colours in (_GREY, _GREY_ALPHA) else content[:3])
    grey = colours == _GREY_ALPHA
    return Header(orientation, max(pictures, 1), Alpha.STRAIGHT, grey, clear, bits)


def _png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        kind = data[at + 4 : at + 8]
        yield kind, b"" if kind == b"IDAT" else data[at + 8 : at + 8 + size]
        at += 12 + size


def _jpeg_orientation(data: bytes) -> int:
    at = 2
    while data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # filling
            at += 1
            continue
        if marker in (0xD9, 0xDA):  # end, or the picture itself
            break
        (size,) = struct.unpack_from(">H", data, at + 2)
        if marker == 0xE1 and data.startswith(_EXIF, at + 4):
            return tiff.orientation(data[at + 4 + len(_EXIF) : at + 2 + size])
        at += 2 + size
    return 1


def _webp(data: bytes) -> Header:
    at, pictures, orientation = 12, 0, 1
    while at + 8 <= len(data):
        kind = data[at : at + 4]
        (size,) = struct.unpack_from("<I", data, at + 4)
        if kind == b"ANMF":
            pictures += 1
        elif kind == b"EXIF":
            exif = data[at + 8 : at + 8 + size]
            orientation = tiff.orientation(exif.removeprefix(_EXIF))
        at += 8 + size + size % 2
    return Header(orientation, max(pictures, 1))
