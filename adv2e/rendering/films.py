"""Files that take pictures one by one: .mp4, .avi, .gif hold a film, .png a contact sheet."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Protocol

import cv2
import numpy as np

from adv2e.errors import UsageError
from adv2e.rendering.gif import GifWriter, palette
from adv2e.rendering.layout import Cell, compose, default_scale, sheet
from adv2e.rendering.output import NotWritten
from adv2e.rendering.styles import Picture, Style

CODES = {".mp4": "mp4v", ".avi": "FFV1"}
"""Coders of video files: MPEG-4 part 2, which loses a little, and FFV1, which loses nothing."""

SUFFIXES = (*CODES, ".gif", ".png")
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
        raise UsageError(f"{path}: a film ends in .mp4, .avi or .gif, a picture in .png")
    return suffix


class Album(Protocol):
    """Takes cells one by one."""

    def wants(self, number: int) -> bool:
        """Tell whether the cell of instant `number`, counted from 0, would be kept."""

    def add(self, number: int, cell: Cell) -> None:
        """Take the cell of instant `number`."""

    def finish(self) -> None:
        """Complete the file."""

    def close(self) -> None:
        """Let go of the file."""


class VideoFile:
    """A film in an .mp4 or .avi file, written picture by picture.

    Raises
    ------
    NotWritten
        The file cannot be written.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)
        self._count = 0

    def add(self, picture: Picture) -> None:
        """Append a picture (rows, columns, 3), RGB, all of one size; odd sizes gain a line."""
        rows, columns = picture.shape[:2]
        if rows % 2 or columns % 2:  # the coder halves the resolution of colour
            picture = np.pad(picture, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge")
        if self._writer is None:
            self._size = (picture.shape[1], picture.shape[0])
            code = cv2.VideoWriter.fourcc(*CODES[self._path.suffix.lower()])
            self._writer = cv2.VideoWriter(str(self._path), code, self._fps, self._size)
            if not self._writer.isOpened():
                raise NotWritten("a video cannot be written there")
        self._writer.write(np.ascontiguousarray(picture[:, :, ::-1]))
        self._count += 1

    def finish(self) -> None:
        """Complete the file and check that it holds all pictures."""
        self.close()
        written = cv2.VideoCapture(str(self._path))
        held = int(written.get(cv2.CAP_PROP_FRAME_COUNT)) if written.isOpened() else 0
        written.release()
        if held != self._count:
            raise NotWritten(f"holds {held} of {self._count} pictures (is the disk full?)")

    def close(self) -> None:
        """Let go of the file."""
        if self._writer is not None:
            self._writer.release()

    def __enter__(self) -> VideoFile:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.finish()
        else:
            self.close()


class Film:
    """Cells as a film, each shown for 1/fps."""

    def __init__(self, path: Path, fps: float, style: Style, scale: int | None) -> None:
        self._style, self._scale = style, scale
        self._file: VideoFile | GifWriter
        if check_suffix(path) == ".gif":
            self._file = GifWriter(path, fps, palette(style))
        else:
            self._file = VideoFile(path, fps)

    def wants(self, number: int) -> bool:
        """Tell that every cell is shown."""
        return True

    def add(self, number: int, cell: Cell) -> None:
        """Append the cell."""
        scale = self._scale or default_scale(cell.panels[0].shape[1])
        self._file.add(compose(cell, scale, self._style))

    def finish(self) -> None:
        """Complete the file."""
        self._file.finish()

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


class Sheet:
    """Cells as one picture: at most `count` of them, spread evenly over however many come.

    At most 2 `count` cells are kept: when there are more, every second one is dropped, and from
    then on only every second one is wanted.
    """

    def __init__(self, path: Path, count: int, style: Style, scale: int | None) -> None:
        self._path, self._count = path, count
        self._style, self._scale = style, scale
        self._cells: list[tuple[int, Cell]] = []
        self._stride = 1

    def wants(self, number: int) -> bool:
        """Tell whether instant `number` is on the grid that is kept now."""
        return number % self._stride == 0

    def add(self, number: int, cell: Cell) -> None:
        """Take the cell."""
        self._cells.append((number, cell))
        if len(self._cells) > 2 * self._count:
            self._stride *= 2
            self._cells = [item for item in self._cells if self.wants(item[0])]

    def finish(self) -> None:
        """Choose the cells and write the picture."""
        count = min(self._count, len(self._cells))
        places = (np.arange(count) + 0.5) * len(self._cells) / count
        cells = [self._cells[int(place)][1] for place in places]
        picture = sheet(cells, self._style, self._scale)
        if not cv2.imwrite(str(self._path), picture[:, :, ::-1]):
            raise NotWritten("a .png picture cannot be written there")

    def close(self) -> None:
        """Forget the cells."""
        self._cells.clear()
