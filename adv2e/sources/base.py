"""Base of the sources of frames: a description, and frames in the order of time.

A source states its geometry when it is opened and reads its frames one after another, as often as
asked, but for a pipe, which gives them once.  Times are integer nanoseconds.  The conditions
for any source (two frames at least, times that increase, one size and data type, finite values) are
checked here, once.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from array import array
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from adv2e.effects.frames.brightness import doubt_of_white
from adv2e.effects.frames.encoding import full_scale_of
from adv2e.errors import DataError, UsageError
from adv2e.geometry import Rectangle, Size
from adv2e.label import ENCODING, WHITE, guessed, left_out, told_of
from adv2e.options import EventInput, FrameInput, SourceOptions, crop_of
from adv2e.sources.frame import (
    OVER_BLACK,
    Frame,
    Light,
    Shot,
    Track,
    check_pixels,
    check_values,
    choose,
    light_of_images,
    odd_white,
    rotated180,
)
from adv2e.sources.paths import SensorPath
from adv2e.sources.times.lists import read_list
from adv2e.sources.times.rates import NS_PER_S, FrameRate, Rate, parse_rate, seconds
from adv2e.ticks import check_time

LIVE = ("camera", "network")
"""Kinds of sources whose frames come when they please, and are lost where nobody takes them."""


class Source(ABC):
    """Frames in the order of time, and what is known of them before they are read.

    Attributes
    ----------
    path : str
        What was opened.
    inputs : list of str or Path
        Files that are read, and the folder they are in: where nothing may be written.
    kind : str
        ``video``, ``images``, ``npy``, one of `LIVE`, or the data set that it is of, such as
        ``davis240c``.
    width, height : int
        Columns and rows of the frames, of the part that is cut out of them where one is.
    dtype : numpy.dtype
        Data type of the frames.
    colour : bool
        Frames are (rows, columns, 3) RGB.
    count : int or None
        Frames that `frames` will yield; None where only reading tells.  For a video it is what the
        file states, and good for showing progress.
    has_clock : bool
        Times are on a clock of the source's own, not counted from its first frame.
    whole : Size
        Size of the frames before they are cut.
    light : Light
        Encoding and white of the frames; `encoding` and `full_scale` are its attributes.
    largest : float or None
        Largest number of the frames that were looked at when it was opened; None: of none.
    largest_read : float
        Largest whole number of the frames read until now, as long as it may be far below white.
    doubts : list of str
        Things to tell the user before any work.
    notes : list of str
        Things to tell the user.
    uncarried : list of str
        What it holds beside frames and events, such as an IMU.
    threads : int
        Threads that decoding may use; one, unless set otherwise before `frames`.
    packages : tuple of str
        Optional packages that decode it.
    along : SensorPath or None
        Path of a sensor that moves before one picture.
    has_tracks : bool
        It may hold several tracks, and chooses among them itself.
    waits : bool
        Reading waits for others, and for ever if they please: it belongs in the main thread.
    exposures_us : list of float
        Exposure of each frame that `frames` yields [us]; empty where they are not known.
    passed_ns : array of int
        Times of all frames that `frames` looked at, wanted or not, on the source's clock [ns].
    origin_ns : int
        What was taken off the times of those that it yielded.
    ended_by_hand : int or None
        Number of frames after which a user ended what would have gone on; see `capturing`.
    """

    has_tracks = False

    def __init__(self, path: Path, kind: str, selection: Selection, has_clock: bool) -> None:
        if not self.has_tracks:
            choose(selection.track, [], [Track("frames")], path)
        self.path = str(path)
        self.inputs: list[str | Path] = [path]
        self.kind = kind
        self.selection = selection
        self.has_clock = has_clock
        self.largest: float | None = None
        self.largest_read = 0.0
        self.doubts: list[str] = []
        self.notes: list[str] = []
        self.uncarried: list[str] = []
        self.count: int | None = None
        self.threads = 1
        self.packages: tuple[str, ...] = ()
        self.waits = False
        self.ended_by_hand: int | None = None
        self.exposures_us: list[float] = []
        self.passed_ns = array("q")
        self.origin_ns = 0
        self.along: SensorPath | None = None

    def _describe(self, first: Frame, label: str, light: Light | None = None) -> None:
        """Take geometry, data type and meaning of the numbers from the first frame.

        `light` is what they mean where the kind of source says it, and not the image.
        """
        image = first.image
        try:
            usual = full_scale_of(image.dtype)
        except DataError as error:
            raise DataError(f"{label}: {error}") from error
        self.height, self.width = image.shape[:2]
        self.whole = Size(self.width, self.height)
        check_pixels(*self.whole, label)
        self.selection.check_crop(self.whole, label)
        if (crop := self.selection.crop) is not None:
            self.width, self.height = crop.width, crop.height
        self.dtype = image.dtype
        self.colour = image.ndim == 3
        across, down = first.densities
        if across != down:
            told = f"its pixels are not square, as it states {across} across and {down} down;"
            self.notes.append(told_of(label, left_out(f"{told} they are taken as square")))
        self._light_is_stated = light is None
        light = light or light_of_images(first)
        if first.encoding not in ("", light.encoding):
            self.notes.append(f"{label}: states {first.encoding}, and is taken as {light.encoding}")
        self._white_told, self._white_stated = light.full_scale, first.white
        why = light.full_scale_reason
        if light.full_scale is None and first.white is not None:
            why = "as its header says"
        self.full_scale = light.full_scale or first.white or usual
        self.light = replace(light, full_scale=self.full_scale, full_scale_reason=why)
        self.encoding = light.encoding

    def listed(self) -> Sequence[Shot]:
        """Return all frames, in the order of time, where they are known before; else none."""
        return ()

    def _take_list(self, given: GivenTimes, own_step_s: float | None = None) -> list[int]:
        """Return the times [ns] of the list that is given, of which doubts and notes are taken.

        Raises
        ------
        DataError
            It cannot be read, or has exposures: sources that are no pictures do not take these.
        """
        assert given.timestamps is not None
        label, unit = str(given.timestamps), given.time_unit
        found = read_list(given.timestamps, time_unit=unit, own_step_s=own_step_s)
        if any(stamp.exposure_ns for stamp in found.stamps):
            raise DataError(
                f"{label}: exposures, with start and end, are for pictures and stacks: make a"
                " folder of pictures of these frames, or a list of their middles"
            )
        doubts, notes = found.told(label)
        self.doubts += doubts
        self.notes += notes
        return [stamp.t_ns for stamp in found.stamps]

    def own_times_ns(self) -> list[int] | None:
        """Return the times of the frames that a rate replaces [ns]; None: there are none.

        Raises
        ------
        DataError
            Their list cannot be read.
        """
        return None

    def capturing(self, told: str) -> AbstractContextManager[None]:
        """Return a context within which a user can end frames that would come for ever.

        `told` is said when the user does.  Nothing changes where frames do not come so.
        """
        return nullcontext()

    def _note(self, text: str) -> None:
        if text not in self.notes:  # frames may be read more than once
            self.notes.append(text)

    def doubt_of_white(self, largest: float | None) -> str:
        """Return a warning if `largest`, the largest number, is far below white, else ''."""
        known = self._white_told is not None or self.full_scale != full_scale_of(self.dtype)
        decoded = self.kind in ("video", *LIVE) and self.dtype == np.uint8
        if largest is None or known or decoded:
            return ""
        told = doubt_of_white(largest, self.dtype, self.path)
        why = "all that was seen is far below it"
        return told and guessed(told, WHITE, int(full_scale_of(self.dtype)), why=why)

    @abstractmethod
    def shots(self) -> Iterator[Shot]:
        """Yield every frame of the source, not loaded, on the source's clock."""

    def frames(self) -> Iterator[Frame]:
        """Yield the selected frames, times strictly increasing.

        Nothing is yielded before a second frame is known to exist.

        Raises
        ------
        DataError
            Fewer than two frames, times that do not increase, a frame that cannot be read or
            differs from the first in size, data type or colour, or values that are not finite.
        """
        chosen = self._chosen()
        begin = deque([next(chosen), next(chosen)])
        while begin:
            yield begin.popleft()  # and keep none of them
        yield from chosen

    def _chosen(self) -> Iterator[Frame]:
        first: Shot | None = None
        previous: Shot | None = None
        origin: int | None = None
        yielded = 0
        self.passed_ns = array("q")
        for shot in self.shots():
            check_time(shot.t_ns, shot.label)
            self.passed_ns.append(shot.t_ns)
            first = first or shot
            if previous is not None and shot.t_ns <= previous.t_ns:
                raise DataError(
                    f"{shot.label}: times must increase; {seconds(shot.t_ns)} s is not after"
                    f" {seconds(previous.t_ns)} s; give --fps or --timestamps"
                )
            previous = shot
            since_first = shot.t_ns - first.t_ns
            if since_first > self.selection.stop_ns:
                break
            if since_first < self.selection.start_ns:
                continue
            if origin is None:
                origin = self.origin_ns = self._origin(first, shot)
            yielded += 1
            yield self._frame(shot, shot.t_ns - origin)
        if yielded < 2:
            span = previous.t_ns - first.t_ns if first is not None and previous is not None else 0
            raise self._too_few(yielded, span)

    def _origin(self, first: Shot, first_chosen: Shot) -> int:
        if self.selection.t0 == "zero":
            return first_chosen.t_ns
        return 0 if self.has_clock else first.t_ns

    def _too_few(self, count: int, span_ns: int) -> DataError:
        if self.ended_by_hand is not None:
            raise KeyboardInterrupt  # nothing came that could be kept
        found = "no frames" if count == 0 else "a single frame"
        if not self.selection.is_timed:
            return DataError(f"{self.path}: {found}; at least two are needed")
        return DataError(
            f"{self.path}: --start and --stop leave {found}, and at least two are needed; frames"
            f" were read up to {seconds(span_ns)} s"
        )

    def _frame(self, shot: Shot, t_ns: int) -> Frame:
        """Return a frame with its time, after checking it."""
        frame, label = shot.load(), shot.label
        image = frame.image
        first = self.whole, self.dtype, self.colour
        this = Size(image.shape[1], image.shape[0]), image.dtype, image.ndim == 3
        if this != first:
            told = _description(*this), _description(*first)
            raise DataError(f"{label}: {told[0]}, but the first frame is {told[1]}")
        frame = self.selection.of_frame(frame)
        check_values(frame.image, label)
        if frame.alpha is not None or frame.composed:
            self._note(OVER_BLACK)
        if self._light_is_stated and light_of_images(frame).encoding != self.encoding:
            line = f"not all frames state the same encoding as the first, such as {label}; all are"
            taken, why = self.encoding, "not all frames state the same encoding"
            self._note(guessed(f"{line} taken as {taken}", ENCODING, taken, why=why))
        if self.largest_read == 0 or self.doubt_of_white(self.largest_read):
            self.largest_read = max(self.largest_read, float(image.max()))
        odd = "" if self._white_told is not None else odd_white(frame, self._white_stated)
        return replace(frame, t_ns=t_ns, label=label, white=self.full_scale, odd_white=odd)


