"""Inputs with frames: those of :mod:`adv2e.sources`, and event files that hold frames, too.

What an input with both is converted from, its frames or its events, is settled here.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from adv2e.errors import DataError, UsageError
from adv2e.files.zips import Members
from adv2e.formats.event_file import EventFile
from adv2e.formats.reading import open_events, shots_of
from adv2e.formats.registry import format_of, may_hold_events
from adv2e.label import told_of
from adv2e.options import SourceOptions, takes
from adv2e.sources import STDIN, open_source
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.listed import ListedSource, Picture, Timed, timed
from adv2e.sources.stored import EVENTS

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(SourceOptions)
def open_frames(path: str | Path, **options: Unpack[SourceOptions]) -> Source:
    """Open an input with frames; parameters and errors as :func:`adv2e.sources.open_source`."""
    named = Path(path)
    other = options["pixel_format"] is not None or options["motion"] is not None
    if (
        other
        or not (named.exists() and may_hold_events(named))
        or format_of(named).is_davis240c  # a source of its own: it may come without events
    ):
        return open_source(path, **options)
    turn, track = options["rotate180"], options["track"]
    times = GivenTimes.of(options)
    selection = replace(Selection.of(options), rotate180=False, track=None)  # the file sees to them
    if turn and selection.bayer is not None:
        raise DataError(f"{path}: --bayer is not known of frames that --rotate180 turns: give one")
    # a list that the user gives has times of its own, which are those of the unit
    unit = None if times.timestamps else times.time_unit
    file = open_events(path, time_unit=unit, rotate180=turn, track=track)
    if file.shots is None:
        raise DataError(f"{path}: holds events and no frames")
    return _source(file, times, selection)


def _source(file: EventFile, given: GivenTimes, selection: Selection) -> Source:
    """Return the frames of an event file as a source."""
    path = file.facts.path
    times = Timed(list(shots_of(file)), [told_of(path, line) for line in file.facts.problems], [])
    if given:
        pictures = [Picture(shot.label, None, shot.load) for shot in times.shots]
        times = timed(given, pictures, path, str(path))
    source = ListedSource(
        path,
        file.layout,
        times,
        selection,
        has_clock=given.fps is None,
        light=file.facts.light,
    )
    source.inputs += file.inputs
    source.uncarried = file.facts.uncarried
    return source


def takes_events(path: Path, choice: str | None = None, track: str | int | None = None) -> bool:
    """Tell whether it is the events of an input that are converted, and not its frames.

    Recordings of cameras are simulated from their frames, where they have any; other event files
    are converted to another format.

    Parameters
    ----------
    path : Path
    choice : {'frames', 'events'}, optional
        What the user wants.
    track : str or int, optional
        Which of several streams the user wants.

    Raises
    ------
    DataError
        The input cannot be read.
    UsageError
        Events are wanted of standard input.
    """
    if choice is not None:
        if choice == "events" and str(path) == STDIN:
            raise UsageError("--from events needs a file: frames come through standard input")
        return choice == "events"
    if not (path.exists() and may_hold_events(path)):
        return False
    found = format_of(path)
    if found.is_davis240c:
        files = Members(path)
        if files.enter(EVENTS):
            return open_events(path, track=track).shots is None
        return not path.is_dir() and [Path(name).suffix for name in files.archived()] == [".txt"]
    return not found.is_camera or open_events(path, track=track).shots is None
