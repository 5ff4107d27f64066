"""Film files that browsers play, and one without loss.

========= ============================================== ========================================
``.mp4``  H.264 where PyAV is installed, else VP9        Chrome, Edge, Firefox; H.264: everywhere
``.webm`` VP8, in less than half the time of VP9         Chrome, Edge, Firefox, Safari
``.avi``  HuffYUV, which loses nothing                   players that use FFmpeg, such as VLC
========= ============================================== ========================================

FFmpeg goes on in silence when the disk is full.  So the index of what was written is read again.
"""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from adv2e.errors import DataError
from adv2e.rendering.output import NotWritten
from adv2e.rendering.styles import Picture
from adv2e.sources.images.opencv import quiet
from adv2e.sources.video.containers import examine
from adv2e.sources.video.opening import openable

CODES = {".mp4": "vp09", ".webm": "VP80", ".avi": "HFYU"}
"""Coders of OpenCV; its VP8 and VP9 are set to lose next to nothing.

Its FFV1 is smaller than HuffYUV, but says that it is transparent.
"""

_H264 = {"preset": "veryfast", "crf": "12", "x264-params": "chroma-qp-offset=-6:mbtree=0"}
"""Colour is finer than usual, so that single pixels stay red and blue; with mbtree, the same
pictures do not always give the same film."""


class _OpenCv:
    """Films by OpenCV."""

    def __init__(self, path: Path, fps: float, width: int, height: int) -> None:
        code = CODES[path.suffix.lower()]
        with quiet(), _unprinted(), openable(path) as name:
            fourcc = cv2.VideoWriter.fourcc(*code)
            self._writer = cv2.VideoWriter(name, cv2.CAP_FFMPEG, fourcc, fps, (width, height))
        if not self._writer.isOpened():
            raise NotWritten(f"a video ({code}) cannot be written there")

    def add(self, picture: Picture) -> None:
        with quiet():
            self._writer.write(np.ascontiguousarray(picture[:, :, ::-1]))

    def close(self) -> None:
        with quiet():
            self._writer.release()


class _PyAv:
    """Films in H.264 by PyAV."""

    def __init__(self, path: Path, fps: float, width: int, height: int) -> None:
        self._av: Any = importlib.import_module("av")
        self._name = ExitStack()
        name = self._name.enter_context(openable(path))
        self._container: Any = self._av.open(f"file:{name}", "w", format="mp4")
        rate = Fraction(fps).limit_denominator(1_000_000)
        self._stream: Any = self._container.add_stream("libx264", rate=rate, options=_H264)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = "yuv420p"
        self._closed = False

    def add(self, picture: Picture) -> None:
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        with _writing():
            self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            with _writing(), self._name, closing(self._container):
                self._container.mux(self._stream.encode())


@contextmanager
def _writing() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise NotWritten(f"a video cannot be written there: {error.strerror}") from error


@lru_cache(maxsize=1)
def writes_h264() -> bool:
    """Tell whether PyAV is there, with the coder of H.264."""
    try:
        return "libx264" in importlib.import_module("av").codecs_available
    except ImportError:
        return False


class VideoFile:
    """A film in an .mp4, .webm or .avi file, written picture by picture.

    Raises
    ------
    NotWritten
        The file cannot be written.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._coder: _OpenCv | _PyAv | None = None
        self._count = 0

    def add(self, picture: Picture) -> None:
        """Append a picture (rows, columns, 3), RGB, all of one size; odd sizes gain a line."""
        rows, columns = picture.shape[:2]
        if rows % 2 or columns % 2:  # the coder halves the resolution of colour
            picture = np.pad(picture, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge")
        if self._coder is None:
            coder = _PyAv if self._path.suffix.lower() == ".mp4" and writes_h264() else _OpenCv
            self._coder = coder(self._path, self._fps, picture.shape[1], picture.shape[0])
        self._coder.add(picture)
        self._count += 1

    def finish(self) -> None:
        """Complete the file and check that it holds all pictures."""
        if self._coder is not None:
            self._coder.close()
        held: int | None = 0
        try:
            index = examine(self._path)
            held = index.pictures if index.stamps_ns is None else len(index.stamps_ns)
        except DataError:
            pass
        if held != self._count:
            raise NotWritten(f"holds {held or 0} of {self._count} pictures (is the disk full?)")

    def close(self) -> None:
        """Let go of the file, complete or not."""
        if self._coder is not None:
            with suppress(Exception):  # what led here says more
                self._coder.close()


@contextmanager
def _unprinted() -> Iterator[None]:
    """Leave out what OpenCV prints on its way around its logging; other lines come after it."""
    try:
        stderr = os.dup(2)
    except OSError:  # there is none
        yield
        return
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            file.seek(0)
            for line in file:
                if not line.startswith(b"OpenCV: FFMPEG:"):
                    os.write(2, line)
