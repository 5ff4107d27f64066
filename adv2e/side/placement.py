"""Where a point of the frames lies on the sensor, and at what time of the events.

    x' = s (x - o) - d          t' = u + rho (u - u0) + c - z,   u = f(t)

x           column, or row, of the frame, from its upper left corner [px]: x + 1/2 is the middle
            of a pixel; counted from the other end if the frame is turned by half a turn
s, o        scale and origin of the fit to the sensor and of --crop
d           frames.shift_px
f           from the source's own clock to that of its frames, where --fps or --timestamps gave
            these other times: linear from frame to frame, and on beyond the first and last
u0, rho, c  first frame simulated, frames.clock_drift_ppm, frames.clock_offset_us
z           zero of the events' clock (--t0)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adv2e.errors import DataError
from adv2e.geometry import Rectangle, Size
from adv2e.light.sensor import Fitting
from adv2e.sources.base import Selection

Times = NDArray[np.int64]


@dataclass(frozen=True)
class Placement:
    """Where the points of frames lie on the sensor.

    Attributes
    ----------
    whole : Size
        Of the frames before they are turned or cut.
    size : Size
        Of the sensor.
    turned : bool
        By half a turn.
    scale, origin : (float, float)
        Pixels of the sensor for one of the frame, and the point of the turned frame that lies in
        the upper left corner [px].
    """

    whole: Size
    size: Size
    turned: bool = False
    scale: tuple[float, float] = (1.0, 1.0)
    origin: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(
        cls,
        whole: Size,
        chosen: Selection,
        fitting: Fitting | None = None,
        shift_px: tuple[float, float] = (0.0, 0.0),
    ) -> Placement:
        """Return the placement of frames of which a part is chosen, and fitted to the sensor."""
        crop = chosen.crop or Rectangle(0, 0, *whole)
        size, scale, origin = Size(crop.width, crop.height), (1.0, 1.0), (0.0, 0.0)
        if fitting is not None:
            told = fitting.placement()
            size, scale, origin = fitting.size, tuple(told["scale"]), tuple(told["origin"])
        x, y = (
            begin + place + shift / by
            for begin, place, shift, by in zip(crop[:2], origin, shift_px, scale, strict=True)
        )
        return cls(whole, size, chosen.rotate180, scale, (x, y))

    def points(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return where points (..., 2) of the frame lie on the sensor, from its corner [px]."""
        found = np.asarray(points, np.float64)
        if self.turned:
            found = np.array(self.whole) - found
        return np.asarray((found - self.origin) * self.scale)

    def taken(self, values: NDArray[Any], outside: float = 0) -> NDArray[Any]:
        """Return a map (rows, columns, ...) on the sensor: of the nearest point, or `outside`."""
        if self.turned:
            values = values[::-1, ::-1]
        lines = []
        for count, size, scale, origin in zip(
            self.whole, self.size, self.scale, self.origin, strict=True
        ):
            at = np.floor((np.arange(size) + 0.5) / scale + origin).astype(np.int64)
            lines.append((np.clip(at, 0, count - 1), (at >= 0) & (at < count)))
        (columns, across), (rows, down) = lines
        found = values[np.ix_(rows, columns)]
        found[~(down[:, np.newaxis] & across)] = outside
        return np.ascontiguousarray(found)

    def check(self, size: Size, label: str) -> None:
        """Raise DataError for what was made of pictures of another size."""
        if size != self.whole:
            raise DataError(f"{label}: of pictures of {size}, and the frames are {self.whole}")


@dataclass(frozen=True)
class Clock:
    """The way from the times of a source to those of the events.

    Attributes
    ----------
    frames : (n,) int64
        Times of the frames of the source, from the first on [ns].
    names : sequence of str
        Names of their files; empty where they have none.
    own : (n,) int64, optional
        Their times on the source's own clock, which others replace [ns].
    first, begin, end
        First frame simulated, and what --start and --stop leave [ns].
    zero, offset_us, drift_ppm
        Of the clock of the events; see the equation.
    """

    frames: Times
    names: Sequence[str] = ()
    own: Times | None = None
    first: int = 0
    begin: float = -math.inf
    end: float = math.inf
    zero: int = 0
    offset_us: float = 0.0
    drift_ppm: float = 0.0

    def of(self, times: ArrayLike) -> tuple[Times, NDArray[np.bool_]]:
        """Return times of the source on the events' clock [ns], and which of them are wanted."""
        return self._out(self._on_frames(np.asarray(times, np.int64)))

    def of_frames(self, numbers: ArrayLike) -> tuple[Times, NDArray[np.bool_]]:
        """Return the times of frames by their numbers, as :meth:`of` does."""
        return self._out(self.frames[np.asarray(numbers, np.int64)])

    def numbers(self, names: Sequence[str], label: str, short_by: int = 0) -> list[int]:
        """Return the frame that each file is of: by its name, or else by its place among them.

        Parameters
        ----------
        names : sequence of str
            In the order of frames.
        short_by : int
            There are so many fewer than frames: of flow, one.

        Raises
        ------
        DataError
            Neither tells it.
        """
        known = {PurePosixPath(name).stem: number for number, name in enumerate(self.names)}
        found = [known.get(PurePosixPath(name).stem) for name in names]
        told = [number for number in found if number is not None]
        if told and len(told) == len(found):
            return told
        count = len(self.frames) - short_by
        # of a video, no more frames are read than are wanted
        more = not self.names and math.isfinite(self.end) and len(names) > count
        if not told and (more or len(names) in (len(self.frames), count)):
            return list(range(min(len(names), count)))
        other = next((name for name, number in zip(names, found, strict=True) if number is None))
        raise DataError(
            f"{label}: {len(names)} files for {len(self.frames)} frames, and {other} has the name"
            " of none"
        )

    def _on_frames(self, times: Times) -> Times:
        own, used = self.own, self.frames
        if own is None or len(own) < 2 or np.array_equal(own, used):
            return times
        at = np.clip(np.searchsorted(own, times, "right") - 1, 0, len(own) - 2)
        rate = (used[at + 1] - used[at]) / (own[at + 1] - own[at])
        rest = np.rint((times - own[at]) * rate).astype(np.int64)
        found: Times = used[at] + rest
        return found

    def _out(self, times: Times) -> tuple[Times, NDArray[np.bool_]]:
        wanted = (times >= self.begin) & (times <= self.end)
        drift = np.rint((times - self.first) * (self.drift_ppm * 1e-6)).astype(np.int64)
        return times + drift + round(self.offset_us * 1e3) - self.zero, wanted
