"""Event files of several formats, read into one kind of recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from adv2e.errors import DataError, UsageError
from adv2e.files.names import beside
from adv2e.files.regular import check_ends
from adv2e.formats.assembly import assemble
from adv2e.formats.causes import beside as beside_of_causes
from adv2e.formats.causes import found_beside
from adv2e.formats.clock import SET_BACK
from adv2e.formats.event_file import Columns, EventFile, Facts, Progress, rotated180
from adv2e.formats.recording import Recording
from adv2e.formats.registry import format_of
from adv2e.geometry import MOST_PIXELS
from adv2e.process.machine import machine_complaint
from adv2e.sources.frame import Shot
from adv2e.sources.tracks import Track

__all__ = ["Recording", "open_events", "read_events"]

Loaded = TypeVar("Loaded")


def open_events(
    path: str | Path,
    *,
    time_unit: str | None = None,
    progress: Progress | None = None,
    size: tuple[int, int] | None = None,
    rotate180: bool = False,
    track: str | int | None = None,
    set_back: str | None = None,
    crop_events: bool = False,
) -> EventFile:
    """Open an event file, or a folder in the DAVIS240C layout; its events are not read yet.

    Parameters
    ----------
    path, time_unit, progress, rotate180, track, set_back, crop_events
        See :func:`read_events`.
    size : (int, int), optional
        Width and height [pixels] that hold whatever the file states.

    Raises
    ------
    DataError
        As :func:`read_events`.
    """
    path = Path(path)
    if set_back not in (None, *SET_BACK):
        raise UsageError(f"set_back {set_back!r}: must be one of {', '.join(SET_BACK)}")
    facts = Facts(
        path,
        time_unit,
        progress,
        rotate180=rotate180,
        track=None if track is None else str(track),
        set_back=set_back,
        crop_events=crop_events,
    )
    facts.state(size, "--size")
    with _reading(path):
        check_ends(path)
        if not path.exists():
            raise DataError(f"{path}: no such file or folder")
        found = format_of(path)
        description = beside(path, ".json")
        if not found.holds_settings and description.is_file():
            facts.describe_from(description)
        file: EventFile = found.load(found.reader)(path, facts)
        if not facts.has_chosen:
            facts.choose([Track("events")])
        if time_unit is not None and not facts.needs_unit:
            facts.tell(f"--time-unit {time_unit} is not followed: the file says what its times are")
        facts.inputs.append(beside_of_causes(path))
        inside = found.load(found.causes)(path) if found.causes else None
    file = _named(replace(file, causes=inside or found_beside(path)))
    return rotated180(file) if rotate180 else file


def read_events(
    path: str | Path,
    *,
    time_unit: str | None = None,
    progress: Progress | None = None,
    size: tuple[int, int] | None = None,
    rotate180: bool = False,
    track: str | int | None = None,
    set_back: str | None = None,
    crop_events: bool = False,
) -> Recording:
    r"""Read an event file, or a folder in the DAVIS240C layout.

    Parameters
    ----------
    path : str or Path
        Its suffix and its first bytes tell the format: see :mod:`adv2e.formats.registry`.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times; default: see :mod:`adv2e.formats.units`.
    progress : callable, optional
        Is called now and then with two numbers: how much was read, and of how much.
    size : (int, int), optional
        Width and height of the sensor [pixels], whatever the file states.
    rotate180 : bool
        Turn events and frames by half a turn, as for a camera that was mounted upside down.
    track : str or int, optional
        Which one to read of several streams: its number from 0, or its name.
    set_back : {'continue', 'sort'}, optional
        What to do where times go back by more than 0.1 s: go on from the time before, as where a
        clock was reset, or sort the events by time.  Default: an error.
    crop_events : bool
        Leave out events outside the sensor, however many.  Default: more than 1 % are an error.

    Returns
    -------
    Recording
        Its `problems` tell what is doubtful.

    Raises
    ------
    DataError
        No such file, an unknown format, or content that cannot be read; the text names the file,
        and the line where there are lines.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from adv2e import read_events
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "events.txt")
    ...     _ = path.write_text("0.000001 3 2 1\n0.000250 0 0 0\n")
    ...     recording = read_events(path)
    >>> recording.events["t"].tolist(), recording.events["p"].tolist()
    ([1, 250], [1, 0])
    >>> recording.width, recording.height, recording.frame_times_ns is None
    (4, 3, True)
    """
    file = open_events(
        path,
        time_unit=time_unit,
        progress=progress,
        size=size,
        rotate180=rotate180,
        track=track,
        set_back=set_back,
        crop_events=crop_events,
    )
    recording = assemble(file)
    _check_size(recording)
    return recording


def _named(file: EventFile) -> EventFile:
    """Return a file that is named wherever the system says why it cannot be read."""
    path, parts, shots, causes = file.facts.path, file.parts, file.shots, file.causes

    def named_parts() -> Iterator[Columns]:
        with _reading(path):
            yield from parts()

    def named_shots() -> Iterator[Shot]:
        assert shots is not None
        with _reading(path):
            for shot in shots():
                yield replace(shot, load=partial(_read, path, shot.load))

    return replace(
        file,
        parts=named_parts,
        shots=None if shots is None else named_shots,
        causes=None if causes is None else partial(_read, path, causes),
    )


def _read(path: Path, load: Callable[[], Loaded]) -> Loaded:
    with _reading(path):
        return load()


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn an OSError about a file in the body into a DataError."""
    try:
        yield
    except OSError as error:
        if machine_complaint(error):
            raise
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error


def _check_size(recording: Recording) -> None:
    """Refuse sensors too large to make a picture of, as one stray coordinate makes them."""
    width, height, events = recording.width, recording.height, recording.events
    if width * height <= MOST_PIXELS:
        return
    why = "is stated"
    if events.size and (int(events["x"].max()) + 1, int(events["y"].max()) + 1) == (width, height):
        far = events[int(np.argmax(np.maximum(events["x"], events["y"])))]
        why = (
            f"the event at {far['t'] / 1e6:.6f} s, x {far['x']}, y {far['y']} needs; if it is"
            " wrong, state the size: --size WxH"
        )
    raise DataError(
        f"{recording.path}: a sensor of {width}x{height} pixels, over {MOST_PIXELS:,}, {why}"
    )
