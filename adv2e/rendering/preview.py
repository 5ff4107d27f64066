"""A stream of events and frames as a film or a contact sheet, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

from numpy.typing import NDArray

from adv2e.errors import OutputError
from adv2e.events import Events
from adv2e.files.staging import Staging
from adv2e.rendering.films import Album, Film, Sheet, check_suffix
from adv2e.rendering.output import replacing
from adv2e.rendering.styles import Style
from adv2e.rendering.timeline import Caption, Timeline, caption

SHEET_STEP_US = 1000
"""Instants between which a sheet chooses, at first; later they are further apart."""


class Preview:
    """Writes a film (.mp4, .webm, .avi, .gif) or a sheet (.png) of events and frames as they come.

    Events are sorted and so are frames; which of them come first, and in which pieces, makes no
    difference.  Leaving the ``with`` block normally completes the file; an exception leaves none.

    Parameters
    ----------
    path : Path
        Output; its suffix says what.
    width, height : int
        Size of the sensor [pixels].
    style : Style, optional
        Without it, a film draws every event, in one picture, and a sheet windows of 20 ms.
    fps : float
        Pictures a second of a film.
    speed : float
        Recorded seconds a second of film; 0.1 is ten times slower than life.
    count : int
        Most instants on a sheet that is not told which.
    scale : int, optional
        How often a pixel is repeated; by default, panels are made about 640 columns wide.
    overwrite : bool
        Replace a file that exists.
    instants_us, start_us, frames, caption
        See :class:`adv2e.rendering.timeline.Timeline`.
    staging : Staging, optional
        Takes the file together with others; it says whether a file that exists is replaced.

    Raises
    ------
    UsageError
        The suffix is none of .mp4, .webm, .avi, .gif, .png; or the film is too fast for a GIF.
    OutputError
        The file exists or cannot be written; nothing came that could be drawn.
    """

    def __init__(
        self,
        path: str | Path,
        width: int,
        height: int,
        *,
        style: Style | None = None,
        fps: float = 30.0,
        speed: float = 1.0,
        count: int = 6,
        scale: int | None = None,
        overwrite: bool = False,
        instants_us: Sequence[int] | None = None,
        start_us: int | None = None,
        frames: bool | None = None,
        caption: Caption = caption,
        staging: Staging | None = None,
    ) -> None:
        self._path = Path(path)
        self._is_sheet = check_suffix(self._path) == ".png"
        self._step_us = SHEET_STEP_US if self._is_sheet else max(1.0, 1e6 * speed / fps)
        self._style = style or (
            Style() if self._is_sheet else Style(window_us=round(self._step_us))
        )
        self._fps, self._scale = fps, scale
        self._count = count if instants_us is None else len(instants_us)
        self._file = self._opened(overwrite, staging)
        self._size = (width, height)
        self._timing: dict[str, Any] = {
            "instants_us": instants_us,
            "start_us": start_us,
            "frames": frames,
            "caption": caption,
        }

    @contextmanager
    def _opened(self, overwrite: bool, staging: Staging | None) -> Iterator[Album]:
        """Open the file under a temporary name; finish it, or leave nothing."""
        with replacing(self._path, overwrite, staging) as unfinished:
            album: Album
            if self._is_sheet:
                album = Sheet(unfinished, self._count, self._style, self._scale)
            else:
                album = Film(unfinished, self._fps, self._style, self._scale)
            try:
                self._timeline = Timeline(
                    album,
                    self._size,
                    self._style,
                    step_us=self._step_us,
                    folder=unfinished.parent,
                    **self._timing,
                )
                with closing(self._timeline):
                    yield album
                    if not self._timeline.finish():
                        raise OutputError(f"{self._path}: there are no events or frames to draw")
                album.finish()
            finally:
                album.close()  # before the file is removed: Windows keeps open files

    def __enter__(self) -> Preview:
        self._file.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.__exit__(kind, error, trace)

    def add_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Take a frame (rows, columns) or (rows, columns, 3), 8 or 16 bit, of time `t_ns` [ns]."""
        self._timeline.add_frame(t_ns, image)

    def add_events(self, events: Events) -> None:
        """Take events, sorted, not before those of earlier calls; there may be none."""
        self._timeline.add_events(events)

    def complete_until(self, t_us: int) -> None:
        """Take notice that no event before `t_us` will come any more; spares memory and disk."""
        self._timeline.complete_until(t_us)

    def no_more_frames(self) -> None:
        """Take notice that no frame will come any more; spares memory and disk."""
        self._timeline.no_more_frames()
