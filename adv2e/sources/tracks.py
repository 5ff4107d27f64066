"""Several tracks, streams or topics in one file: which one is read, and what is told of the others.

A name has parts with slashes between them, that of the camera first: ``DAVIS_1/events``, or the
topic ``/davis/left/events``.  The user names a track by its number from 0, among the events where
there are events, or by its name or neighbouring parts of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from adv2e.errors import DataError


@dataclass(frozen=True)
class Track:
    """One stream of events, or one track of frames.

    Attributes
    ----------
    name : str
    about : str
        How much it holds, for messages.
    is_usual : bool
        It is the one that other programs take unasked.
    is_empty : bool
        It is known to hold nothing.
    """

    name: str
    about: str = ""
    is_usual: bool = False
    is_empty: bool = False

    @property
    def parts(self) -> list[str]:
        """The parts of its name."""
        return self.name.strip("/").split("/")

    def is_called(self, name: str) -> bool:
        """Tell whether that is its name, or neighbouring parts of it."""
        return f"/{name.strip('/')}/" in f"/{'/'.join(self.parts)}/"

    def shared(self, other: Track) -> int:
        """Return how many parts at the beginning of both names are the same."""
        same = [a == b for a, b in zip(self.parts, other.parts, strict=False)]
        return [*same, False].index(False)


def choose(
    wanted: str | None, events: Sequence[Track], frames: Sequence[Track], path: str | Path
) -> tuple[int | None, int | None, list[str]]:
    """Return which events and which frames are read, and what is to be told of that.

    Frames are those of the camera of the events.  Of several that the user leaves open, the usual
    one is taken, else the first; those that hold nothing come last.

    Parameters
    ----------
    wanted : str, optional
        What the user says.
    events, frames : sequences of Track
    path : path
        The file, for messages.

    Returns
    -------
    (int or None, int or None, list of str)
        Places in `events` and `frames`; None where there are none.

    Raises
    ------
    DataError
        No track is called so.
    """
    asked, asked_frames = _asked(wanted, events, frames, path)
    beside = [frames[k] for k in asked_frames[:1] if not asked]
    event = _best(events, asked or range(len(events)), beside)
    pool = asked_frames
    if not pool:
        camera = [] if event is None else [events[event]]
        pool = [k for k, each in enumerate(frames) if _belongs(each, camera, events)]
    frame = _best(frames, pool, [] if event is None else [events[event]])
    told = []
    if event is not None and len(events) > 1 and len(asked) != 1:
        told.append(_told("streams of events", events, event, numbered=True))
    if frame is not None and len(asked_frames) != 1 and len(pool if wanted else frames) > 1:
        told.append(_told("tracks of frames", frames, frame, numbered=not events))
    return event, frame, told


def _asked(
    wanted: str | None, events: Sequence[Track], frames: Sequence[Track], path: str | Path
) -> tuple[list[int], list[int]]:
    """Return the events and the frames that the user names; none of both if nobody does."""
    if wanted is None:
        return [], []
    numbers = [str(k) for k in range(len(events or frames))]
    if wanted in numbers:
        place = [numbers.index(wanted)]
        return (place, []) if events else ([], place)
    found = _called(wanted, events), _called(wanted, frames)
    if any(found):
        return found
    known = [_listed(events, numbered=True), _listed(frames, numbered=not events)]
    raise DataError(
        f"{path}: --track {wanted}: it holds no such track, but {', '.join(filter(None, known))}"
    )


def _called(name: str, tracks: Sequence[Track]) -> list[int]:
    whole = [k for k, track in enumerate(tracks) if track.name == name]
    return whole or [k for k, track in enumerate(tracks) if track.is_called(name)]


def _belongs(frame: Track, camera: list[Track], events: Sequence[Track]) -> bool:
    """Tell whether no other events are nearer to a track of frames than those of a camera."""
    nearest = max((frame.shared(each) for each in events), default=0)
    return all(frame.shared(each) == nearest for each in camera)


def _best(tracks: Sequence[Track], pool: Sequence[int], beside: list[Track]) -> int | None:
    def rank(place: int) -> tuple[bool, int, bool, int]:
        track = tracks[place]
        near = sum(map(track.shared, beside))
        return track.is_empty, -near, not track.is_usual, place

    return min(pool, key=rank, default=None)


def _listed(tracks: Sequence[Track], *, numbered: bool) -> str:
    return ", ".join(_text(tracks, place, numbered=numbered) for place in range(len(tracks)))


def _text(tracks: Sequence[Track], place: int, *, numbered: bool) -> str:
    number, track = f"{place} " if numbered else "", tracks[place]
    return f"{number}{track.name}" + f" ({track.about})" * bool(track.about)


def _told(what: str, tracks: Sequence[Track], taken: int, *, numbered: bool) -> str:
    names = _listed(tracks, numbered=numbered)
    number = f"{taken} " if numbered else ""
    return (
        f"{len(tracks)} {what}: {names}: {number}{tracks[taken].name} is taken, --track chooses"
        " another"
    )
