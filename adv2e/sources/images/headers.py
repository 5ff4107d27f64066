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

import io
import re
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import takewhile
from typing import IO, NamedTuple

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
        Number that means white in the image of OpenCV, where it is not that of the data type.
    inverted : bool
        Zero is white in the image of OpenCV.
    clear : int, optional
        Grey value of pixels that are not there, in the bits that OpenCV returns.
    encoding, says : str
        See :class:`adv2e.sources.frame.Frame`.
    densities : (int, int)
        Pixels a unit of length, across and down; they are square if these are the same.
    """

    width: int = 0
    height: int = 0
    pictures: int = 1
    alpha: Alpha = Alpha.STRAIGHT
    grey: bool = False
    white: float | None = None
    inverted: bool = False
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
    # those before the picture's data: all that say how it is to be read
    for kind, content in takewhile(lambda chunk: chunk[0] != b"IDAT", png_chunks(data)):
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


def png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and content of the chunks of a PNG."""
    at = 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        yield data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
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


# ---- Directories of a TIFF, for facts that OpenCV does not tell; Exif is such a directory, too.
#
# OpenCV turns the picture as its orientation says, and scales 10, 12 and 14 bits to 16. It reads
# the first page alone, knows no white level, multiplies 8 bits by unassociated alpha but not 16,
# leaves 16 bits inverted where white is zero, and makes 8 bits of formats that it does not know.
#
# References
# ----------
# .. [1] TIFF Revision 6.0, Adobe, 1992.
# .. [2] libtiff, "The BigTIFF file format".


_WIDTH, _HEIGHT = 256, 257
_KIND, _BITS, _COLOURS, _DESCRIPTION, _ORIENTATION, _SAMPLES = 254, 258, 262, 270, 274, 277
_EXTRA, _FORMAT = 338, 339
_WANTED = (
    *(_WIDTH, _HEIGHT, _KIND, _BITS, _COLOURS, _DESCRIPTION, _ORIENTATION, _SAMPLES),
    *(_EXTRA, _FORMAT),
)
_REDUCED, _MASK = 1, 4
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _LOG_L, _LOG_LUV = 0, 1, 2, 32844, 32845
_ASSOCIATED, _UNASSOCIATED = 1, 2
_TYPES = {1: "B", 2: "B", 3: "H", 4: "I", 16: "Q"}
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 16: 8}
_TEXT, _FLOAT = 2, 3
_VALUES = 64
_IMAGEJ = re.compile(rb"ImageJ=.*\nimages=([0-9]{1,9})\n")
"""Description of stacks of ImageJ that have all pages behind the first, with one directory."""


class _Tag(NamedTuple):
    values: tuple[int, ...]
    at: int
    """Offset of its values in the file [bytes]."""


def is_tiff(data: bytes) -> bool:
    return data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


class Entry(NamedTuple):
    """Type and number of values; the field that holds them, or where they are, and its offset."""

    kind: int
    length: int
    field: bytes
    at: int


class Directories:
    """The directories of a TIFF, read as they are asked for; DataError for what is not there.

    Attributes
    ----------
    size : int
        Of the file [bytes].
    order, pointer, counter, entry : str
        Byte order; forms of an offset, of a number of entries, and of an entry.
    first : int
        Offset of the first directory.
    """

    def __init__(self, file: IO[bytes], label: str) -> None:
        self._file, self._label = file, label
        self.size = file.seek(0, 2)
        file.seek(0)
        self.head = file.read(8)
        if not is_tiff(self.head):
            raise self.error("not a TIFF, or damaged")
        self.order, self.is_big = _order(self.head), 43 in self.head[2:4]
        self.pointer, self.counter, self.entry = "I", "H", "HHI4s"
        if self.is_big:
            self.pointer, self.counter, self.entry = "Q", "Q", "HHQ8s"
        (self.first,) = self.unpacked(8 if self.is_big else 4, self.pointer)

    def entries(self, at: int) -> tuple[dict[int, Entry], int]:
        """Return the entries of the directory at an offset, and where the pointer behind it is."""
        (count,) = self.unpacked(at, self.counter)
        at += struct.calcsize("=" + self.counter)
        width = struct.calcsize("=" + self.entry)
        listed = struct.iter_unpack(self.order + self.entry, self.bytes_at(at, count * width))
        found = {
            tag: Entry(kind, length, field, at + width * number - len(field))
            for number, (tag, kind, length, field) in enumerate(listed, 1)
        }
        return found, at + count * width

    def place(self, one: Entry) -> int:
        """Return the offset of the values of an entry."""
        if _SIZES.get(one.kind, 0) * one.length <= len(one.field):
            return one.at
        (at,) = struct.unpack(self.order + self.pointer, one.field)
        return int(at)

    def value(self, one: Entry, longest: int = 1 << 20) -> bytes:
        """Return the values of an entry; those of more than `longest` bytes are damaged."""
        size = _SIZES.get(one.kind, 0) * one.length
        if not 0 < size <= longest:
            raise self.error(f"a tag of {size:,} bytes: damaged")
        return one.field[:size] if size <= len(one.field) else self.bytes_at(self.place(one), size)

    def unpacked(self, at: int, form: str) -> tuple[int, ...]:
        """Return the numbers at an offset."""
        return struct.unpack(self.order + form, self.bytes_at(at, struct.calcsize("=" + form)))

    def bytes_at(self, at: int, size: int) -> bytes:
        """Return so many bytes from an offset on."""
        if at + size > self.size:
            raise self.error(f"cut short, or damaged: {size:,} bytes are expected at byte {at:,}")
        self._file.seek(at)
        data = self._file.read(size)
        if len(data) < size:
            raise self.error("cut short while it was read")
        return data

    def error(self, what: str) -> DataError:
        return DataError(f"{self._label}: {what}")


