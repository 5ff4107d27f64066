"""Images of the Netpbm family: PBM, PGM, PPM (plain and raw) and PAM, with any maxval.

Not through OpenCV: it does not say what white is, scales plain images and no others, and takes
the bits of a PAM bitmap for black.

References
----------
.. [1] J. Poskanzer, B. Henderson, "Netpbm format specifications", netpbm.sourceforge.net.
"""

from __future__ import annotations

import re
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.sources.base import Image, Pixels
from adv2e.sources.images.alpha import Alpha, with_alpha

_TOKEN = re.compile(rb"(?:\s|#[^\n\r]*[\n\r])*([0-9]{1,10})")
_COMMENT = re.compile(rb"#[^\n\r]*")
_ANOTHER = re.compile(rb"\s*P[1-7]\s")
_CHANNELS = {1: 1, 2: 1, 3: 3, 4: 1, 5: 1, 6: 3}
_TUPLES = {
    b"": (1, 3),
    b"BLACKANDWHITE": (1,),
    b"GRAYSCALE": (1,),
    b"RGB": (3,),
    b"BLACKANDWHITE_ALPHA": (2,),
    b"GRAYSCALE_ALPHA": (2,),
    b"RGB_ALPHA": (4,),
}
"""Channels that a PAM of each type may have."""


def is_netpbm(data: bytes) -> bool:
    """Tell whether the bytes of a file begin as an image of this family does."""
    return re.match(rb"P[1-7]\s", data) is not None


def decode(data: bytes, label: str) -> Pixels:
    """Return the image in the bytes of a file.

    Parameters
    ----------
    data : bytes
        What the file holds.
    label : str
        Its name, for messages.

    Raises
    ------
    DataError
        The header is wrong, there are more pictures than one or less than one, or a number is
        above the maxval.
    """
    kind = data[1] - ord("0")
    if kind == 7:
        shape, most, at = _pam_header(data, label)
        values, at = _raw(data, at, shape, most, label)
    else:
        shape, most, at = _header(data, kind, label)
        if kind <= 3:
            values, at = _plain(data, at, shape, kind, most, label), len(data)
        elif kind == 4:
            values, at = _bits(data, at, shape, label)
        else:
            values, at = _raw(data, at, shape, most, label)
    if _ANOTHER.match(data, at):
        raise DataError(f"{label}: more than one picture in it; give each a file of its own")
    if kind in (1, 4):
        return Pixels(np.where(values[..., 0] > 0, 0, 255).astype(np.uint8))
    _check_largest(float(values.max()), most, label)
    return _pixels(values, most, label)


def _pixels(values: NDArray[Any], most: int, label: str) -> Pixels:
    channels = values.shape[2]
    white = None if most == np.iinfo(values.dtype).max else float(most)
    colours: Image = values[..., 0] if channels < 3 else values[..., :3]
    colours = np.ascontiguousarray(colours)
    if channels in (1, 3):
        return Pixels(colours, white=white)
    pixels = with_alpha(colours, values[..., -1], Alpha.STRAIGHT, most, label)
    return Pixels(pixels.image, pixels.alpha, white=white)


def _header(data: bytes, kind: int, label: str) -> tuple[tuple[int, int, int], int, int]:
    """Return ((rows, columns, channels), maxval, where the raster begins)."""
    at, numbers = 2, []
    for _ in range(2 if kind in (1, 4) else 3):
        found = _TOKEN.match(data, at)
        if found is None:
            _damaged(label)
        numbers.append(int(found[1]))
        at = found.end()
    columns, rows, *rest = numbers
    return _checked((rows, columns, _CHANNELS[kind]), rest[0] if rest else 1, at + 1, data, label)


def _pam_header(data: bytes, label: str) -> tuple[tuple[int, int, int], int, int]:
    end = data.find(b"ENDHDR\n")
    if end < 0:
        _damaged(label)
    stated: dict[bytes, bytes] = {}
    for line in data[3:end].splitlines():
        name, _, value = line.strip().partition(b" ")
        if name and not name.startswith(b"#"):
            stated[name] = value.strip()
    names = (b"HEIGHT", b"WIDTH", b"DEPTH", b"MAXVAL")
    if not all(re.fullmatch(rb"[0-9]{1,10}", stated.get(name, b"")) for name in names):
        _damaged(label)
    rows, columns, channels, most = (int(stated[name]) for name in names)
    kind = stated.get(b"TUPLTYPE", b"")
    if channels not in _TUPLES.get(kind, ()):
        shown = kind.decode("ascii", "replace") or "no TUPLTYPE"
        raise DataError(f"{label}: a PAM of {channels} channels and {shown}; give grey or RGB")
    return _checked((rows, columns, channels), most, end + len(b"ENDHDR\n"), data, label)


def _checked(
    shape: tuple[int, int, int], most: int, at: int, data: bytes, label: str
) -> tuple[tuple[int, int, int], int, int]:
    rows, columns, channels = shape
    # an eighth of a byte is the least that a pixel takes, so that a header claims no memory
    if not (rows > 0 and columns > 0 and rows * columns * channels <= 8 * len(data)):
        _damaged(label)
    if not 0 < most < 1 << 16:
        raise DataError(f"{label}: its header states a maxval of {most}; it must be 1 to 65535")
    return shape, most, at


def _raw(
    data: bytes, at: int, shape: tuple[int, int, int], most: int, label: str
) -> tuple[NDArray[Any], int]:
    kind = np.dtype(np.uint8 if most < 256 else ">u2")
    count = shape[0] * shape[1] * shape[2]
    end = at + count * kind.itemsize
    if end > len(data):
        _damaged(label)
    values = np.frombuffer(data, kind, count, at).reshape(shape)
    return values.astype(kind.newbyteorder("=")), end


def _bits(
    data: bytes, at: int, shape: tuple[int, int, int], label: str
) -> tuple[NDArray[Any], int]:
    rows, columns, _ = shape
    width = (columns + 7) // 8
    end = at + rows * width
    if end > len(data):
        _damaged(label)
    packed = np.frombuffer(data, np.uint8, rows * width, at).reshape(rows, width)
    return np.unpackbits(packed, axis=1)[:, :columns, np.newaxis], end


def _plain(
    data: bytes, at: int, shape: tuple[int, int, int], kind: int, most: int, label: str
) -> NDArray[Any]:
    text = _COMMENT.sub(b" ", data[at - 1 :])
    count = shape[0] * shape[1] * shape[2]
    if kind == 1:  # digits need nothing between them
        digits = b"".join(text.split())[:count]
        if len(digits) < count or digits.strip(b"01"):
            _damaged(label)
        return (np.frombuffer(digits, np.uint8) - ord("0")).reshape(shape)
    if not re.fullmatch(rb"[0-9\s]*", text):
        _damaged(label)
    numbers = np.fromstring(text.decode("ascii"), np.float64, sep=" ")
    if numbers.size != count:
        _damaged(label)
    _check_largest(numbers.max(), most, label)
    return numbers.astype(np.uint8 if most < 256 else np.uint16).reshape(shape)


def _check_largest(largest: float, most: int, label: str) -> None:
    if largest > most:
        raise DataError(
            f"{label}: a number of {largest:g}, above the {most} that its header states"
        )


def _damaged(label: str) -> NoReturn:
    raise DataError(f"{label}: not an image that can be read, or damaged")
