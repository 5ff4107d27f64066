"""Pictures and films of events, from a file or an array: what ``adv2e render`` does."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import UsageError
from adv2e.events import checked_events
from adv2e.formats.reading import Recording, read_events
from adv2e.options import EventInput, RenderedPart, RenderOptions, chosen, size_of, takes
from adv2e.process.bars import reading_bar
from adv2e.rendering.films import check_suffix
from adv2e.rendering.recording import render_recording
from adv2e.rendering.styles import RATE, Style, parse_colour

if TYPE_CHECKING:
    from typing_extensions import Unpack

_SHEET_WINDOW_MS = 20.0


@takes(RenderOptions)
def render(
    events: str | Path | Recording | NDArray[Any],
    output: str | Path | None = None,
    *,
    frames: bool | None = None,
    doubt: Callable[[str], None] = lambda text: None,
    **options: Unpack[RenderOptions],
) -> NDArray[np.uint8] | None:
    """Draw a film (.mp4, .webm, .avi, .gif) or a sheet of pictures (.png) of events.

    Parameters
    ----------
    events : str, Path, Recording, or (n,) array of EVENT_DTYPE
        A file, what :func:`adv2e.read_events` returned, or the events themselves.
    output : str or Path, optional
        File to write; its suffix says what to make.  Without one, a sheet is returned.
    frames : bool, optional
        Show the frames beside the events.  Default: where there are any.
    doubt : callable
        Takes lines for people on what is doubtful in a file.
    **options
        See :class:`adv2e.options.RenderOptions`.  An array needs `size`; how to read a file is for
        files alone.

    Returns
    -------
    (rows, columns, 3) array of uint8, or None
        The sheet as RGB, where no file is named.

    Raises
    ------
    DataError
        The events cannot be read, or there are none in the part to show.
    UsageError
        An unknown suffix, style or colour, or options that do not fit together.
    OutputError
        The output exists, or cannot be written.

    Examples
    --------
    >>> import os, tempfile
    >>> import numpy as np
    >>> from adv2e import render, simulate
    >>> frames = [np.full((24, 32), light, np.float32) for light in (0.1, 0.2, 0.4, 0.8)]
    >>> events = np.concatenate(list(simulate(frames, 100)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     render(events, os.path.join(folder, "events.png"), size=(32, 24), count=2)
    ...     os.listdir(folder)
    ['events.png']
    >>> render(events, size=(32, 24), count=1, scale=1).dtype
    dtype('uint8')
    """
    with ExitStack() as stack:
        path = output
        if path is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="adv2e-render-"))
            path = Path(folder) / "events.png"
        style = chosen_style(path, options)
        recording = recording_of(events, reading_of(options), progress=options["progress"])
        for problem in recording.problems:
            doubt(f"{recording.path}: {problem}")
        if frames and recording.frame_times_ns is None:
            doubt(f"{recording.path}: holds no frames to show beside the events")
        shown = chosen(RenderedPart, options)
        render_recording(recording, path, style=style, frames=frames is not False, **shown)
        if output is not None:
            return None
        picture: Any = cv2.imread(str(path))
        return np.ascontiguousarray(picture[:, :, ::-1], np.uint8)


def reading_of(options: EventInput) -> EventInput:
    """Return the options of the reading: a film shows the frame before its start, too."""
    return {**chosen(EventInput, options), "start_s": None, "stop_s": None}


def chosen_style(output: str | Path, options: RenderOptions) -> Style:
    """Return the style of the pictures; parameters and errors as for :func:`render`."""
    is_film = check_suffix(output) != ".png"
    if options["at_s"] and is_film:
        raise UsageError(
            f"{output}: instants (--at) are for a .png; --start and --stop choose part of a film"
        )
    is_rate = options["style"] == RATE
    if is_rate and (is_film or options["at_s"]):
        raise UsageError(f"{output}: --style rate makes one .png, of all the time: leave --at out")
    usual_ms = 1e3 * options["speed"] / options["fps"] if is_film else _SHEET_WINDOW_MS
    usual_us = 0 if is_rate else max(1, round(1e3 * usual_ms))
    window_ms = options["window_ms"]
    return Style(
        name=options["style"],
        on=parse_colour(options["on_color"]),
        off=parse_colour(options["off_color"]),
        window_us=usual_us if window_ms is None else max(1, round(1e3 * window_ms)),
    )


def recording_of(
    events: str | Path | Recording | NDArray[Any], reading: EventInput, *, progress: bool = False
) -> Recording:
    """Return the recording to draw; UsageError if options do not fit what it is made of."""
    if isinstance(events, (str, Path)):
        with reading_bar(events, progress) as told:
            return read_events(events, progress=told, **reading)
    is_array = isinstance(events, np.ndarray)
    for name, value in reading.items():
        if value and not (is_array and name == "size"):
            raise UsageError(f"{name}: is of the reading of a file: leave it out")
    if isinstance(events, Recording):
        return events
    size = size_of(reading)
    if size is None:
        raise UsageError("size: an array of events needs the width and height of the sensor")
    return Recording("events", "array", *size, checked_events(events, *size))