def _description(size: Size, dtype: np.dtype[Any], colour: bool) -> str:
    return f"{dtype.name} {'colour' if colour else 'grey'} of {size}"


# ---- Choices of the user for frames: their timestamps, and the selection of frames.


@dataclass(frozen=True)
class GivenTimes:
    """Timestamps that the user gives: a rate or a file in place of the source's own, and the unit.

    Parameters
    ----------
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times in lists.

    Raises
    ------
    UsageError
        If the rate is impossible.
    """

    fps: Rate | None = None
    timestamps: Path | None = None
    time_unit: str | None = None

    def __post_init__(self) -> None:
        if self.fps is not None:
            try:
                parse_rate(self.fps)
            except ValueError as error:
                raise UsageError(f"--fps: {error}") from error

    @classmethod
    def of(cls, options: FrameInput) -> GivenTimes:
        listed = options["timestamps"]
        return cls(options["fps"], Path(listed) if listed else None, options["time_unit"])

    @property
    def rate(self) -> FrameRate | None:
        """The constant rate, exactly; None if none is given."""
        return None if self.fps is None else FrameRate(parse_rate(self.fps))

    def __str__(self) -> str:
        if self.fps is None:
            return f"--timestamps {self.timestamps}"
        return f"--fps {self.fps:g}" if isinstance(self.fps, float) else f"--fps {self.fps}"

    def __bool__(self) -> bool:
        return self.fps is not None or self.timestamps is not None


