"""A frame, what the numbers in it stand for, and which of several tracks it comes from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import encoding_of_images, full_scale_of
from adv2e.errors import DataError
from adv2e.label import guessed
from adv2e.sources.paths import Offset

Image = NDArray[Any]
"""(rows, columns) or (rows, columns, 3) RGB; uint8, uint16, float32 or float64."""


LARGEST = 1 << 27
"""Pixels of the largest frame: 16384x8192, which holds video of 16K and pictures of any camera."""


def check_pixels(width: int, height: int, label: str) -> None:
    """Raise DataError if a frame has more pixels than are read, best before room is made for it."""
    if width * height > LARGEST:
        raise DataError(
            f"{label}: {width}x{height} pixels; frames of more than {LARGEST:,} pixels (16384x8192)"
            " are not read: make it smaller"
        )


@dataclass(frozen=True)
class Frame:
    """A frame as it was read: its numbers, and what its file says of them.

    Loaders return it without a time; its source gives it one, with a name, and checks it.

    Attributes
    ----------
    image : array
        Grey or RGB.
    alpha : (rows, columns) float32, optional
        How much of each pixel is there, 0..1; None: all of it.  The colours are not multiplied
        by it.
    composed : bool
        The file has transparent pixels, and its colours are light over black already.
    white : float, optional
        Number that means white, where that is not the one of the data type: as its file says, or
        all frames of its source have it.
    offset : (float, float), optional
        Where on it the sensor looks, from the middle: to the right and down [its pixels].
    encoding, says : str
        What its file states of the numbers, if it does, and how; what else is to be told of that.
    densities : (int, int)
        Pixels a unit of length, across and down.
    t_ns : int
        Its time [ns].
    label : str
        Its name, for messages.
    odd_white : str
        How the white that its file states differs from that of the first frame.
    """

    image: Image
    alpha: NDArray[np.float32] | None = None
    composed: bool = False
    white: float | None = None
    offset: Offset | None = None
    encoding: str = ""
    says: str = ""
    densities: tuple[int, int] = (1, 1)
    t_ns: int = 0
    label: str = ""
    odd_white: str = ""


OVER_BLACK = "transparent pixels are composed over black, in linear light"
"""Note on a source with transparent pixels, given once."""


RECORDED = "frames of a recording"
"""Reason for linear frames in recordings of event cameras."""


@dataclass(frozen=True)
class Light:
    """Encoding and white of the numbers of frames, with the reasons in a few words.

    Attributes
    ----------
    encoding : str
        Encoding for ``encoding: auto``.
    encoding_reason : str
    full_scale : float, optional
        Number that means white, whatever the files of the frames say of it.
    full_scale_reason : str
        Empty where the reason is the same, or the data type says it.
    is_stated : bool
        Their file, or the user, says the encoding; else it is a guess.
    is_doubtful : bool
        Such numbers stand for other light nearly as often.
    """

    encoding: str
    encoding_reason: str
    full_scale: float | None = None
    full_scale_reason: str = ""
    is_stated: bool = False
    is_doubtful: bool = False


@dataclass(frozen=True)
class Shot:
    """A frame not loaded yet: time on the source's clock [ns], name for messages, loader.

    Its exposure [ns] is 0 where it is not known.
    """

    t_ns: int
    label: str
    load: Callable[[], Frame]
    exposure_ns: int = 0


def rotated180(frame: Frame) -> Frame:
    """Return a frame turned by half a turn."""
    alpha = None if frame.alpha is None else np.ascontiguousarray(frame.alpha[::-1, ::-1])
    return replace(frame, image=np.ascontiguousarray(frame.image[::-1, ::-1]), alpha=alpha)


def odd_white(frame: Frame, first: float | None) -> str:
    """Return a complaint if the white of a frame differs from `first`, that of the first frame.

    None stands for the white of the data type.  In a black image the white does not matter.
    """
    usual = full_scale_of(frame.image.dtype)
    white, expected = frame.white or usual, first or usual
    if white == expected or not frame.image.any():
        return ""
    return (
        f"white is {white:g} in it, but {expected:g} in the first frame; say what it is in all,"
        f" with frames.full_scale={expected:g} or another number"
    )


def light_of_images(frame: Frame, name: str = "images") -> Light:
    """Return the encoding of images, or of arrays (`name`), and the reason.

    It is the one that they state, else the usual one.  8-bit pictures are sRGB, nearly always in
    colour; grey ones may be a camera's own numbers, and 16-bit ones are written by cameras and by
    photo editors alike.
    """
    if frame.encoding:
        return Light(frame.encoding, frame.says, is_stated=True)
    dtype, colour = frame.image.dtype, frame.image.ndim == 3
    depth = "floating-point" if dtype.kind == "f" else f"{8 * dtype.itemsize}-bit"
    reason = f"{depth} {'colour' if colour else 'grey'} {name}"
    if frame.says:
        reason += f"; {frame.says}"
    is_doubtful = dtype.kind != "f" and not (colour and dtype == np.uint8)
    return Light(encoding_of_images(dtype), reason, is_doubtful=is_doubtful)


def check_values(image: Image, label: str) -> None:
    """Raise DataError if a float image holds NaN, infinite or negative values."""
    if image.dtype.kind != "f" or image.size == 0:
        return
    low, high = float(image.min()), float(image.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise DataError(f"{label}: pixels that are NaN or infinite; light must be a finite number")
    if low < 0:
        raise DataError(f"{label}: a pixel of {low:g}; light cannot be negative")


# ---- Several tracks, streams or topics in one file: which one is read, and what is told of the
# others.
#
# A name has parts with slashes between them, that of the camera first: ``DAVIS_1/events``, or the
# topic ``/davis/left/events``. The user names a track by its number from 0, among the events where
# there are events, or by its name or neighbouring parts of it.


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
    name = tracks[taken].name
    return guessed(
        f"{len(tracks)} {what}: {names}: {number}{name} is taken, --track chooses another",
        *("track", name, f"give --track {taken if numbered else name}, or another"),
    )
