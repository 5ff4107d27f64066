"""Files that take pictures one by one: .mp4, .webm, .avi, .gif: a film; .png: a contact sheet."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError, OutputError, UsageError
from adv2e.files.staging import Staging, writing
from adv2e.rendering.styles import Cell, Picture, Style, compose, default_scale, sheet
from adv2e.sources.video.listing import list_pictures
from adv2e.sources.video.opening import opened

# ---- Film files that browsers play, and one without loss, by PyAV.
#
# ========= =============================================== ====================================
# ``.mp4``  H.264                                           everything
# ``.webm`` VP8, in less than half the time of VP9          Chrome, Edge, Firefox, Safari
# ``.avi``  HuffYUV, which loses nothing                    players that use FFmpeg, such as VLC
# ========= =============================================== ====================================
#
# What was written is gone through again: on a full disk not all writers of FFmpeg tell.


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
            if self._file.error is not None:
                raise self._file.error
        self._count += 1

    def _frame(self, picture: Picture) -> av.VideoFrame:
        """Return a picture as the coder takes it: of an odd size, it gains a line."""
        rows, columns = picture.shape[:2]
        if rows % 2 or columns % 2:  # the coder halves the resolution of colour
            picture = np.pad(picture, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge")
        return av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")

    def _open(self, width: int, height: int, **more: str) -> None:
        kind, coder, pixels, options = CODERS[self._path.suffix.lower()]
        # FFmpeg takes parts of names for addresses and patterns
        self._file = _File(self._path, "wb")
        self._container = av.open(self._file, "w", format=kind, options=more)
        self._stream = self._container.add_stream(coder, rate=self._rate, options=options)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = pixels
        if coder == "libvpx":
            self._stream.bit_rate = _VP8_BITS

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
        with suppress(Exception):  # what led here says more
            self._complete()


# ---- Animated GIF, with one palette for all pictures, by PyAV.
#
# FFmpeg's own choice of colours, like OpenCV's, is far off for events: a palette of the style's
# own has them exactly.


MOST_FPS = 50.0
"""Viewers slow films down whose pictures last less than 20 ms."""

_TICK = Fraction(1, 100)
"""Unit of GIF's delays [s]."""


def palette(style: Style) -> NDArray[np.uint8]:
    """Return 256 colours for pictures in `style`: greys, shades of ON and OFF, a colour cube."""
    grey = np.rint(np.linspace(0, 255, 96))
    shades = np.linspace(0, 1, 32)[:, None]
    background = np.array(style.background, np.float64)
    on, off = (np.array(colour, np.float64) for colour in style.colours)
    red, green, blue = np.meshgrid(
        np.linspace(0, 255, 4), np.linspace(0, 255, 6), np.linspace(0, 255, 4), indexing="ij"
    )
    parts = [
        np.stack([grey] * 3, axis=1),
        background + shades * (on - background),
        background + shades * (off - background),
        np.stack([red.ravel(), green.ravel(), blue.ravel()], axis=1),
    ]
    colours: NDArray[np.uint8] = np.rint(np.concatenate(parts)).astype(np.uint8)
    return colours


class GifFile(VideoFile):
    """A GIF film that repeats for ever, written picture by picture.

    Raises
    ------
    UsageError
        `fps` is above ``MOST_FPS``.
    NotWritten
        The file cannot be written.
    """

    def __init__(self, path: Path, fps: float, style: Style) -> None:
        if fps > MOST_FPS:
            raise UsageError(f"a GIF shows at most {MOST_FPS:g} pictures a second, not {fps:g}")
        super().__init__(path, fps)
        colours = palette(style)
        self._nearest = _nearest(colours)
        self._argb = np.insert(colours, 0, 255, axis=1)

    def _open(self, width: int, height: int, **more: str) -> None:
        last = f"{self._ticks(1)}"
        super()._open(width, height, loop="0", final_delay=last, **more)
        self._stream.codec_context.time_base = _TICK

    def _frame(self, picture: Picture) -> av.VideoFrame:
        coarse = (picture >> 2).astype(np.int64)
        index = self._nearest[(coarse[..., 0] << 12) | (coarse[..., 1] << 6) | coarse[..., 2]]
        # PyAV's annotation lacks palettes, its documentation has them
        frame = av.VideoFrame.from_ndarray((index, self._argb), format="pal8")  # type: ignore[arg-type]
        frame.time_base, frame.pts = _TICK, self._ticks(self._count)
        return frame

    def _ticks(self, pictures: int) -> int:
        return round(pictures / self._rate / _TICK)  # errors of rounding do not add up


