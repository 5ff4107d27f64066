"""Pictures and films of events, from a file or an array: what ``adv2e render`` does."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import UsageError
from adv2e.events import checked_events
from adv2e.formats.reading import Recording, read_events
from adv2e.rendering.films import check_suffix
from adv2e.rendering.recording import render_recording
from adv2e.rendering.styles import Style, parse_colour
from adv2e.rendering.timeline import MOST_PICTURES

_SHEET_WINDOW_MS = 20.0


def render(
    events: str | Path | Recording | NDArray[Any],
    output: str | Path | None = None,
    *,
    size: tuple[int, int] | None = None,
    style: str = "white",
    on_color: str = "red",
    off_color: str = "blue",
    window_ms: float | None = None,
    fps: float = 30.0,
    speed: float = 1.0,
    start_s: float = 0.0,
    stop_s: float | None = None,
    at_s: Sequence[float] = (),
    count: int = 6,
    frames: bool = True,
    scale: int | None = None,
    overwrite: bool = False,
    progress: bool = False,
    max_pictures: int = MOST_PICTURES,
) -> NDArray[np.uint8] | None:
    """Draw a film (.mp4, .webm, .avi, .gif) or a sheet of pictures (.png) of events.

    Parameters
    ----------
    events : str, Path, Recording, or (n,) array of EVENT_DTYPE
        A file, what :func:`adv2e.read_events` returned, or the events themselves.
    output : str or Path, optional
        File to write; its suffix says what to make.  Without one, a sheet is returned.
    size : (int, int), optional
        Width and height of the sensor [pixels].  An array needs it, nothing else takes it.
    style : {'white', 'black', 'grey', 'surface'}
        Colours on white or black; grey: net count; surface: colours that fade with age.
    on_color, off_color : str
        Name or #rrggbb.
    window_ms : float, optional
        Length of what one picture shows [ms].  Default: in a film, all since the picture before;
        on a sheet 20.
    fps : float
        Pictures a second of a film.
    speed : float
        Recorded seconds a second of film; 0.1 is ten times slower than life.
    start_s, stop_s : float, optional
        Part to show [s after the first event or frame].
    at_s : sequence of float
        Instants of a sheet [s]; none: up to `count`, about evenly spaced.
    count : int
        Instants of a sheet without `at_s`.
    frames : bool
        Show the frames beside the events, where there are any.
    scale : int, optional
        How often a pixel is repeated; default: panels are about 640 columns wide.
    overwrite : bool
        Replace a file that exists.
    progress : bool
        Show a progress bar on stderr.
    max_pictures : int
        Most pictures of a film: a wrong time would make far too many.

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
        chosen = chosen_style(
            path,
            style,
            on_color,
            off_color,
            window_ms=window_ms,
            fps=fps,
            speed=speed,
            at_s=at_s,
        )
        render_recording(
            _recording(events, size),
            path,
            style=chosen,
            fps=fps,
            speed=speed,
            at_s=at_s,
            count=count,
            start_s=start_s,
            stop_s=stop_s,
            frames=frames,
            scale=scale,
            overwrite=overwrite,
            progress=progress,
            max_pictures=max_pictures,
        )
        if output is not None:
            return None
        picture: Any = cv2.imread(str(path))
        return np.ascontiguousarray(picture[:, :, ::-1], np.uint8)


def chosen_style(
    output: str | Path,
    name: str,
    on_color: str,
    off_color: str,
    *,
    window_ms: float | None,
    fps: float,
    speed: float,
    at_s: Sequence[float],
) -> Style:
    """Return the style of the pictures; parameters and errors as for :func:`render`."""
    is_film = check_suffix(output) != ".png"
    if at_s and is_film:
        raise UsageError(
            f"{output}: instants (--at) are for a .png; --start and --stop choose part of a film"
        )
    usual_ms = 1e3 * speed / fps if is_film else _SHEET_WINDOW_MS
    return Style(
        name=name,
        on=parse_colour(on_color),
        off=parse_colour(off_color),
        window_us=max(1, round(1e3 * (window_ms or usual_ms))),
    )


def _recording(
    events: str | Path | Recording | NDArray[Any], size: tuple[int, int] | None
) -> Recording:
    if not isinstance(events, np.ndarray):
        if size is not None:
            raise UsageError("size: a file says its own; only an array of events needs it")
        return events if isinstance(events, Recording) else read_events(events)
    if size is None:
        raise UsageError("size: an array of events needs the width and height of the sensor")
    return Recording("events", "array", *size, checked_events(events, *size))
