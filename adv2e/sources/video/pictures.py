"""Decoded pictures of PyAV as images: all their bits, in the colours that they state, upright.

Codes of 8 bits are converted by FFmpeg.  Deeper ones are converted here, as that conversion is off
by several codes of 10 bits: with matrix and range of the pictures, to whole numbers of 16 bits.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from av.video.reformatter import VideoReformatter
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import UNKNOWN
from adv2e.errors import DataError
from adv2e.sources.frame import Frame

# ---- Transfers by which videos state their light, and the encoding of frames behind each.
#
# References
# ----------
# .. [1] ITU-T H.273 (07/2021), table 3 (transfer).


UNSTATED = 2

_ENCODINGS = {
    **dict.fromkeys((1, 6, 11, 12, 14, 15), "bt709"),
    4: "gamma:2.2",
    5: "gamma:2.8",
    8: "linear",
    13: "srgb",
    16: "pq",
    18: "hlg",
}
_NAMES = {
    **{1: "BT.709", 4: "gamma 2.2", 5: "gamma 2.8", 6: "BT.601", 7: "SMPTE 240M", 8: "linear"},
    **{9: "logarithmic 100:1", 10: "logarithmic 316:1", 11: "xvYCC", 12: "BT.1361", 13: "sRGB"},
    **{14: "BT.2020", 15: "BT.2020", 16: "PQ", 17: "SMPTE ST 428-1", 18: "HLG"},
}


def is_stated(code: int) -> bool:
    """Tell whether a code says anything: the reserved ones do not."""
    return code not in (0, UNSTATED, 3)


def encoding_of(transfer: int) -> tuple[str, str]:
    """Return the encoding of frames behind a transfer, and how that is known, in a few words.

    A transfer that cannot be decoded gives what `LightDecoder` refuses by name.
    """
    if not is_stated(transfer):
        return "srgb", "usual for video that states no curve"
    name = _NAMES.get(transfer, f"number {transfer}")
    if transfer not in _ENCODINGS:
        return UNKNOWN + name, f"the video states {name}, which is not known here"
    return _ENCODINGS[transfer], f"the video states {name}"


# ---- Luma and two chromas to colours: with the matrix and the range of the pictures.
#
# Each chroma sample stands for all the pixels that it covers.
#
# References
# ----------
# .. [1] ITU-T H.273 (07/2021), 8.3 (matrix coefficients).


SHARES = {
    **dict.fromkeys((0, 2, 3, 5, 6), (0.299, 0.114)),
    **{1: (0.2126, 0.0722), 4: (0.30, 0.11), 7: (0.212, 0.087), 9: (0.2627, 0.0593)},
}
"""Shares of red and blue in luma by the code of the matrix; not stated is BT.601, as in FFmpeg."""


def rgb_of_planes(
    planes: Sequence[NDArray[np.float32]], matrix: int, bits: int, *, full: bool
) -> NDArray[np.float32]:
    """Return red, green and blue, 0 to 1 but for codes beyond, of codes of so many bits."""
    top = (1 << bits) - 1
    luma, chroma = 1 / top, 1 / top
    black = 0
    if not full:
        black, luma, chroma = 16 << bits - 8, 1 / (219 << bits - 8), 1 / (224 << bits - 8)
    whole = [planes[0], *(_spread(plane, planes[0].shape) for plane in planes[1:3])]
    to_rgb = _to_rgb(matrix) * [luma, chroma, chroma]
    offset = to_rgb @ np.array([black, 1 << bits - 1, 1 << bits - 1])
    turned = np.column_stack([to_rgb, -offset]).astype(np.float32)
    return np.asarray(cv2.transform(cv2.merge(whole), turned))


def _spread(plane: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return chroma for every pixel."""
    for axis in (0, 1):
        plane = np.repeat(plane, -(-shape[axis] // plane.shape[axis]), axis)
    return plane[: shape[0], : shape[1]]


def _to_rgb(matrix: int) -> NDArray[np.float64]:
    """Return red, green and blue of luma 0..1 and two chromas of -0.5..0.5."""
    red, blue = SHARES[matrix]
    green = 1 - red - blue
    to_red, to_blue = 2 * (1 - red), 2 * (1 - blue)
    return np.array(
        [[1, 0, to_red], [1, -blue * to_blue / green, -red * to_red / green], [1, to_blue, 0]]
    )


_FULL = 2
_TURNS: dict[tuple[int, ...], int] = {
    (0, 1, -1, 0): cv2.ROTATE_90_CLOCKWISE,
    (-1, 0, 0, -1): cv2.ROTATE_180,
    (0, -1, 1, 0): cv2.ROTATE_90_COUNTERCLOCKWISE,
}
"""Signs of a, b, c, d of a display matrix: x' = a x + c y, y' = b x + d y, y counted down."""


class Converter:
    """Makes images of pictures; one for each pass, as it keeps the tables of the conversion."""

    def __init__(self) -> None:
        self._scaler = VideoReformatter()
        self._latest: tuple[Any, ...] = ()

    def frame(self, picture: Any, label: str) -> Frame:
        """Return a picture as grey or RGB of uint8 or uint16, white 255 or 65535.

        Raises
        ------
        DataError
            Its pixels are of a kind that cannot be converted.
        """
        try:
            image = self.codes(picture)
        except (ValueError, OSError) as error:
            raise DataError(f"{label}: {error}") from error
        turn = _TURNS.get(_signs(picture))
        if turn is not None:
            image = np.asarray(cv2.rotate(image, turn))
        if image.ndim == 2 or image.shape[2] == 3:
            return Frame(image)
        white, alpha = np.iinfo(image.dtype).max, image[..., 3]
        there = None if alpha.min() == white else alpha.astype(np.float32) / np.float32(white)
        return Frame(np.ascontiguousarray(image[..., :3]), there)

    def codes(self, frame: Any) -> NDArray[Any]:
        """Return the codes of a picture as (rows, columns, 3) RGB, or (rows, columns).

        Where pixels can be transparent, how much of each is there is a fourth number.

        Raises
        ------
        ValueError
            Its pixels cannot be converted.
        """
        kind = frame.format
        parts, matrix = kind.components, int(frame.colorspace)
        bits, alpha = parts[0].bits, parts[-1].is_alpha
        rgb = kind.is_rgb or len(parts) - alpha < 3
        if not rgb and matrix not in SHARES:
            raise ValueError(f"colours by the matrix {frame.colorspace} cannot be read")
        if bits > 16 or kind.name.startswith(("xyz", "bayer", "grayf", "gbrpf", "rgbf")):
            raise ValueError(f"pixels of {kind.name} cannot be read")
        if bits > 8:
            return _deep(frame, bits, matrix, rgb=rgb)
        name = "rgba" if alpha else "rgb24"
        if len(parts) == 1 and not kind.has_palette:
            name = "gray"
        elif kind.name == "yuv411p":  # its conversion to RGB has other roundings than OpenCV's
            name = "bgr24"
        whole = self._scaler.reformat(frame, format=name, interpolation="BICUBIC", threads=1)
        if name == "gray":
            return np.asarray(whole.to_ndarray())
        plane = whole.planes[0]
        shape = whole.height, whole.width, 4 if alpha else 3
        strides = plane.line_size, shape[2], 1
        # the memory is the picture's own, and goes with it
        image: Any = np.ndarray(shape, np.uint8, buffer=memoryview(plane), strides=strides)
        copied = np.ascontiguousarray(image[..., ::-1] if name == "bgr24" else image)
        # else malloc gives their memory back after each small frame, and the system clears it anew:
        # reading took 1.4 times as long
        self._latest = whole, copied
        return copied


def oddly_shown(frame: Any) -> str:
    """Return a note if a picture is to be shown mirrored or tilted, which is not done, or ""."""
    a, b, c, d = _matrix(frame)
    if a * d - b * c < 0:
        return "it is to be shown mirrored, which is not done; re-encode it upright"
    if (a or d) and (b or c):
        return "it is to be shown tilted, which is not done; re-encode it upright"
    return ""


def _matrix(frame: Any) -> tuple[int, ...]:
    """Return a, b, c, d of the display matrix of a picture [1/65536]."""
    found = frame.side_data.get("DISPLAYMATRIX")
    if found is None:
        return 65536, 0, 0, 65536
    a, b, _, c, d, *_ = struct.unpack("=9i", bytes(found))
    return a, b, c, d


def _signs(frame: Any) -> tuple[int, ...]:
    return tuple((each > 0) - (each < 0) for each in _matrix(frame))


def _deep(frame: Any, bits: int, matrix: int, *, rgb: bool) -> NDArray[np.uint16]:
    planes = _planes(frame)
    top = (1 << bits) - 1
    if len(planes) == 1:
        return _rounded(planes[0] * np.float32(1 / top))
    there = planes[3:]
    if rgb:
        image = cv2.merge([planes[2], planes[0], planes[1], *there])
        return _rounded(image * np.float32(1 / top))
    image = rgb_of_planes(planes, matrix, bits, full=int(frame.color_range) == _FULL)
    return _rounded(np.dstack([image, *(plane / top for plane in there)]))


def _rounded(image: NDArray[Any]) -> NDArray[np.uint16]:
    return np.asarray(np.rint(np.clip(image, 0, 1) * 65535), np.uint16)


def _planes(frame: Any) -> list[NDArray[np.float32]]:
    """Return the planes: luma and two chromas, or green, blue and red, and alpha; or grey."""
    parts = frame.format.components
    # shared by interleaved samples, or not in the lowest bits: laid out anew, the same samples
    if len(frame.planes) < len(parts) or frame.format.name.startswith(("p0", "p2", "p4")):
        frame = frame.reformat(format=_planar(frame, parts[0].bits))
    sample = np.dtype(">u2" if frame.format.is_big_endian else "<u2")
    planes = []
    for plane in frame.planes[: len(frame.format.components)]:
        rows = np.frombuffer(plane, sample).reshape(plane.height, -1)
        planes.append(rows[:, : plane.width].astype(np.float32))
    return planes


def _planar(frame: Any, bits: int) -> str:
    alpha = "a" if frame.format.components[-1].is_alpha else ""
    if frame.format.is_rgb or len(frame.format.components) < 3:
        return f"gbr{alpha}p16le"
    luma, chroma = frame.format.components[:2]
    kind = {(False, False): 444, (True, False): 422, (True, True): 420, (False, True): 440}
    halved = luma.width > chroma.width, luma.height > chroma.height
    return f"yuv{alpha}{kind[halved]}p{bits}le"