def _nearest(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the palette entry nearest to each colour of 6 bits a channel, (2**18,)."""
    # the two ends of the 64 levels stand for 0 and 255 exactly
    level = np.rint(np.arange(64) * (255 / 63)).astype(np.float32)
    green, blue = np.meshgrid(level, level, indexing="ij")
    entries = colours.astype(np.float32)
    size = np.sum(entries**2, axis=1)
    found = np.empty((64, 4096), np.uint8)
    for number, red in enumerate(level):
        plane = np.stack([np.full(4096, red), green.ravel(), blue.ravel()], axis=1)
        found[number] = np.argmin(size - 2 * (plane @ entries.T), axis=1)
    return found.ravel()


# ---- One picture or film on its way to its final name.


class NotWritten(OutputError):
    """A picture or film could not be written; says how, and leaves out where."""


@contextmanager
def replacing(path: Path, overwrite: bool, staging: Staging | None = None) -> Iterator[Path]:
    """Give the body a temporary name with the suffix of `path`; rename when it ends well.

    If the body raises, what it wrote is removed and `path` stays as it was.  `staging` takes the
    file together with others, and says whether what exists is replaced.

    Raises
    ------
    OutputError
        `path` exists and `overwrite` is false, or it cannot be a file, or cannot be written.
    """
    with Staging(overwrite) if staging is None else nullcontext(staging) as files:
        part = files.file(path)
        try:
            with writing(path):
                files.prepare()
                yield part
        except NotWritten as error:
            raise OutputError(f"{path}: {error}") from error


SUFFIXES = (*CODERS, ".png")
"""The kinds of file there are."""


def check_suffix(path: str | Path) -> str:
    """Return the suffix of `path` in small letters.

    Raises
    ------
    UsageError
        It is none of ``SUFFIXES``.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError(f"{path}: a film ends in .mp4, .webm, .avi or .gif, a picture in .png")
    return suffix


class Film:
    """Cells as a film, each shown for 1/fps."""

    whole = True
    """Every event is to be in a picture, the last one included."""

    def __init__(self, path: Path, fps: float, style: Style, scale: int | None) -> None:
        self._style, self._scale = style, scale
        is_gif = check_suffix(path) == ".gif"
        self._file = GifFile(path, fps, style) if is_gif else VideoFile(path, fps)

    def wanted_from(self, number: int) -> int:
        """Return the first instant, counted from 0, at or after `number` that is shown: that."""
        return number

    def add(self, number: int, cell: Cell) -> None:
        scale = self._scale or default_scale(cell.panels[0].shape[1])
        self._file.add(compose(cell, scale, self._style))

    def finish(self) -> None:
        self._file.finish()

    def close(self) -> None:
        self._file.close()


def write_png(path: Path, picture: Picture) -> None:
    """Write a picture as PNG; NotWritten if it is too large for that."""
    done, data = cv2.imencode(".png", picture[:, :, ::-1])
    if not done:
        raise NotWritten("a .png picture cannot be made of it")
    path.write_bytes(data.tobytes())


_KEPT = 4
"""Most cells that a sheet holds before the end, for each cell that it shows."""


class Sheet:
    """Cells as one picture: at most `count` of them, spread over however many come.

    While it is not known how many will come, more are held than shown.
    """

    whole = False

    def __init__(self, path: Path, count: int, style: Style, scale: int | None) -> None:
        self._path, self._count = path, count
        self._style, self._scale = style, scale
        self._cells: dict[int, Cell] = {}
        self._stride = 1

    def wanted_from(self, number: int) -> int:
        """Return the first instant at or after `number` on the grid that is kept now."""
        return -(-(number + 1) // self._stride) * self._stride - 1

    def add(self, number: int, cell: Cell) -> None:
        self._cells[number] = cell
        while (number + 1) // self._stride > _KEPT * self._count:
            self._stride *= 2  # so that those held are among those held before
        self._cells = {n: cell for n, cell in self._cells.items() if self.wanted_from(n) == n}

    def finish(self) -> None:
        cells = list(self._cells.values())
        shown = min(self._count, len(cells))
        places = [int((n + 0.5) * len(cells) / shown) for n in range(shown)]  # evenly spread
        write_png(self._path, sheet([cells[place] for place in places], self._style, self._scale))

    def close(self) -> None:
        self._cells.clear()


PictureOutput = Film | Sheet
"""Output of pictures that takes cells one by one."""
