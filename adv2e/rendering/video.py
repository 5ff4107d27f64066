"""Film files that browsers play, and one without loss, by PyAV; :mod:`.gif` adds GIF.

========= =============================================== ====================================
``.mp4``  H.264                                           everything
``.webm`` VP8, in less than half the time of VP9          Chrome, Edge, Firefox, Safari
``.avi``  HuffYUV, which loses nothing                    players that use FFmpeg, such as VLC
========= =============================================== ====================================

What was written is gone through again: on a full disk not all writers of FFmpeg tell.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from adv2e.errors import DataError
from adv2e.rendering.output import NotWritten
from adv2e.rendering.styles import Picture
from adv2e.sources.video.listing import list_pictures
from adv2e.sources.video.opening import opened

_H264 = {"preset": "veryfast", "crf": "12", "x264-params": "chroma-qp-offset=-6:mbtree=0"}
"""Colour is finer than usual, so that single pixels stay red and blue; with mbtree, the same
pictures do not always give the same film."""
_VP8 = {"deadline": "realtime", "cpu-used": "4", "crf": "4", "qmin": "0", "qmax": "12"}
_VP8_BITS = 200_000_000
"""Bits a second that VP8 may take: quality alone decides."""

CODERS: dict[str, tuple[str, str, str, dict[str, str]]] = {
    ".mp4": ("mp4", "libx264", "yuv420p", _H264),
    ".webm": ("webm", "libvpx", "yuv420p", _VP8),
    ".avi": ("avi", "huffyuv", "rgb24", {}),
    ".gif": ("gif", "gif", "pal8", {}),
}
"""By suffix: container, coder, kind of pixels, and options of the coder."""


class _File(io.FileIO):
    """A file that keeps its first error: PyAV prints those that come to it while it has one."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of the bytes, or nothing more after an error."""
        left = memoryview(data).cast("B")
        try:
            while self.error is None and left.nbytes:
                left = left[super().write(left) :]
        except OSError as error:
            self.error = error
        return len(data)


@contextmanager
def _writing() -> Iterator[None]:
    try:
        yield
    except (OSError, av.error.FFmpegError) as error:
        reason = getattr(error, "strerror", None) or error
        raise NotWritten(f"a video cannot be written there: {reason}") from error


class VideoFile:
    """A film in a file of its suffix, written picture by picture.

    Raises
    ------
    NotWritten
        The file cannot be written.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path = path
        self._rate = Fraction(fps).limit_denominator(1_000_000)
        self._file: Any = None
        self._container: Any = None
        self._stream: Any = None
        self._count = self._size = 0

    def add(self, picture: Picture) -> None:
        """Append a picture (rows, columns, 3), RGB, all of one size."""
        frame = self._frame(picture)
        with _writing():
            if self._container is None:
                self._open(frame.width, frame.height)
            self._container.mux(self._stream.encode(frame))
            self._check()
        self._count += 1

    def _frame(self, picture: Picture) -> av.VideoFrame:
        """Return a picture as the coder takes it: of an odd size, it gains a line."""
        rows, columns = picture.shape[:2]
        if rows % 2 or columns % 2:  # the coder halves the resolution of colour
            picture = np.pad(picture, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge")
        return av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")

    def _open(self, width: int, height: int, **more: str) -> None:
        """Open the file for pictures of a size, with `more` options of the container."""
        kind, coder, pixels, options = CODERS[self._path.suffix.lower()]
        # FFmpeg takes parts of names for addresses and patterns
        self._file = _File(self._path, "wb")
        self._container = av.open(self._file, "w", format=kind, options=more)
        self._stream = self._container.add_stream(coder, rate=self._rate, options=options)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = pixels
        if coder == "libvpx":
            self._stream.bit_rate = _VP8_BITS

    def _check(self) -> None:
        if self._file.error is not None:
            raise self._file.error

    def finish(self) -> None:
        """Complete the file and check that it holds all pictures."""
        self._complete()
        held = 0
        with suppress(DataError), opened(str(self._path)) as film:
            found = list_pictures(film)
            held = 0 if found.faults or film.size != self._size else found.count
        if held != self._count:
            raise NotWritten(f"holds {held} of {self._count} pictures (is the disk full?)")

    def _complete(self) -> None:
        container, file = self._container, self._file
        self._container = self._file = None
        if file is not None:
            with _writing(), file, container or nullcontext():
                if container is not None:
                    container.mux(self._stream.encode())
                    container.close()
                if file.error is not None:
                    raise file.error
                self._size = file.seek(0, 2)

    def close(self) -> None:
        """Let go of the file, complete or not."""
        with suppress(Exception):  # what led here says more
            self._complete()
