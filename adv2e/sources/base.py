"""What every source of frames is: a description, and frames in the order of time.

A source states its geometry when it is opened and reads its frames one after another, as often as
asked.  Times are integer nanoseconds.  What must hold of any source (two frames at least, times
that increase, one size and data type, finite values) is checked here, once.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.brightness import doubt_of_white
from adv2e.effects.frames.encoding import encoding_of_images, full_scale_of
from adv2e.errors import DataError, UsageError
from adv2e.sources.times.instants import NS_PER_S, seconds
from adv2e.sources.times.rates import FrameRate, Rate, parse_rate
from adv2e.sources.times.units import UNITS
from adv2e.ticks import check_time

Image = NDArray[Any]
"""(rows, columns) or (rows, columns, 3) RGB; uint8, uint16, float32 or float64."""


@dataclass(frozen=True)
class Pixels:
    """An image as its file has it.

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
        Number that means white, where the file says it and it is not that of the data type.
    """

    image: Image
    alpha: NDArray[np.float32] | None = None
    composed: bool = False
    white: float | None = None


OVER_BLACK = "transparent pixels are composed over black, in linear light"
"""What is told, once, of a source that has some."""


RECORDED = "frames of a recording"
"""Why those are linear that cameras recorded beside events."""


@dataclass(frozen=True)
class Light:
    """What the numbers of frames stand for, and why, in a few words.

    Attributes
    ----------
    encoding : str
        What ``encoding: auto`` means.
    encoding_reason : str
    full_scale : float, optional
        Number that means white, whatever the files of the frames say of it.
    full_scale_reason : str
        Empty where the reason is the same, or the data type says it.
    """

    encoding: str
    encoding_reason: str
    full_scale: float | None = None
    full_scale_reason: str = ""


@dataclass(frozen=True)
class Frame:
    """One frame.

    Attributes
    ----------
    t_ns : int
        Its time [ns].
    image : array
        As read, colour as RGB.
    label : str
        Its name, for messages.
    alpha : array, optional
        See :class:`Pixels`.
    white : float, optional
        Number that means white in it; None: that of the data type.
    odd_white : str
        How the white that its file states differs from that of the first frame.
    """

    t_ns: int
    image: Image
    label: str = ""
    alpha: NDArray[np.float32] | None = None
    white: float | None = None
    odd_white: str = ""


@dataclass(frozen=True)
class Shot:
    """A frame not loaded yet: time on the source's clock [ns], name for messages, loader.

    A plain array stands for pixels that are all there, and of which no more is said.
    """

    t_ns: int
    label: str
    load: Callable[[], Image | Pixels]


@dataclass(frozen=True)
class GivenTimes:
    """What the user says of times: a rate or a file in place of the source's own, and the unit.

    Parameters
    ----------
    fps : float, Fraction or str, optional
    timestamps : Path, optional
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Unit of the times in lists.
    images_anywhere : bool
        The list of a recording may name images outside its folder.

    Raises
    ------
    UsageError
        If rate and file or rate and unit are given, or a value is impossible.
    """

    fps: Rate | None = None
    timestamps: Path | None = None
    time_unit: str | None = None
    images_anywhere: bool = False

    def __post_init__(self) -> None:
        if self.time_unit is not None and self.time_unit not in UNITS:
            raise UsageError(f"--time-unit: must be s, ms, us or ns, got {self.time_unit!r}")
        if self.fps is not None and self.time_unit is not None:
            raise UsageError("--time-unit is for lists of times, which --fps replaces; give one")
        if self.fps is not None and self.timestamps is not None:
            raise UsageError("--fps and --timestamps both say when the frames are; give one")
        if self.fps is not None:
            try:
                parse_rate(self.fps)
            except ValueError as error:
                raise UsageError(f"--fps: {error}") from error

    @property
    def rate(self) -> FrameRate | None:
        """The constant rate, exactly; None if none is given."""
        return None if self.fps is None else FrameRate(parse_rate(self.fps))

    def __str__(self) -> str:
        return f"--timestamps {self.timestamps}" if self.fps is None else f"--fps {self._fps_text}"

    @property
    def _fps_text(self) -> str:
        return f"{self.fps:g}" if isinstance(self.fps, float) else str(self.fps)

    def __bool__(self) -> bool:
        return self.fps is not None or self.timestamps is not None


@dataclass(frozen=True)
class Selection:
    """Which frames are wanted and where their time begins.

    Parameters
    ----------
    start_s, stop_s : float, optional
        First and last time wanted, counted from the source's first frame [s]; a frame at either
        is in, so that neighbouring pieces share the frame between them.
    t0 : {'auto', 'keep', 'zero'}
        auto, keep: the source's own clock where there is one, else zero at the source's first
        frame.  zero: zero at the first frame wanted.
    allow_damaged : bool
        What can be decoded of a damaged video is wanted; what is missing is told.

    Raises
    ------
    UsageError
        If a value is impossible.
    """

    start_s: float | None = None
    stop_s: float | None = None
    t0: str = "auto"
    allow_damaged: bool = False

    def __post_init__(self) -> None:
        for name, value in (("--start", self.start_s), ("--stop", self.stop_s)):
            if value is not None and not (value >= 0 and math.isfinite(value)):
                raise UsageError(f"{name}: must be seconds from the first frame, got {value:g}")
        if self.start_s is not None and self.stop_s is not None and self.stop_s <= self.start_s:
            raise UsageError(
                f"--stop: must be after --start ({self.start_s:g} s), got {self.stop_s:g}"
            )
        if self.t0 not in ("auto", "keep", "zero"):
            raise UsageError(f"--t0: must be auto, keep or zero, got {self.t0!r}")

    @property
    def start_ns(self) -> int:
        """First time wanted, from the first frame [ns]."""
        return round((self.start_s or 0) * NS_PER_S)

    @property
    def stop_ns(self) -> float:
        """Last time wanted, from the first frame [ns]; infinite when there is none."""
        return math.inf if self.stop_s is None else round(self.stop_s * NS_PER_S)


class Source(ABC):
    """Frames in the order of time, and what is known of them before they are read.

    Attributes
    ----------
    path : str
        What was opened.
    kind : str
        ``video``, ``images``, ``davis240c`` or ``npy``.
    width, height : int
        Columns and rows of the frames.
    dtype : numpy.dtype
        Data type of the frames.
    colour : bool
        Frames are (rows, columns, 3) RGB.
    count : int or None
        Frames that `frames` will yield; None where only reading tells.  For a video it is what the
        file states, and good for showing progress.
    has_clock : bool
        Times are on a clock of the source's own, not counted from its first frame.
    encoding : str
        What ``encoding: auto`` means here.
    encoding_reason : str
        Why, in a few words.
    full_scale : float
        Number that means white.
    full_scale_reason : str
        Who says so; empty where the data type does.
    largest : float or None
        Largest number of the frames that were looked at when it was opened; None: of none.
    largest_read : float
        Largest whole number of the frames read until now, as long as it may be far below white.
    doubts : list of str
        Things to tell the user before any work.
    notes : list of str
        Things to tell the user.
    threads : int
        Threads that decoding may use; one, unless set otherwise before `frames`.
    packages : tuple of str
        Optional packages that decode it.
    """

    def __init__(self, path: Path, kind: str, selection: Selection, has_clock: bool) -> None:
        self.path = str(path)
        self.kind = kind
        self.selection = selection
        self.has_clock = has_clock
        self.largest: float | None = None
        self.largest_read = 0.0
        self.doubts: list[str] = []
        self.notes: list[str] = []
        self.count: int | None = None
        self.threads = 1
        self.packages: tuple[str, ...] = ()

    def _describe(self, first: Image | Pixels, label: str, light: Light | None = None) -> None:
        """Take geometry, data type and meaning of the numbers from the first frame.

        `light` is what they mean where the kind of source says it, and not the image.
        """
        pixels = as_pixels(first)
        image = pixels.image
        try:
            self.full_scale = full_scale_of(image.dtype)
        except DataError as error:
            raise DataError(f"{label}: {error}") from error
        self.height, self.width = image.shape[:2]
        self.dtype = image.dtype
        self.colour = image.ndim == 3
        light = light or _light_of_images(image.dtype, self.colour)
        self.encoding, self.encoding_reason = light.encoding, light.encoding_reason
        self.full_scale_reason = ""
        self._white_told, self._white_stated = light.full_scale, pixels.white
        if light.full_scale is not None:
            self.full_scale, self.full_scale_reason = light.full_scale, light.full_scale_reason
        elif pixels.white is not None:
            self.full_scale, self.full_scale_reason = pixels.white, "as its header says"

    @property
    def light(self) -> Light:
        """What the numbers of the frames stand for."""
        return Light(self.encoding, self.encoding_reason, self.full_scale, self.full_scale_reason)

    def doubt_of_white(self, largest: float | None) -> str:
        """Return what is to be told if `largest` is the largest of all numbers; often nothing."""
        known = self._white_told is not None or self.full_scale != full_scale_of(self.dtype)
        decoded = self.kind == "video" and self.dtype == np.uint8
        if largest is None or known or decoded:
            return ""
        return doubt_of_white(largest, self.dtype, self.path)

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
        for shot in self.shots():
            check_time(shot.t_ns, shot.label)
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
                origin = self._origin(first, shot)
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
        found = "no frames" if count == 0 else "a single frame"
        if self.selection.start_s is None and self.selection.stop_s is None:
            return DataError(f"{self.path}: {found}; at least two are needed")
        return DataError(
            f"{self.path}: --start and --stop leave {found} of those read up to"
            f" {seconds(span_ns)} s; at least two are needed"
        )

    def _frame(self, shot: Shot, t_ns: int) -> Frame:
        pixels = self._load(shot)
        odd = "" if self._white_told is not None else odd_white(pixels, self._white_stated)
        return Frame(t_ns, pixels.image, shot.label, pixels.alpha, self.full_scale, odd)

    def _load(self, shot: Shot) -> Pixels:
        pixels, label = as_pixels(shot.load()), shot.label
        image = pixels.image
        first = _description(self.width, self.height, self.dtype, self.colour)
        this = _description(image.shape[1], image.shape[0], image.dtype, image.ndim == 3)
        if this != first:
            raise DataError(f"{label}: {this}, but the first frame is {first}")
        check_values(image, label)
        if (pixels.alpha is not None or pixels.composed) and OVER_BLACK not in self.notes:
            self.notes.append(OVER_BLACK)
        if self.largest_read == 0 or self.doubt_of_white(self.largest_read):
            self.largest_read = max(self.largest_read, float(image.max()))
        return pixels


def odd_white(pixels: Pixels, first: float | None) -> str:
    """Return how the white of an image differs from `first`, that of the first; or nothing.

    None is that of the data type.  Where all is black, white does not matter.
    """
    usual = full_scale_of(pixels.image.dtype)
    white, expected = pixels.white or usual, first or usual
    if white == expected or not pixels.image.any():
        return ""
    return (
        f"white is {white:g} in it, but {expected:g} in the first frame; say what it is in all,"
        f" with frames.full_scale={expected:g} or another number"
    )


def as_pixels(loaded: Image | Pixels) -> Pixels:
    """Return what a loader gave as pixels."""
    return loaded if isinstance(loaded, Pixels) else Pixels(loaded)


def _light_of_images(dtype: np.dtype[Any], colour: bool) -> Light:
    depth = "floating-point" if dtype.kind == "f" else f"{8 * dtype.itemsize}-bit"
    reason = f"{depth} {'colour' if colour else 'grey'} images"
    if dtype == np.uint8 and not colour:
        reason += "; frames.encoding=srgb if they are ordinary pictures"
    return Light(encoding_of_images(dtype, colour), reason)


def check_values(image: Image, label: str) -> None:
    """Raise DataError if a float image holds NaN, infinite or negative values."""
    if image.dtype.kind != "f" or image.size == 0:
        return
    low, high = float(image.min()), float(image.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise DataError(f"{label}: pixels that are NaN or infinite; light must be a finite number")
    if low < 0:
        raise DataError(f"{label}: a pixel of {low:g}; light cannot be negative")


def _description(width: int, height: int, dtype: np.dtype[Any], colour: bool) -> str:
    return f"{dtype.name} {'colour' if colour else 'grey'} of {width}x{height}"
