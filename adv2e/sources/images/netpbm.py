"""PGM and PPM, plain and raw, with any maxval.

Not through OpenCV: it does not say what white is, and scales plain images and no others.

References
----------
.. [1] J. Poskanzer, B. Henderson, "Netpbm format specifications", netpbm.sourceforge.net.
"""

from __future__ import annotations

import re

import numpy as np

from adv2e.errors import DataError
from adv2e.sources.frame import Image, Pixels

_SPACE = rb"(?:\s|#[^\n\r]*[\n\r])+"
_HEADER = re.compile(rb"P[2356]" + 3 * (_SPACE + rb"([0-9]{1,10})") + rb"\s")
_COMMENT = re.compile(rb"#[^\n\r]*")
_ANOTHER = re.compile(rb"\s*P[1-7]\s")


def is_netpbm(data: bytes) -> bool:
    """Tell whether the bytes of a file begin as an image of this family does."""
    return re.match(rb"P[1-7]\s", data) is not None


def decode(data: bytes, label: str) -> Pixels:
    """Return the image in the bytes of a file; `label` is its name, for messages.

    Raises
    ------
    DataError
        It is a PBM or PAM, the header is wrong, there are more pictures than one or less than one,
        or a number is above the maxval.
    """
    if data[1:2] in b"147":
        raise DataError(f"{label}: PBM and PAM are not read; write PGM, PPM or PNG")
    damaged = DataError(f"{label}: not an image that can be read, or damaged")
    header = _HEADER.match(data)
    if header is None:
        raise damaged
    columns, rows, most = map(int, header.groups())
    channels = 3 if data[1:2] in b"36" else 1
    count = rows * columns * channels
    if not 0 < most < 1 << 16:
        raise DataError(f"{label}: its header states a maxval of {most}; it must be 1 to 65535")
    stored = np.dtype(np.uint8 if most < 256 else ">u2")
    end = header.end() + count * stored.itemsize
    if data[1:2] in b"56":
        if not 0 < count * stored.itemsize <= len(data) - header.end():
            raise damaged
        if _ANOTHER.match(data, end):
            raise DataError(f"{label}: more than one picture in it; give each a file of its own")
        values = np.frombuffer(data, stored, count, header.end())
    else:
        text = _COMMENT.sub(b" ", data[header.end() :])
        if not re.fullmatch(rb"[0-9\s]*", text):
            raise damaged
        values = np.fromstring(text.decode("ascii"), np.float64, sep=" ")
        if not 0 < count == values.size:
            raise damaged
    if (largest := float(values.max())) > most:
        raise DataError(
            f"{label}: a number of {largest:g}, above the {most} that its header states"
        )
    image: Image = values.astype(stored.newbyteorder("="))
    shape = (rows, columns) if channels == 1 else (rows, columns, channels)
    return Pixels(image.reshape(shape), white=None if most in (255, 65535) else float(most))
