"""Writing of events: files of several formats, and standard output.

>>> from adv2e.events import make_events
>>> from adv2e.formats.writing import open_sink
>>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
>>> with open_sink("-", width=4, height=3, metadata={}) as sink:  # doctest: +SKIP
...     sink.write_events(events)
0.000010000 0 0 1
0.000020000 3 2 0
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from adv2e import __version__
from adv2e.background import default_threads
from adv2e.causes import CAUSED_DTYPE, has_causes
from adv2e.errors import DataError, warn
from adv2e.events import EVENT_DTYPE, Events, checked_events
from adv2e.files.staging import Staging
from adv2e.formats.causes import check_numbers
from adv2e.formats.recording import Recording
from adv2e.formats.registry import to_write
from adv2e.formats.sink import Request, Sink

_NO_FRAMES = (
    "the frames of the recording are not written: 'adv2e convert IN -o OUT --from events"
    " --with-frames' keeps them"
)


def open_sink(
    path: str | Path,
    *,
    width: int,
    height: int,
    metadata: dict[str, Any],
    format: str | None = None,
    layout: str | None = None,
    overwrite: bool = False,
    with_frames: bool = False,
    threads: int | None = None,
    staging: Staging | None = None,
    causes: bool = False,
) -> Sink:
    """Return a sink for `path`, to be used in a ``with`` block.

    Nothing is written before the block is entered, and nothing is left if it is left by an
    exception; folders missing above `path` are made.

    Parameters
    ----------
    path : str or Path
        Output; "-": text to standard output.
    width, height : int
        Geometry [pixels].
    metadata : dict
        What JSON can hold; stored inside, or in ``<path>.json`` where a format cannot hold it.
    format : str, optional
        See :func:`adv2e.formats.registry.names`; default: by the suffix, a path without one is a
        folder.
    layout : str, optional
        See :func:`adv2e.formats.registry.layouts`, for HDF5.
    overwrite : bool
        Replace, at the end, what exists.
    with_frames : bool
        Store frames, where the format can.
    threads : int, optional
        Threads that compress; default: all cores.  The bytes do not depend on it.
    staging : Staging, optional
        Takes the output together with others; it says whether what exists is replaced.
    causes : bool
        The events know their causes, which are stored: inside where the format has a column for
        them, else beside: see :mod:`adv2e.formats.causes`.

    Raises
    ------
    UsageError
        Unknown `format` or `layout`, or they do not fit together; causes to standard output.
    OutputError
        The output, or causes beside it, exists already, or cannot be made; or the format cannot
        hold such a sensor.
    """
    path = Path(path)
    chosen = to_write(path, format, layout)
    request = Request(
        path=path,
        width=width,
        height=height,
        description={"adv2e": __version__, "width": width, "height": height, **metadata},
        with_frames=with_frames,
        threads=threads or default_threads(),
        causes=causes,
    )
    files = Staging(overwrite) if staging is None else staging
    return Sink(chosen, request, files, is_alone=staging is None)


def write_events(
    path: str | Path,
    events: Events | Recording,
    size: tuple[int, int] | None = None,
    *,
    metadata: dict[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write events to a file, whose suffix tells the format, or to a folder.

    Parameters
    ----------
    path : str or Path
        Output: its suffix tells the format; without one, a DAVIS240C folder.
    events : Recording, or structured array, (n,)
        With the fields t [us], x, y, p, in any order of time; sorted ones are written as they are.
        The field cause, if there is one, is written too.  The frames of a recording are not:
        ``adv2e convert IN -o OUT --from events --with-frames`` keeps them.
    size : (int, int), optional
        Width and height of the sensor [pixels]; an array needs it.
    metadata : dict, optional
        What JSON can hold; stored inside, or in ``<path>.json`` where a format cannot hold it.
        Default: that of the recording.
    overwrite : bool
        Replace, at the end, what exists.

    Raises
    ------
    DataError
        The array has other fields or no size, or an event lies outside the sensor, or has no cause.
    OutputError
        Unknown suffix; the output exists already, or cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from adv2e import read_events, write_events
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_events(Path(folder, "a.h5"), events, (4, 3))
    ...     recording = read_events(Path(folder, "a.h5"))
    >>> recording.events["t"].tolist(), recording.width, recording.height
    ([10, 20], 4, 3)
    """
    recording = events if isinstance(events, Recording) else None
    if recording is not None:
        events, size = recording.events, size or (recording.width, recording.height)
        if recording.frame_times_ns is not None:
            warn(_NO_FRAMES)
        if metadata is None:
            metadata = {key: value for key, value in recording.metadata.items() if key != "frames"}
    if size is None:
        raise DataError("events: size is missing, (width, height) of the sensor [pixels]")
    width, height = size
    caused = has_causes(np.asarray(events))
    ours = checked_events(events, width, height, CAUSED_DTYPE if caused else EVENT_DTYPE)
    if caused:
        check_numbers(np.asarray(events)["cause"], "events: cause")
    with open_sink(
        path,
        width=width,
        height=height,
        metadata=dict(metadata or {}),
        overwrite=overwrite,
        causes=caused,
    ) as sink:
        sink.write_events(ours)