def examine(data: bytes, label: str) -> tuple[Header, bytes] | None:
    """Return what the first directory says, and the file for OpenCV to leave colours as they are.

    None: it cannot be read.

    Raises
    ------
    DataError
        There are more pages, a size that is not there, or colours that are not read.
    """
    directories = _directories(data)
    if not directories:
        return None
    pages = sum(not _first(tags, _KIND, 0) & (_REDUCED | _MASK) for tags in directories)
    if found := _IMAGEJ.match(_text(directories[0])):
        pages = max(pages, int(found[1]))
    if pages > 1:
        raise DataError(
            f"{label}: {pages} pages in it; give each frame a file of its own, or this one alone"
        )
    tags = directories[0]
    check_size(_first(tags, _WIDTH, 0), _first(tags, _HEIGHT, 0), data, label)
    bits, colours = _first(tags, _BITS, 1), _first(tags, _COLOURS, _BLACK_IS_ZERO)
    samples, floats = _first(tags, _SAMPLES, 1), _first(tags, _FORMAT, 1) == _FLOAT
    if bits > 8 and colours not in (_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _LOG_L, _LOG_LUV):
        raise DataError(f"{label}: a TIFF of {bits} bits must be grey or RGB")
    if samples == 2:
        raise DataError(f"{label}: grey TIFF with a second channel; write it as PNG, or without")
    inverted = colours == _WHITE_IS_ZERO and bits > 8
    if inverted and floats:
        raise DataError(f"{label}: floats of which zero is white; write light instead")
    if bits == 8 and samples == 4:
        data = _not_multiplied(data, tags)
    # OpenCV moves 10, 12 and 14 bits to the upper end of 16
    white = float(((1 << bits) - 1) << (16 - bits)) if 8 < bits < 16 else None
    return Header(white=white, inverted=inverted, alpha=_alpha(tags)), data


def orientation(data: bytes) -> int:
    """Return the orientation, 1 to 8, that the first directory states; 1 if it states none."""
    directories = _directories(data, most=1)
    stated = _first(directories[0], _ORIENTATION, 1) if directories else 1
    return stated if 1 <= stated <= 8 else 1


def _alpha(tags: Mapping[int, _Tag]) -> Alpha:
    if _EXTRA not in tags:  # as OpenCV itself writes it
        return Alpha.STRAIGHT
    return {_ASSOCIATED: Alpha.MULTIPLIED, _UNASSOCIATED: Alpha.STRAIGHT}.get(
        tags[_EXTRA].values[0], Alpha.UNSAID
    )


def _not_multiplied(data: bytes, tags: Mapping[int, _Tag]) -> bytes:
    """Return the file with unassociated alpha called associated: libtiff multiplies no such."""
    extra = tags.get(_EXTRA)
    if extra is None or extra.values != (_UNASSOCIATED,):
        return data
    changed = bytearray(data)
    struct.pack_into(_order(data) + "H", changed, extra.at, _ASSOCIATED)
    return bytes(changed)


def _text(tags: Mapping[int, _Tag]) -> bytes:
    return bytes(tags[_DESCRIPTION].values) if _DESCRIPTION in tags else b""


def _first(tags: Mapping[int, _Tag], tag: int, default: int) -> int:
    return tags[tag].values[0] if tag in tags else default


def _order(data: bytes) -> str:
    return "<" if data[:2] == b"II" else ">"


def _directories(data: bytes, most: int | None = None) -> list[dict[int, _Tag]]:
    """Return the tags wanted of each directory, up to what is no directory."""
    found: list[dict[int, _Tag]] = []
    seen: set[int] = set()
    with suppress(DataError):  # beyond the end, or no TIFF
        tiff = Directories(io.BytesIO(data), "")
        at = tiff.first
        while at and at not in seen and len(found) != most:
            seen.add(at)
            entries, end = tiff.entries(at)
            found.append(
                {name: _tag(tiff, one) for name, one in entries.items() if _fits(name, one)}
            )
            (at,) = tiff.unpacked(end, tiff.pointer)
    return found


def _fits(name: int, one: Entry) -> bool:
    if name not in _WANTED or one.kind not in _TYPES or one.length < 1:
        return False
    is_text = one.kind == _TEXT
    return (name == _DESCRIPTION) == is_text and (is_text or one.length <= _VALUES)


def _tag(tiff: Directories, one: Entry) -> _Tag:
    if one.length > _VALUES:
        one = one._replace(length=_VALUES)
    form = f"{tiff.order}{one.length}{_TYPES[one.kind]}"
    return _Tag(struct.unpack(form, tiff.value(one)), tiff.place(one))
