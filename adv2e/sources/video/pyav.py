"""Videos through PyAV (extra ``video``): fields, more than 8 bits, high dynamic range.

Codes of 8 bits come from the same conversion as OpenCV's.  Deeper ones are converted here, as that
conversion is off by several codes of 10 bits: with the matrix and range of the stream, to whole
numbers of 16 bits.
"""

from __future__ import annotations

import importlib
from collections import deque
from fractions import Fraction
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError, MissingExtraError
from adv2e.sources.video.colours import UNSTATED, is_stated
from adv2e.sources.video.opening import openable
from adv2e.sources.video.ycbcr import SHARES, bgr_of

_FULL = 2
_TURNS = {90: cv2.ROTATE_90_COUNTERCLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_CLOCKWISE}


_ATTEMPTS = 64
"""Damaged pictures in a row that are passed over in search of the next, as OpenCV does."""

_FIRST = 17
"""First release of PyAV that converts by the matrix of the stream, not by that of BT.601."""


def is_installed() -> bool:
    """Tell whether PyAV is, in a release that can be used."""
    try:
        _import()
    except ImportError:
        return False
    return True


def _import() -> Any:
    av: Any = importlib.import_module("av")
    if int(av.__version__.partition(".")[0]) < _FIRST:
        raise ImportError(f"PyAV {av.__version__} is too old")
    return av


class PyavCapture:
    """Reads frames as `cv2.VideoCapture` does, with as much of its interface as is needed.

    Parameters
    ----------
    path : str
        The video.
    why : str
        What it needs PyAV for; begins the message if that is not installed.
    threads : int
        Threads that may decode.
    matrix : int
        Code of ITU-T H.273 for the matrix of pictures that do not state theirs.

    Attributes
    ----------
    spoilt : int
        Pictures grabbed in which the decoder met errors, and guessed.
    has_fields : bool
        A picture grabbed so far is two fields.
    """

    def __init__(self, path: str, why: str, threads: int = 1, matrix: int = UNSTATED) -> None:
        try:
            self._av: Any = _import()
        except ImportError as error:
            raise MissingExtraError(f"{path}: {why}; reading that", "video") from error
        self._path, self._matrix = path, matrix
        try:
            with openable(path) as name:
                self._file: Any = self._av.open(name, metadata_errors="replace")
            self._stream: Any = self._file.streams.best("video")
        except self._av.error.FFmpegError as error:
            raise DataError(f"{path}: not a video that can be read, or damaged") from error
        if self._stream is None:
            raise DataError(f"{path}: not a video that can be read, or damaged")
        self._stream.thread_type = "AUTO" if threads > 1 else "SLICE"
        self._stream.codec_context.thread_count = threads
        self._packets = self._file.demux(self._stream)
        self._ready: deque[Any] = deque()
        self._frame: Any = None
        self.has_fields = False
        self.spoilt = 0

    def release(self) -> None:
        """Close the file."""
        self._ready.clear()
        self._frame = None
        self._file.close()

    def grab(self) -> bool:
        """Decode the next picture; False at the end, and where too many in a row are damaged."""
        for _ in range(_ATTEMPTS):
            try:
                while not self._ready:
                    self._ready.extend(next(self._packets).decode())
            except StopIteration:
                return False
            except self._av.error.FFmpegError:
                continue
            self._frame = self._ready.popleft()
            self.spoilt += self._frame.is_corrupt
            self.has_fields |= self._frame.interlaced_frame
            return True
        return False

    def get(self, _: int) -> float:
        """Return the time of the picture grabbed, as OpenCV's POS_MSEC [ms]; 0: unknown."""
        # not the time of decoding: unlike OpenCV's it is that of the picture's own packet
        if self._frame.pts is None:
            return 0.0
        ticks = self._frame.pts - (self._stream.start_time or 0)
        return float(ticks * 1000 * Fraction(self._stream.time_base))

    @property
    def transfer(self) -> int:
        """Code of ITU-T H.273 for the transfer of what was decoded."""
        return int(self._stream.codec_context.color_trc)

    def retrieve(self) -> tuple[bool, NDArray[Any]]:
        """Return the picture grabbed, as BGR or grey, of uint8 or uint16, turned upright."""
        try:
            image = codes_of(self._frame, self._matrix)
        except (ValueError, OSError) as error:
            raise DataError(f"{self._path}: {error}") from error
        turn = _TURNS.get(round(self._frame.rotation) % 360)
        return True, image if turn is None else np.asarray(cv2.rotate(image, turn))


def codes_of(frame: Any, matrix: int = UNSTATED) -> NDArray[Any]:
    """Return the codes of a frame of PyAV as (rows, columns, 3) BGR, or (rows, columns).

    White is 255 or 65535.  Where pixels can be transparent, how much of each is there is a fourth
    number.  `matrix` is that of frames that do not state theirs.

    Raises
    ------
    ValueError
        Its pixels cannot be converted.
    """
    parts = frame.format.components
    bits = parts[0].bits
    matrix = int(frame.colorspace) if is_stated(int(frame.colorspace)) else matrix
    alpha = parts[-1].is_alpha
    rgb = frame.format.is_rgb or len(parts) - alpha < 3
    if not rgb and matrix not in SHARES:
        raise ValueError(f"colours by the matrix {frame.colorspace} cannot be read")
    if bits > 16 or frame.format.name.startswith(("xyz", "bayer", "grayf", "gbrpf", "rgbf")):
        raise ValueError(f"pixels of {frame.format.name} cannot be read")
    if bits <= 8:
        if len(parts) == 1 and not frame.format.has_palette:
            return np.asarray(frame.to_ndarray(format="gray"))
        return np.asarray(frame.to_ndarray(format="bgra" if alpha else "bgr24"))
    planes = _planes(frame)
    top = (1 << bits) - 1
    if len(planes) == 1:
        return _rounded(planes[0] * np.float32(1 / top))
    there = planes[3:]
    if rgb:
        bgr = cv2.merge([planes[1], planes[0], planes[2], *there])
        return _rounded(bgr * np.float32(1 / top))
    image = bgr_of(planes, matrix, bits, full=int(frame.color_range) == _FULL)
    return _rounded(np.dstack([image, *(plane / top for plane in there)]))


def _rounded(image: NDArray[Any]) -> NDArray[Any]:
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
