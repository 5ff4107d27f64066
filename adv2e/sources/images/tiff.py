"""Directories of a TIFF, for facts that OpenCV does not tell; Exif is such a directory, too.

OpenCV turns the picture as its orientation says, and scales 10, 12 and 14 bits to 16.  It reads the
first page alone, knows no white level, multiplies 8 bits by unassociated alpha but not 16, leaves
16 bits inverted where white is zero, and makes 8 bits of formats that it does not know.

References
----------
.. [1] TIFF Revision 6.0, Adobe, 1992.
.. [2] libtiff, "The BigTIFF file format".
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass

from adv2e.errors import DataError
from adv2e.sources.images.alpha import Alpha
from adv2e.sources.images.headers import check_size

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
_TEXT, _FLOAT = 2, 3
_VALUES = 64
_IMAGEJ = re.compile(rb"ImageJ=.*\nimages=([0-9]{1,9})\n")
"""Description of stacks of ImageJ that have all pages behind the first, with one directory."""


@dataclass(frozen=True)
class _Tag:
    values: tuple[int, ...]
    at: int
    """Offset of its values in the file [bytes]."""


@dataclass(frozen=True)
class Tiff:
    """Facts about a TIFF beside its pixels: white, inversion, alpha.

    Attributes
    ----------
    data : bytes
        The file, so that OpenCV leaves colours as they are.
    white : float, optional
        Number that means white in the image of OpenCV, where it is not that of the data type.
    inverted : bool
        Zero is white in the image of OpenCV.
    alpha : Alpha
        Meaning of a fourth channel.
    """

    data: bytes
    white: float | None
    inverted: bool
    alpha: Alpha


def is_tiff(data: bytes) -> bool:
    """Tell whether the bytes of a file begin as those of a TIFF."""
    return data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def examine(data: bytes, label: str) -> Tiff | None:
    """Return the facts in the first directory; None if it cannot be read.

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
    return Tiff(data, white, inverted, _alpha(tags))


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
    if not is_tiff(data):
        return []
    order, big = _order(data), 43 in data[2:4]
    pointer, count, value = ("Q", "Q", 8) if big else ("I", "H", 4)
    found: list[dict[int, _Tag]] = []
    seen: set[int] = set()
    try:
        (at,) = struct.unpack_from(order + pointer, data, 8 if big else 4)
        while at and at not in seen and len(found) != most:
            seen.add(at)
            (entries,) = struct.unpack_from(order + count, data, at)
            at += struct.calcsize(order + count)
            width = 4 + 2 * value
            if at + entries * width > len(data):
                break
            tags: dict[int, _Tag] = {}
            for place in range(at, at + entries * width, width):
                tag, kind, length = struct.unpack_from(f"{order}HH{pointer}", data, place)
                if tag not in _WANTED or (tag == _DESCRIPTION) != (kind == _TEXT):
                    continue
                if kind == _TEXT:
                    length = min(length, _VALUES)
                if kind not in _TYPES or not 0 < length <= _VALUES:
                    continue
                form, inside = f"{order}{length}{_TYPES[kind]}", place + 4 + value
                if struct.calcsize(form) > value:
                    (inside,) = struct.unpack_from(order + pointer, data, inside)
                tags[tag] = _Tag(struct.unpack_from(form, data, inside), inside)
            found.append(tags)
            (at,) = struct.unpack_from(order + pointer, data, at + entries * width)
    except struct.error:  # beyond the end
        pass
    return found
