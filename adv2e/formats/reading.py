"""Event files of several formats, read into one kind of recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from adv2e.errors import DataError
from adv2e.files.names import beside
from adv2e.files.regular import check_ends
from adv2e.formats.assembly import assemble
from adv2e.formats.causes import beside as beside_of_causes
from adv2e.formats.causes import found_beside
from adv2e.formats.event_file import Columns, EventFile, Facts, Progress, rotated180
from adv2e.formats.recording import Recording
from adv2e.formats.registry import format_of
from adv2e.geometry import MOST_PIXELS
from adv2e.options import EventInput, size_of, takes
from adv2e.process.machine import machine_complaint
from adv2e.sources.frame import Shot
from adv2e.sources.tracks import Track

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Recording", "open_events", "read_events"]

Loaded = TypeVar("Loaded")


@takes(EventInput)
def open_events(
    path: str | Path, *, progress: Progress | None = None, **options: Unpack[EventInput]
) -> EventFile:
    """Open an event file, or a folder in the DAVIS240C layout; its events are not read yet.

    Parameters
    ----------
    path, progress
        See :func:`read_events`.
    **options
        See :class:`adv2e.options.EventInput`.

    Raises
    ------
    DataError
        As :func:`read_events`.
    """
    path = Path(path)
    time_unit, track = options["time_unit"], options["track"]
    facts = Facts(
        path,
        time_unit,
        progress,
        rotate180=options["rotate180"],
        track=None if track is None else str(track),
        set_back=options["set_back"],
        crop_events=options["crop_events"],
    )
    facts.state(size_of(options), "--size")
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
    return rotated180(file) if options["rotate180"] else file


@takes(EventInput)
def read_events(
    path: str | Path, *, progress: Progress | None = None, **options: Unpack[EventInput]
) -> Recording:
    r"""Read an event file, or a folder in the DAVIS240C layout.

    Parameters
    ----------
    path : str or Path
        Its suffix and its first bytes tell the format: see :mod:`adv2e.formats.registry`.
    progress : callable, optional
        Is called now and then with two numbers: how much was read, and of how much.
    **options
        See :class:`adv2e.options.EventInput`.

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
    file = open_events(path, progress=progress, **options)
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
