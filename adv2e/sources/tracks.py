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
        Amount of its content, for messages.
    is_usual : bool
        It is the one that other programs take unasked.
    is_empty : bool
        It is known to be empty.
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
        """Return the number of equal parts at the beginning of both names."""
        same = [a == b for a, b in zip(self.parts, other.parts, strict=False)]
        return [*same, False].index(False)


def counted(count: int, what: str) -> str:
    """Return a number of things for people; `what` is their plural, that ends with an s."""
    return f"{count:,} {what if count != 1 else what[:-1]}"


def choose(
    wanted: str | None, events: Sequence[Track], frames: Sequence[Track], path: str | Path
) -> tuple[int | None, int | None, list[str]]:
    """Return the tracks of events and of frames to be read, and notes on the choice.

    Frames are those of the camera of the events.  Of several tracks that the user leaves open, the
    usual one is taken, else the first; empty ones come last.

    Parameters
    ----------
    wanted : str, optional
        Number or name of a track that the user gives.
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
    pool = asked or _nearest(events, [frames[k] for k in asked_frames])
    event = _best(events, pool)
    camera = [] if event is None else [events[event]]
    pool_of_frames = asked_frames or [
        k for k, each in enumerate(frames) if _belongs(each, camera, events)
    ]
    frame = _best(frames, _nearest(frames, camera, pool_of_frames))
    told = []
    if event is not None and len(pool if wanted else events) > 1:
        told.append(_told("streams of events", events, event, numbered=True))
    if frame is not None and len(pool_of_frames if wanted else frames) > 1:
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


def _nearest(
    tracks: Sequence[Track], beside: Sequence[Track], pool: Sequence[int] | None = None
) -> list[int]:
    """Return the tracks of a pool whose names share the most parts with those of others."""
    pool = range(len(tracks)) if pool is None else pool
    near = {k: sum(map(tracks[k].shared, beside)) for k in pool}
    return [k for k in pool if near[k] == max(near.values())]


def _best(tracks: Sequence[Track], pool: Sequence[int]) -> int | None:
    def rank(place: int) -> tuple[bool, bool, int]:
        return tracks[place].is_empty, not tracks[place].is_usual, place

    return min(pool, key=rank, default=None)


def _listed(tracks: Sequence[Track], *, numbered: bool) -> str:
    return ", ".join(_text(tracks, place, numbered=numbered) for place in range(len(tracks)))


def _text(tracks: Sequence[Track], place: int, *, numbered: bool) -> str:
    number, track = f"{place} = " if numbered else "", tracks[place]
    return f"{number}{track.name}" + f" ({track.about})" * bool(track.about)


def _told(what: str, tracks: Sequence[Track], taken: int, *, numbered: bool) -> str:
    names = _listed(tracks, numbered=numbered)
    number = f"{taken} = " if numbered else ""
    return (
        f"{len(tracks)} {what}: {names}: {number}{tracks[taken].name} is taken, --track chooses"
        " another"
    )
