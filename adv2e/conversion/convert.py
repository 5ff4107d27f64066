"""A whole conversion in one call: what ``adv2e convert`` does."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from adv2e.config import Written, files_among, load_config
from adv2e.conversion.pipeline import Summary, convert_reading
from adv2e.conversion.reading import Reading
from adv2e.conversion.transfer import convert_events
from adv2e.errors import Adv2eWarning, UsageError
from adv2e.formats.frames import takes_events
from adv2e.geometry import parse_rectangle, parse_size
from adv2e.in_python import in_python
from adv2e.sources.paths import SensorPath
from adv2e.sources.times.rates import Rate


def convert(
    source: str | Path,
    output: str | Path | None = None,
    config: Written | Sequence[Written] | None = None,
    *,
    fps: Rate | None = None,
    timestamps: str | Path | None = None,
    time_unit: str | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    t0: str = "auto",
    allow_damaged: bool = False,
    size: str | tuple[int, int] | None = None,
    crop: str | tuple[int, int, int, int] | None = None,
    bayer: str | None = None,
    pixel_format: str | None = None,
    rotate180: bool = False,
    track: str | int | None = None,
    set_back: str | None = None,
    crop_events: bool = False,
    format: str | None = None,
    layout: str | None = None,
    with_frames: bool = False,
    overwrite: bool = False,
    preview: str | Path | None = None,
    causes: bool = False,
    threads: int | None = None,
    progress: bool = False,
    take: str | None = None,
    motion: str | None = None,
    extent_px: float | None = None,
    duration_s: float | None = None,
) -> Summary:
    """Convert a video, a folder of images or a recording to a file of events.

    A file of events is written in another format, and nothing is simulated.

    Parameters
    ----------
    source : str or Path
        Video, folder of images, DAVIS240C recording, .npy stack of frames, or file of events.
    output : str or Path, optional
        File or folder to write; the suffix gives the format: .h5, .txt, .zip, or none for a
        DAVIS240C folder.  Default: ``<stem>.events.h5`` in the current folder.
    config : Config, or what :func:`adv2e.load_config` takes, optional
    fps : str or number, optional
        Frames a second, such as 30 or "30000/1001".
    timestamps : str or Path, optional
        List of the times of the frames, one a line.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times in lists.
    start_s, stop_s : float, optional
        Part to convert [s after the first frame].
    t0 : {'auto', 'zero', 'keep'}
        Time of the first frame: zero, or as on the source's clock; auto: keep where it has one.
    allow_damaged : bool
        Take what can be decoded of a damaged video.
    size : (int, int) or str, optional
        Width and height of the sensor, such as "346x260": sensor.width and .height.
    crop : (int, int, int, int) or str, optional
        First column, first row, columns and rows of the part to cut out of the frames first.
    bayer : {'RGGB', 'BGGR', 'GRBG', 'GBRG'}, optional
        Frames are raw mosaics with these colours in the first two rows.
    pixel_format : str, optional
        Raw video of pixels of this kind comes through standard input; `size` is that of its frames.
    rotate180 : bool
        Turn frames and events by half a turn, before even that.
    track : str or int, optional
        Which one to read of several video tracks, streams or topics: its number from 0, or its
        name.
    set_back, crop_events
        Of events: see :func:`adv2e.read_events`.
    format, layout : str, optional
        Format of the output where its suffix does not say it, and layout of HDF5.
    with_frames : bool
        Store the frames in HDF5, too.
    overwrite : bool
        Replace, at the end, an output that exists.
    preview : str or Path, optional
        Picture or film of the events to write beside.
    causes : bool
        Store what made each event, too: as a column of HDF5, else in ``<output>.causes.txt``.
    threads : int, optional
        Default: all cores.  The events do not depend on it.
    progress : bool
        Show a progress bar on stderr.
    take : {'frames', 'events'}, optional
        What to take of a source that holds both.  Default: the frames of cameras' recordings, the
        events of other files.
    motion : {'saccade', 'shake', 'pan'}, optional
        The source is one picture, before which the sensor moves so; see :mod:`adv2e.sources.paths`.
    extent_px, duration_s : float, optional
        Length of the longer side of that path [pixels of the sensor], and of its time [s].

    Returns
    -------
    Summary
        Counts, sizes, and what was noted, such as how light was decoded (`notes`).

    Raises
    ------
    DataError, ConfigError, OutputError, UsageError
        What is wrong with the input, the configuration, the output, or the arguments.

    Warns
    -----
    UserWarning
        Something about the input is in doubt, such as the unit of its times.

    Examples
    --------
    >>> import os, tempfile
    >>> import numpy as np
    >>> from adv2e import convert
    >>> folder = tempfile.TemporaryDirectory()
    >>> clip = os.path.join(folder.name, "clip.npy")
    >>> np.save(clip, np.repeat(np.array([20, 40, 80, 160], np.uint8), 32 * 24).reshape(4, 24, 32))
    >>> config = ["davis346", {"frames": {"encoding": "srgb"}}]
    >>> done = convert(clip, os.path.join(folder.name, "clip.h5"), config, fps=100)
    >>> (done.width, done.height, done.frames, done.events > 0)
    (346, 260, 4, True)
    >>> folder.cleanup()
    """
    notes: list[str] = []
    try:
        wanted = None if size is None else parse_size(size)
        part = None if crop is None else parse_rectangle(crop)
    except ValueError as error:
        raise UsageError(f"size, crop: {error}") from None

    def doubt(text: str) -> None:
        warnings.warn(in_python(text), Adv2eWarning, stacklevel=5)  # of who calls adv2e.convert

    if fps is not None and timestamps is not None:
        raise UsageError("fps and timestamps both give the times of the frames: keep one")
    if motion is None and (extent_px is not None or duration_s is not None):
        raise UsageError("extent_px and duration_s are of the path that motion makes")
    if takes_events(Path(source), take, track):
        simulated = {
            **{"config": config, "fps": fps, "timestamps": timestamps, "preview": preview},
            **{"bayer": bayer, "pixel_format": pixel_format, "motion": motion},
            "allow_damaged": allow_damaged or None,
        }
        if given := [name for name, value in simulated.items() if value is not None]:
            raise UsageError(f"{source} holds events, nothing is simulated: leave out {given[0]}")
        if output is None:
            raise UsageError("output is missing: say what to write the events to")
        summary = convert_events(
            str(source),
            str(output),
            size=wanted,
            crop=part,
            rotate180=rotate180,
            track=track,
            set_back=set_back,
            crop_events=crop_events,
            time_unit=time_unit,
            start_s=start_s,
            stop_s=stop_s,
            t0=t0,
            format=format,
            layout=layout,
            with_frames=with_frames,
            overwrite=overwrite,
            causes=causes,
            threads=threads,
            progress=progress,
            log=notes.append,
            doubt=doubt,
        )
        return replace(summary, notes=tuple(map(in_python, notes)))
    if set_back or crop_events:
        raise UsageError(f"{source}: set_back and crop_events are for events, not for frames")
    ready = load_config(config, size=None if part and pixel_format else wanted)
    reading = Reading(
        str(source),
        fps=fps,
        timestamps=timestamps,
        time_unit=time_unit,
        start_s=start_s,
        stop_s=stop_s,
        t0=t0,
        allow_damaged=allow_damaged,
        crop=part,
        bayer=bayer,
        pixel_format=pixel_format,
        frame_size=wanted,
        rotate180=rotate180,
        track=track,
        along=None if motion is None else SensorPath(motion, extent_px, duration_s),
        threads=threads,
    )
    with reading:
        summary = convert_reading(
            reading,
            None if output is None else str(output),
            config=ready,
            format=format,
            layout=layout,
            with_frames=with_frames,
            overwrite=overwrite,
            preview=None if preview is None else str(preview),
            causes=causes,
            progress=progress,
            also_read=files_among(config),
            log=notes.append,
            doubt=doubt,
        )
    return replace(summary, notes=tuple(map(in_python, notes)))
