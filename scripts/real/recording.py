"""A real recording with frames and events, and its frames simulated."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.resimulation import resimulator
from adv2e.comparison.windows import Windows, frame_windows, span_of, to_us
from adv2e.config import Config
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.reading import read_events
from adv2e.sources import Frame, Source, open_source

STILL_DN = 2.0
"""A still pixel's frames vary by less than this, as a standard deviation [DN of 255]."""
STILL_MARGIN = 4
"""Pixels this near to one that is not still are not still either [pixels]."""


@dataclass(frozen=True)
class Real:
    """A recording with frames and events.

    Attributes
    ----------
    name : str
        Of its folder.
    events : Events
        As measured.
    source : Source
        The frames.
    times_us : array of int64, (frames,)
        Their times [us].
    windows : Windows
        The frame intervals that the events cover.
    still : array of bool, (rows, columns)
        Pixels that see no change within the windows.
    problems : list of str
        What is doubtful.
    used : array of bool, (frames,)
        Frames that simulations see.
    """

    name: str
    events: Events
    source: Source
    times_us: NDArray[np.int64]
    windows: Windows
    still: NDArray[np.bool_]
    problems: list[str]
    used: NDArray[np.bool_]

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.source.width, self.source.height

    def frames(self) -> Iterator[Frame]:
        """Yield the frames that are used."""
        for frame, used in zip(self.source.frames(), self.used, strict=True):
            if used:
                yield frame

    def simulator(
        self, config: Config, until_us: int, threads: int | None
    ) -> Callable[[int], Events]:
        """Return a function from a seed to the events of the frames up to a time [us]."""

        def frames() -> Iterator[Frame]:
            for frame, t_us in zip(self.frames(), self.times_us[self.used], strict=True):
                if t_us > until_us:
                    return
                yield frame

        # its frames lie on its own sensor, whatever camera the configuration is of
        config = replace(config, sensor=None)
        return resimulator(frames, config, self.source.encoding, self.size, threads=threads)

    def thinned(self) -> Real:
        """Return the recording with every second frame alone, the last one kept."""
        kept = np.zeros(len(self.times_us), np.bool_)
        kept[::-2] = True
        kept[0] = True
        return replace(self, used=kept)


def read(folder: str) -> Real:
    """Return the recording in a folder: DAVIS240C, or with ``events.npz`` for ``events.txt``.

    Raises
    ------
    DataError
        It has no frames or no events, is damaged, or its events cover no frame interval.
    """
    apart = Path(folder) / "events.npz"
    recording = read_events(apart if apart.is_file() else folder)
    source = open_source(folder)
    if (source.width, source.height) != (recording.width, recording.height):
        raise DataError(
            f"{folder}: events of {recording.width}x{recording.height} pixels, but frames of"
            f" {source.width}x{source.height}"
        )
    span = span_of(recording.events)
    if span is None:
        raise DataError(f"{folder}: holds no events to compare with")
    times = np.array([frame.t_ns for frame in source.frames()], np.int64)
    windows = frame_windows(times, [span])
    return Real(
        name=Path(folder).resolve().name,
        events=recording.events,
        source=source,
        times_us=to_us(times),
        windows=windows,
        still=still_pixels(_light(source, to_us(times), windows)),
        problems=[*recording.problems, *source.notes],
        used=np.ones(len(times), np.bool_),
    )


def decoder_of(source: Source) -> LightDecoder:
    """Return what makes light of the frames of a source, as ``encoding: auto`` has it."""
    return LightDecoder(source.encoding, source.full_scale, source.dtype, source.colour)


def _light(source: Source, times_us: NDArray[np.int64], windows: Windows) -> Iterator[NDArray[Any]]:
    """Yield the light [DN] of the frames inside the windows."""
    decoder = decoder_of(source)
    for frame, t_us in zip(source.frames(), times_us, strict=True):
        if windows.start <= t_us <= windows.stop:
            yield decoder.decode(frame.image)


def still_pixels(light: Iterator[NDArray[Any]]) -> NDArray[np.bool_]:
    """Return which pixels vary by less than STILL_DN, as do all within STILL_MARGIN of them.

    Parameters
    ----------
    light : iterator of (rows, columns)
        Frames [DN], one at least.
    """
    first = next(light).astype(np.float64)
    sums, squares, count = np.zeros_like(first), np.zeros_like(first), 1
    for frame in light:
        change = frame - first  # small where it matters, so that the squares do not cancel
        sums += change
        squares += change * change
        count += 1
    steady = squares / count - (sums / count) ** 2 < STILL_DN**2
    around = np.ones((2 * STILL_MARGIN + 1, 2 * STILL_MARGIN + 1), np.uint8)
    return cv2.erode(steady.astype(np.uint8), around).astype(bool)


def still_rate(events: Events, still: NDArray[np.bool_], duration_s: float) -> float | None:
    """Return events a still pixel a second, None if no pixel is still."""
    pixels = int(np.count_nonzero(still))
    count = int(np.count_nonzero(still[events["y"], events["x"]]))
    return count / (pixels * duration_s) if pixels else None


def halves(windows: Windows) -> tuple[Windows, Windows]:
    """Return the first half of the windows and the rest.

    Raises
    ------
    DataError
        There is only one window.
    """
    middle = len(windows.used) // 2
    if not middle:
        raise DataError(
            "two frame intervals or more that events cover are needed to match totals on one half"
        )
    first, second = windows.used[:middle], windows.used[middle:]
    return replace(windows, used=first), replace(windows, used=second)
