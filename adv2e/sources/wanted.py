"""Choices of the user for frames: their timestamps, and the selection of frames."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from adv2e.errors import UsageError
from adv2e.geometry import Rectangle
from adv2e.options import FrameInput, SourceOptions, crop_of
from adv2e.sources.times.rates import NS_PER_S, FrameRate, Rate, parse_rate


@dataclass(frozen=True)
class GivenTimes:
    """Timestamps that the user gives: a rate or a file in place of the source's own, and the unit.

    Parameters
    ----------
    fps : float, Fraction or str, optional
    timestamps : Path, optional
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
        """Return what options say."""
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
    """Selection of frames and zero of their time.

    Parameters
    ----------
    start_s, stop_s : float, optional
        First and last time wanted, counted from the source's first frame [s]; a frame at either
        is in, so that neighbouring pieces share the frame between them.
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
    def of(cls, options: SourceOptions) -> Selection:
        """Return what options say."""
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