@dataclass(frozen=True)
class Selection:
    """Selection of frames, or events, and zero of their time.

    Parameters
    ----------
    start_s, stop_s : float, optional
        First and last time wanted, counted from the source's first frame, or event [s]; a frame at
        either is in, so that neighbouring pieces share the frame between them.
    t0 : {'auto', 'keep', 'zero'}
        auto, keep: the source's own clock where there is one, else zero at the source's first
        frame.  zero: zero at the first frame wanted.
    allow_damaged : bool
        Damaged videos are accepted: all frames that can be decoded are wanted; faults are told.
    crop : Rectangle, optional
        Part of each frame that is wanted; default: all of it.
    bayer : {'RGGB', 'BGGR', 'GRBG', 'GBRG'}, optional
        Frames are mosaics of this pattern, and wanted in colour.
    rotate180 : bool
        Frames are wanted turned by half a turn, before they are cut.
    track : str, optional
        Track that is wanted, of several: its number or its name.
    """

    start_s: float | None = None
    stop_s: float | None = None
    t0: str = "auto"
    allow_damaged: bool = False
    crop: Rectangle | None = None
    bayer: str | None = None
    rotate180: bool = False
    track: str | None = None

    @classmethod
    def of(cls, options: SourceOptions | EventInput) -> Selection:
        given: dict[str, Any] = {item.name: options.get(item.name) for item in fields(cls)}
        track = options["track"]
        return cls(
            **{**given, "crop": crop_of(options), "track": None if track is None else str(track)}
        )

    @property
    def start_ns(self) -> int:
        """First time wanted, from the first frame [ns]."""
        return round((self.start_s or 0) * NS_PER_S)

    @property
    def stop_ns(self) -> float:
        """Last time wanted, from the first frame [ns]; infinite when there is none."""
        return math.inf if self.stop_s is None else round(self.stop_s * NS_PER_S)

    @property
    def is_timed(self) -> bool:
        """A part of the time is wanted."""
        return self.start_s is not None or self.stop_s is not None

    @property
    def left_out(self) -> list[str]:
        """What is left out before and after the time that is wanted, as a line, if there is any."""
        ends = {"before": self.start_s, "after": self.stop_s}
        told = [f"{side} {end:g} s" for side, end in ends.items() if end is not None]
        return [left_out(f"what is {' and '.join(told)} from the begin")] if told else []

    def check_crop(self, size: Size, label: str) -> None:
        """Raise DataError if the part that is wanted is not inside a frame of that size."""
        if self.crop is not None and not self.crop.is_inside(*size):
            raise DataError(f"{label}: --crop {self.crop} is not inside its {size} pixels")

    def of_frame(self, frame: Frame) -> Frame:
        """Return the selected part of a frame, upright, without the rest in memory."""
        if self.rotate180:
            frame = rotated180(frame)
        if self.crop is None:
            return frame
        x, y, width, height = self.crop
        part = slice(y, y + height), slice(x, x + width)
        alpha = None if frame.alpha is None else frame.alpha[part].copy()
        return replace(frame, image=frame.image[part].copy(), alpha=alpha)
