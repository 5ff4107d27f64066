"""Headers of images but TIFF and EXR: facts that OpenCV does not tell, or too late.

Decoders make room for a picture first and fill it with whatever comes: a JPEG of 600 bytes became
2.7 GB.  A picture of one colour packs well, so that a small file may hold a large one; up to the
size of the largest sensors it is let be.  Of any file, a picture beyond
:data:`adv2e.sources.frame.LARGEST` is not read.

References
----------
.. [1] W3C, "Portable Network Graphics (PNG) Specification, third edition", 4.3 (order of chunks
   that state the colour space) and 11.3.2.
.. [2] ITU-T T.81 (JPEG), B.2.2 (frame header).
.. [3] Google, "WebP Container Specification" and "Specification for WebP Lossless Bitstream".
.. [4] J. Poskanzer, B. Henderson, "Netpbm format specifications", netpbm.sourceforge.net.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from adv2e.effects.frames.encoding import UNKNOWN
from adv2e.errors import DataError
from adv2e.sources.frame import check_pixels
from adv2e.sources.images.alpha import Alpha

FREE = 1 << 25
"""Pixels of a picture that its file may hold in as few bytes as it likes: 8192x4096."""
MOST = 100
"""Pixels that one byte may stand for, of a larger one."""

_GREY, _GREY_ALPHA = 0, 4
_LIGHT = (b"cICP", b"iCCP", b"sRGB", b"gAMA")
"""Chunks of PNG that say what its numbers stand for, the first that counts first."""
_TRANSFERS = {
    **dict.fromkeys((1, 6, 14, 15), "bt709"),
    **{4: "gamma:2.2", 5: "gamma:2.8", 8: "linear", 13: "srgb", 16: "pq", 18: "hlg"},
}
"""Encodings by the transfer of ITU-T H.273 that a cICP chunk states."""
_V3 = 56  # bytes of the first header of BMP that has a mask for alpha
_OS2 = 12  # bytes of the first header of BMP of all
_LONGEST = 1 << 16  # bytes of a header of text
_FLOATS = re.compile(rb"P[Ff]\s+(?P<width>[0-9]{1,10})\s+(?P<height>[0-9]{1,10})\s")
_RADIANCE = re.compile(
    rb"#\?R(?s:.*?)\n[-+]Y +(?P<height>[0-9]{1,10}) +[-+]X +(?P<width>[0-9]{1,10})\s"
)
_RAW_PNM = re.compile(rb"P[56]" + 3 * rb"(?:\s|#[^\n\r]*[\n\r])+([0-9]{1,10})" + rb"\s")


@dataclass(frozen=True)
class Header:
    """Facts about an image beside its pixels: size, alpha, white, encoding.

    Attributes
    ----------
    width, height : int
        Zero where they are not stated.
    pictures : int
        Number of pictures in the file.
    alpha : Alpha
        Meaning of a fourth channel.
    grey : bool
        OpenCV repeats grey three times.
    white : float, optional
        Number that means white, where it is not that of the data type.
    clear : int, optional
        Grey value of pixels that are not there, in the bits that OpenCV returns.
    encoding, says : str
        See :class:`adv2e.sources.frame.Pixels`.
    densities : (int, int)
        Pixels a unit of length, across and down; they are square if these are the same.
    """

    width: int = 0
    height: int = 0
    pictures: int = 1
    alpha: Alpha = Alpha.STRAIGHT
    grey: bool = False
    white: float | None = None
    clear: int | None = None
    encoding: str = ""
    says: str = ""
    densities: tuple[int, int] = (1, 1)


def read_header(data: bytes) -> Header:
    """Return the header in the bytes of a file, as far as it can be read."""
    try:
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            return _png(data)
        if data.startswith(b"\xff\xd8"):
            return _jpeg(data)
        if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
            return _webp(data)
        if data[:2] == b"BM":
            size, width, height = struct.unpack_from(
                "<Iii" if data[14] > _OS2 else "<IHH", data, 14
            )
            alpha = Alpha.STRAIGHT if size >= _V3 else Alpha.NONE
            return Header(abs(width), abs(height), alpha=alpha)
        if stated := _RAW_PNM.match(data):
            return _pnm(data, stated)
        if stated := _FLOATS.match(data) or _RADIANCE.match(data[:_LONGEST]):
            return Header(int(stated["width"]), int(stated["height"]))
    except (struct.error, IndexError):  # cut short: OpenCV will say so
        pass
    return Header()


def check_size(width: int, height: int, data: bytes, label: str) -> None:
    """Raise DataError if a picture of this size is not read, or is not in the bytes of its file."""
    check_pixels(width, height, label)
    if width * height > max(FREE, MOST * len(data)):
        raise DataError(
            f"{label}: states {width}x{height} pixels in {len(data):,} bytes: damaged, or made to"
            " fill the memory"
        )


def _png(data: bytes) -> Header:
    width, height, depth, colours = struct.unpack_from(">IIBB", data, 16)
    pictures, clear, densities, light = 1, None, (1, 1), {}
    for kind, content in _png_chunks(data):
        if kind == b"pHYs":
            densities = struct.unpack_from(">II", content)
        elif kind in _LIGHT:
            light[kind] = content
        elif kind == b"acTL":
            (pictures,) = struct.unpack_from(">I", content)
        elif kind == b"tRNS" and colours == _GREY:
            (clear,) = struct.unpack_from(">H", content)
            clear *= 255 // ((1 << depth) - 1) if depth < 8 else 1
    encoding, says = _light_of_png(light)
    return Header(
        width,
        height,
        max(pictures, 1),
        grey=colours == _GREY_ALPHA,
        clear=clear,
        encoding=encoding,
        says=says,
        densities=densities,
    )


def _light_of_png(chunks: dict[bytes, bytes]) -> tuple[str, str]:
    """Return the encoding that chunks state, if any, and what is to be told: the first counts."""
    kind = next((kind for kind in _LIGHT if kind in chunks), b"")
    if kind == b"cICP":
        transfer = chunks[kind][1]
        return _TRANSFERS.get(transfer, f"{UNKNOWN}transfer {transfer} of a cICP chunk"), "cICP"
    if kind == b"iCCP":
        name = chunks[kind].partition(b"\0")[0].decode("latin-1")
        return "", f"its colour profile {name!r} is not read"
    if kind == b"sRGB":
        return "srgb", "its chunk sRGB says so"
    if kind == b"gAMA":
        gamma = struct.unpack(">I", chunks[kind])[0] / 1e5
        if abs(gamma - 1 / 2.2) < 0.001:  # as software writes it that means sRGB
            return "srgb", f"its gAMA is {gamma:g}"
        if 0.1 <= gamma <= 10:
            return "linear" if gamma == 1 else f"gamma:{1 / gamma:.6g}", f"its gAMA is {gamma:g}"
        return "", f"its gAMA of {gamma:g} is ignored"
    return "", ""


def _png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the chunks before the picture's data: all that say how it is to be read."""
    at = 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        kind = data[at + 4 : at + 8]
        if kind == b"IDAT":
            return
        yield kind, data[at + 8 : at + 8 + size]
        at += 12 + size


