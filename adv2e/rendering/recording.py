"""Films and contact sheets: of a whole recording, or of a stream in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from adv2e.errors import DataError, OutputError
from adv2e.events import cut
from adv2e.files.staging import Staging
from adv2e.files.states import check_distinct
from adv2e.light.pictures import drawn_frame
from adv2e.options import FilmOptions, RenderedPart, chosen, takes
from adv2e.process import bars
from adv2e.rendering.films import Film, PictureOutput, Sheet, check_suffix, replacing, write_png
from adv2e.rendering.rate import Rates, rate_picture
from adv2e.rendering.styles import RATE, Style
from adv2e.rendering.timeline import Caption, Timeline, caption
from adv2e.ticks import microseconds

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from adv2e.formats.reading import Recording


_CHUNK = 1 << 18  # events handed on at once where no frames divide them
_RATE_BINS = 300


@takes(RenderedPart)
def render_recording(
    recording: Recording,
    path: str | Path,
    *,
    style: Style | None = None,
    frames: bool = True,
    caption: Caption = caption,
    **options: Unpack[RenderedPart],
) -> None:
    """Write a film (.mp4, .webm, .avi, .gif) or a contact sheet (.png) of `recording`.

    Parameters
    ----------
    path : str or Path
        Output.
    style, frames, caption
        See :func:`open_preview`.
    **options
        See :class:`adv2e.options.RenderedPart`.

    Raises
    ------
    DataError
        The recording holds no events and no frames, or none in the part to show; or a film has too
        many pictures.
    OutputError, UsageError
        See :func:`open_preview`.
    """
    at_s, most = options["at_s"], options["max_pictures"]
    check_distinct(path, recording.inputs)
    has_frames = recording.frame_times_ns is not None and recording.frame_times_ns.size > 0
    if not (len(recording) or has_frames):
        raise DataError(f"{recording.path}: holds no events and no frames")
    begin_us, last_us = recording.span_us
    lasts = f"{recording.path}: lasts {(last_us + 1 - begin_us) * 1e-6:.3f} s"
    frames = frames and has_frames
    if not (recording.width and recording.height):
        raise DataError(f"{recording.path}: nothing tells how large the sensor is")
    first_us, until_us = part_shown(recording, options["start_s"], options["stop_s"])
    if style is not None and style.name == RATE:
        rates = Rates(first_us, until_us, _RATE_BINS, style.window_us)
        rates.add(cut(recording.events, first_us, until_us))
        with replacing(Path(path), options["overwrite"]) as unfinished:
            write_png(unfinished, rate_picture(rates, begin_us, style, options["scale"] or 1))
        return
    instants: list[int] = []
    if Path(path).suffix.lower() == ".png":
        instants = [begin_us + round(time * 1e6) for time in sorted(at_s)]
        if instants and instants[-1] > until_us:
            raise DataError(f"{lasts}, the instant {max(at_s):g} s is after the end")
    elif (pictures := (until_us - first_us) * 1e-6 * options["fps"] / options["speed"]) > most:
        number = f"{pictures:,.0f}" if pictures < 1e12 else f"{pictures:.1e}"
        raise DataError(
            f"{lasts}, of which a film has {number} pictures: 'adv2e info' tells gaps that a wrong"
            " time makes; --start, --stop and --speed make it shorter, --max-pictures N allows N"
        )
    with open_preview(
        path,
        recording.width,
        recording.height,
        style=style,
        instants_us=instants or None,
        start_us=first_us,
        frames=frames,
        caption=lambda since_us, shown: caption(since_us + first_us - begin_us, shown),
        **chosen(FilmOptions, options),
    ) as preview:
        _feed(preview, recording, first_us, until_us, frames, options["progress"])


def part_shown(
    recording: Recording, start_s: float | None, stop_s: float | None
) -> tuple[int, int]:
    """Return when the part to show begins and ends, half open [us]; DataError if it is empty."""
    begin_us, last_us = recording.span_us
    first_us, until_us = begin_us + round((start_s or 0.0) * 1e6), last_us + 1
    lasts_s = (until_us - begin_us) * 1e-6
    if stop_s is not None:
        until_us = min(until_us, begin_us + round(stop_s * 1e6))
    if first_us >= until_us:
        raise DataError(
            f"{recording.path}: lasts {lasts_s:.3f} s, nothing is left from {start_s or 0:g} s on"
        )
    return first_us, until_us


def _feed(
    preview: Timeline,
    recording: Recording,
    first_us: int,
    until_us: int,
    frames: bool,
    progress: bool,
) -> None:
    """Hand on the part to show: each frame, then the events before it."""
    events = recording.events
    begin, end = np.searchsorted(events["t"], [first_us, until_us])
    total = int(end - begin)
    with bars.bar(total=total, unit="event", unit_scale=True, disable=not progress) as bar:
        for frame, t_us in _frames(recording, until_us, frames):
            if frame is None:
                preview.no_more_frames()
            else:
                preview.add_frame(frame.t_ns, drawn_frame(frame, recording.encoding))
            stop = max(begin, np.searchsorted(events["t"][:end], t_us))
            for low, high in pairwise([*range(begin, stop, _CHUNK), stop]):
                preview.add_events(events[low:high])
                bar.update(high - low)
            begin = stop


def _frames(recording: Recording, until_us: int, frames: bool) -> Iterator[tuple[Any, int]]:
    """Yield each frame before `until_us` and its time; then None and `until_us`."""
    if frames:
        for frame in recording.frames():
            t_us = microseconds(frame.t_ns)
            if t_us >= until_us:
                break
            yield frame, t_us
    yield None, until_us


# ---- A stream of events and frames as a film or a contact sheet, in bounded memory.


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
    """Yield a timeline that takes events and frames, and write a film or a contact sheet of them.

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
