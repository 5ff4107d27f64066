"""A stream of events and frames as a film or a contact sheet, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from adv2e.errors import OutputError
from adv2e.files.staging import Staging
from adv2e.options import FilmOptions, takes
from adv2e.rendering.films import Film, PictureOutput, Sheet, check_suffix, replacing
from adv2e.rendering.styles import Style
from adv2e.rendering.timeline import Caption, Timeline, caption

if TYPE_CHECKING:
    from typing_extensions import Unpack

SHEET_STEP_US = 1000
"""Instants between which a sheet chooses, at first; later they are further apart."""


@takes(FilmOptions)
@contextmanager
def open_preview(
    path: str | Path,
    width: int,
    height: int,
    *,
    style: Style | None = None,
    instants_us: Sequence[int] | None = None,
    start_us: int | None = None,
    frames: bool | None = None,
    caption: Caption = caption,
    staging: Staging | None = None,
    **options: Unpack[FilmOptions],
) -> Iterator[Timeline]:
    """Give the body what takes events and frames, and write them as a film or a sheet.

    Events are sorted and so are frames; which of them come first, and in which pieces, makes no
    difference.  If the body ends well the file is completed; otherwise there is none.

    Parameters
    ----------
    path : Path
        Output; its suffix says what: .mp4, .webm, .avi, .gif: a film; .png: a sheet.
    width, height : int
        Size of the sensor [pixels].
    style : Style, optional
        Without it, a film draws every event, in one picture, and a sheet windows of 20 ms.
    instants_us, start_us, frames, caption
        See :class:`adv2e.rendering.timeline.Timeline`.
    staging : Staging, optional
        Takes the file together with others; it says whether a file that exists is replaced.
    **options
        See :class:`adv2e.options.FilmOptions`.

    Raises
    ------
    UsageError
        The suffix is none of .mp4, .webm, .avi, .gif, .png; or the film is too fast for a GIF.
    OutputError
        The file exists or cannot be written; nothing came that could be drawn, or too much.
    """
    path = Path(path)
    is_sheet = check_suffix(path) == ".png"
    fps, scale = options["fps"], options["scale"]
    step_us = SHEET_STEP_US if is_sheet else max(1.0, 1e6 * options["speed"] / fps)
    style = style or (Style() if is_sheet else Style(window_us=round(step_us)))
    with replacing(path, options["overwrite"], staging) as unfinished:
        output: PictureOutput
        if is_sheet:
            shown = options["count"] if instants_us is None else len(instants_us)
            output = Sheet(unfinished, shown, style, scale)
        else:
            output = Film(unfinished, fps, style, scale)
        # closed before the file is removed: Windows keeps open files
        with closing(output):
            timeline = Timeline(
                output,
                (width, height),
                style,
                step_us=step_us,
                instants_us=instants_us,
                start_us=start_us,
                frames=frames,
                caption=caption,
                folder=unfinished.parent,
                max_pictures=options["max_pictures"],
            )
            with closing(timeline):
                yield timeline
                if not timeline.finish():
                    raise OutputError(f"{path}: there are no events or frames to draw")
            output.finish()