def _jpeg(data: bytes) -> Header:
    at, densities = 2, (1, 1)
    while at >= 0:
        while data[at] == 0xFF:  # any number of them begins a marker
            at += 1
        marker = data[at]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 4)
            return Header(width, height, densities=densities)
        if marker == 0xE0 and data[at + 3 : at + 8] == b"JFIF\0":
            densities = struct.unpack_from(">HH", data, at + 11)
        alone = marker in (0x00, 0x01) or 0xD0 <= marker <= 0xD9
        at += 1 if alone else 1 + struct.unpack_from(">H", data, at + 1)[0]
        at = data.find(b"\xff", at)
    return Header()


def _webp(data: bytes) -> Header:
    at, pictures, width, height = 12, 0, 0, 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from("<4sI", data, at)
        if kind == b"ANMF":
            pictures += 1
        elif kind == b"VP8X":
            width = 1 + int.from_bytes(data[at + 12 : at + 15], "little")
            height = 1 + int.from_bytes(data[at + 15 : at + 18], "little")
        elif kind == b"VP8L" and not width:
            (bits,) = struct.unpack_from("<I", data, at + 9)
            width, height = 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
        elif kind == b"VP8 " and not width:
            width, height = (n & 0x3FFF for n in struct.unpack_from("<HH", data, at + 14))
        at += 8 + size + size % 2
    return Header(width, height, max(pictures, 1))


def _pnm(data: bytes, stated: re.Match[bytes]) -> Header:
    width, height, most = map(int, stated.groups())
    samples = width * height * (3 if data[1:2] == b"6" else 1)
    end = stated.end() + samples * (1 if most < 256 else 2)
    another = re.match(rb"\s*P[1-7]\s", data[end : end + 16])
    white = None if most in (255, 65535) else float(most)
    return Header(width, height, len(data) // end if another else 1, white=white)
