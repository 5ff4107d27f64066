"""Files that take pictures one by one: .mp4, .webm, .avi, .gif: a film; .png: a contact sheet."""

from __future__ import annotations

from pathlib import Path

import cv2

from adv2e.errors import UsageError
from adv2e.rendering.gif import GifFile
from adv2e.rendering.layout import Cell, compose, default_scale, sheet
from adv2e.rendering.output import NotWritten
from adv2e.rendering.styles import Style
from adv2e.rendering.video import CODERS, VideoFile

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
        """Append the cell."""
        scale = self._scale or default_scale(cell.panels[0].shape[1])
        self._file.add(compose(cell, scale, self._style))

    def finish(self) -> None:
        """Complete the file."""
        self._file.finish()

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


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
        """Take the cell."""
        self._cells[number] = cell
        while (number + 1) // self._stride > _KEPT * self._count:
            self._stride *= 2  # so that those held are among those held before
        self._cells = {n: cell for n, cell in self._cells.items() if self.wanted_from(n) == n}

    def finish(self) -> None:
        """Choose the cells and write the picture."""
        cells = list(self._cells.values())
        shown = min(self._count, len(cells))
        places = [int((n + 0.5) * len(cells) / shown) for n in range(shown)]  # evenly spread
        picture = sheet([cells[place] for place in places], self._style, self._scale)
        done, data = cv2.imencode(".png", picture[:, :, ::-1])
        if not done:
            raise NotWritten("a .png picture cannot be made of it")
        self._path.write_bytes(data.tobytes())

    def close(self) -> None:
        """Forget the cells."""
        self._cells.clear()


PictureOutput = Film | Sheet
"""Output of pictures that takes cells one by one."""
