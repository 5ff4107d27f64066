"""OpenCV without its own messages, and images from bytes.

OpenCV and the libraries in it print warnings about broken files to the terminal; ours is the one
line that people see.
"""

from __future__ import annotations

import importlib
import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from adv2e.errors import DataError, MissingExtraError
from adv2e.sources.base import Image, Pixels
from adv2e.sources.claims import check_claim

IMAGE_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".pnm", ".pfm"),
    *(".webp", ".hdr", ".exr"),
)
"""Still images that can be read (``.exr`` with the optional package OpenEXR)."""

_PNG_GREY_ALPHA = 4


class _Quiet:
    """Sets what OpenCV prints, for all threads at once: the last to leave sets it back."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._level, self._ffmpeg = 0, False

    def enter(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside == 1:
                self._level = _logging().getLogLevel()
                _logging().setLogLevel(0)
                # read by OpenCV once, when it first opens a video; -8 is AV_LOG_QUIET
                self._ffmpeg = "OPENCV_FFMPEG_LOGLEVEL" in os.environ
                os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

    def leave(self) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                _logging().setLogLevel(self._level)
                if not self._ffmpeg:
                    os.environ.pop("OPENCV_FFMPEG_LOGLEVEL", None)


def _logging() -> Any:
    # OpenCV 5 has cv2.utils.logging, OpenCV 4 has it only as cv2.setLogLevel
    return cv2.utils.logging if hasattr(cv2.utils, "logging") else cv2


_QUIET = _Quiet()


@contextmanager
def quiet() -> Iterator[None]:
    """Keep OpenCV and FFmpeg from printing about the files they open, decode or write."""
    _QUIET.enter()
    try:
        yield
    finally:
        _QUIET.leave()


def rgb_of(image: Any) -> Image:
    """Return an image in OpenCV's channel order as grey or RGB, without alpha."""
    if image.ndim == 2:
        return np.asarray(image)
    if image.shape[2] == 1:
        return np.asarray(image[..., 0])
    if image.dtype == np.float64:  # beyond cvtColor
        return np.ascontiguousarray(image[..., 2::-1])
    code = cv2.COLOR_BGRA2RGB if image.shape[2] == 4 else cv2.COLOR_BGR2RGB
    return np.asarray(cv2.cvtColor(image, code))


def read_image(path: Path) -> Pixels:
    """Return the image in a file, all its bits kept; DataError if it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error
    return decode_image(data, str(path))


def decode_image(data: bytes, label: str) -> Pixels:
    """Return the image in the bytes of a file: grey or RGB, data type as stored, alpha dropped.

    Parameters
    ----------
    data : bytes
        What the file holds.
    label : str
        Name of the file, for messages; its suffix tells EXR from the rest.

    Raises
    ------
    DataError
        If it is not an image that can be read, or not all of it is there.
    MissingExtraError
        For EXR without the optional package.
    """
    if label.lower().endswith(".exr"):
        return Pixels(_decode_exr(data, label))
    check_claim(data, label)
    image: Any = None
    if data and _is_whole(data):
        try:
            with quiet():
                image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error as error:
            if error.code == cv2.Error.StsNoMem:
                raise MemoryError(f"{label}: {error.err}") from error
            image = None
    if image is None:
        raise DataError(f"{label}: not an image that can be read, or damaged")
    if data.startswith(b"\x89PNG") and data[25] == _PNG_GREY_ALPHA:
        image = image[..., 0]  # OpenCV repeats the grey of grey+alpha three times
    return Pixels(rgb_of(image))


def _is_whole(data: bytes) -> bool:
    # OpenCV 4 fills the missing part of a cut JPEG with grey; after the last scan begins, the end
    # marker cannot occur within the picture's data
    return not data.startswith(b"\xff\xd8") or data.find(b"\xff\xd9", data.rfind(b"\xff\xda")) > 0


def _decode_exr(data: bytes, label: str) -> Image:
    # not through OpenCV: its wheels differ in whether they read EXR at all
    try:
        openexr: Any = importlib.import_module("OpenEXR")
    except ImportError as error:
        raise MissingExtraError(f"{label}: reading EXR", "exr") from error
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "image.exr"  # the package reads only files
        copy.write_bytes(data)
        try:
            with openexr.File(str(copy)) as file:
                channels = {name: channel.pixels for name, channel in file.channels().items()}
        except (RuntimeError, ValueError) as error:
            raise DataError(f"{label}: not an image that can be read, or damaged") from error
    for name in ("RGB", "RGBA", "Y"):
        if name in channels:
            image = np.asarray(channels[name], dtype=np.float32)
            return np.ascontiguousarray(image[..., :3]) if image.ndim == 3 else image
    raise DataError(f"{label}: EXR without channels R, G, B or Y; it has {', '.join(channels)}")
