"""One picture, seen by a sensor that moves along a path (:mod:`adv2e.sources.paths`).

The picture itself is the image of every frame.  What the sensor sees of it from where it is, the
mean of the light on each of its pixels, is found where frames are brought to the sensor
(:mod:`adv2e.light.sensor`): so positions need no grid, and what is finer than a pixel is averaged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path

from adv2e.errors import DataError, UsageError
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.frame import Shot
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, read_image
from adv2e.sources.paths import SensorPath
from adv2e.sources.times.rates import NS_PER_S, FrameRate

_MOST_FRAMES = 10_000_000


def open_source(path: Path, given: GivenTimes, selection: Selection, along: SensorPath) -> Source:
    """Return the frames of a picture before which a sensor moves.

    Raises
    ------
    UsageError
        What is for frames that exist is given: a list of times, or its unit, a mosaic, damage.
    DataError
        It is no picture, or cannot be read.
    """
    if given.timestamps is not None:
        raise UsageError("--motion makes the frames: give --fps, or no times")
    of_frames = {
        "--time-unit": given.time_unit,
        "--bayer": selection.bayer,
        "--allow-damaged": selection.allow_damaged,
    }
    for option in (name for name, value in of_frames.items() if value):
        raise UsageError(f"--motion makes the frames of one picture: leave {option} out")
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise DataError(f"{path}: --motion moves before one picture, such as photo.png")
    return StillSource(path, given, selection, along)


class StillSource(Source):
    """Frames of one picture, of which each knows where the sensor looks."""

    def __init__(
        self, path: Path, given: GivenTimes, selection: Selection, along: SensorPath
    ) -> None:
        super().__init__(path, "still", selection, has_clock=False)
        self._picture = read_image(path)
        self._describe(self._picture, str(path))
        self.largest = float(self._picture.image.max())
        rate = given.rate
        whole = Fraction(str(along.duration))
        if rate is None:
            rate = FrameRate(along.intervals / whole)
        self._rate, self._end_ns = rate, round(whole * NS_PER_S)
        self.along = self._along = along
        count = int(whole * rate.hz) + 1
        if count > _MOST_FRAMES:
            raise DataError(
                f"{path}: {count:,} frames along the path; {_MOST_FRAMES:,} are the most: give a"
                " lower --fps, or a smaller --extent"
            )
        self.count = count
        self.notes.append(f"the sensor moves: {along}, in {count:,} frames")

    def shots(self) -> Iterator[Shot]:
        for number in range(self.count or 0):
            t_ns = self._rate.time_ns(number)
            offset = self._along.at(min(1.0, t_ns / self._end_ns))
            frame = replace(self._picture, offset=offset)
            yield Shot(t_ns, f"{self.path}: frame {number}", partial(replace, frame))
