"""A measured recording with frames and events, and how far simulators are from it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.compare import Floor
from adv2e.comparison.distances import distances, pooled
from adv2e.comparison.windows import Windows, frame_windows, span_of, to_us
from adv2e.diagnosis.fitting.fitter import TOLERANCE, match_totals
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import DataError
from adv2e.events import Events, Window, cut
from adv2e.formats.reading import read_events
from adv2e.sources import Source, open_source
from experiments.clip import Clip, Simulator

SCORE = "relative_5_bins_smoothed"
"""The distance that tables judge by."""
STILL_DN = 2.0
"""A still pixel's frames vary by less than this, as a standard deviation [DN of 255]."""
STILL_MARGIN = 4
"""Pixels this near to one that is not still are not still either [pixels]."""
BEYOND_US = 100_000
"""Frames are simulated to this long after the windows [us]."""
SILENCE = 1000
"""A stretch without one event was not recorded where, at the mean rate, it would have so many."""
WIDEST = 25.0
"""Thresholds are sought from 1/25 to 25 times those of the simulator."""


def totals(events: Events) -> tuple[int, int]:
    """Return the counts of ON and OFF events."""
    on = int(np.count_nonzero(events["p"]))
    return on, len(events) - on


def _totals_in(events: Events, windows: Windows) -> tuple[int, int]:
    """Return the counts of ON and OFF events in each of the windows, added up."""
    found = [totals(cut(events, start, stop)) for start, stop in windows.used]
    return sum(on for on, _ in found), sum(off for _, off in found)


@dataclass(frozen=True)
class Counts:
    """Means over streams of what is told of each by itself; None where it is not defined."""

    events: float
    on_share: float | None
    still_hz: float | None


@dataclass(frozen=True)
class Judged:
    """A simulator against the measured events, and its seeds against each other: means."""

    values: Floor
    floor: Floor
    made: Counts
    measured: Counts


@dataclass(frozen=True)
class Recording:
    """A recording with frames and events.

    `windows` are the frame intervals that the events cover; pixels that are `still` see no change
    within these.  `problems` are what is doubtful.
    """

    name: str
    events: Events
    source: Source
    times_us: NDArray[np.int64]
    windows: Windows
    still: NDArray[np.bool_]
    problems: list[str]

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.source.width, self.source.height

    @cached_property
    def clip(self) -> Clip:
        """Its frames, in linear light."""
        source = self.source
        decoder = decoder_of(source)
        plain = source.dtype == np.uint8 and not source.colour and source.encoding == "linear"
        frames = list(source.frames())
        light = [one.image if plain else decoder.decode(one.image) for one in frames]
        return Clip(np.stack(light), np.array([one.t_ns for one in frames], np.int64))

    @cached_property
    def silences(self) -> list[Window]:
        """Stretches in which the camera recorded nothing [us], both ends excluded."""
        t = self.events["t"]
        at = np.flatnonzero(np.diff(t) * float(len(t)) >= SILENCE * float(t[-1] - t[0]))
        return [(int(t[i]), int(t[i + 1])) for i in at]

    def seen(self, events: Events, windows: Windows) -> Events:
        """Return the events in the windows, without those that the camera could not record."""
        events = cut(events, windows.start, windows.stop)
        kept = np.ones(len(events), np.bool_)
        for start, stop in self.silences:
            kept &= (events["t"] <= start) | (events["t"] >= stop)
        return events[kept]

    def made(self, simulator: Simulator, windows: Windows, seeds: Sequence[int]) -> list[Events]:
        """Return what a simulator makes of the frames, in the windows, a seed each."""
        clip = self.clip.until(windows.stop + BEYOND_US)
        return [self.seen(simulator.events(clip, seed), windows) for seed in seeds]

    def against(self, streams: Sequence[Events], windows: Windows) -> Judged:
        """Return how far streams of one simulator, cut to the windows, are from the measured."""
        measured = cut(self.events, windows.start, windows.stop)
        found = [distances(measured, one, windows, *self.size).values for one in streams]
        apart = [
            distances(*pair, windows, *self.size, whole=measured).values
            for pair in itertools.combinations(streams, 2)
        ]
        values, floor = (
            {name: pooled([one[name] for one in each], "mean") for name in each[0]}
            for each in (found, apart)
        )
        made_of, measured_of = (self._counts(one, windows) for one in (streams, [measured]))
        return Judged(values, floor, made_of, measured_of)

    def _counts(self, streams: Sequence[Events], windows: Windows) -> Counts:
        shares = [totals(one)[0] / len(one) if len(one) else None for one in streams]
        rates = [still_rate(one, self.still, windows.duration_s) for one in streams]
        count = float(np.mean([len(one) for one in streams]))
        return Counts(count, pooled(shares, "mean"), pooled(rates, "mean"))

    def matched(self, simulator: Simulator, windows: Windows) -> tuple[Simulator, float]:
        """Return it with thresholds that match the totals in the windows, and what they miss by.

        A simulator that cannot be run anew is returned as it is.  The windows may have gaps.
        """
        goal = _totals_in(self.events, windows)
        return matched(
            simulator, goal, lambda one: _totals_in(self.made(one, windows, [0])[0], windows)
        )

    def all_matched(
        self, simulators: Sequence[Simulator], windows: Windows
    ) -> dict[str, Simulator]:
        """Return them so, by what tables call them: with thresholds, marked where they miss."""
        found = {}
        for one in simulators:
            simulator, miss = self.matched(one, windows)
            label = one.name
            if simulator.levels is not None:
                label += ", ON {:.3f} OFF {:.3f}".format(*simulator.levels)
            label += " (!)" if miss > TOLERANCE else ""
            click.echo(f"{self.name}: {label}: totals miss by {miss:.1%}", err=True)
            found[label] = simulator
        return found


def matched(
    simulator: Simulator, goal: tuple[int, int], made: Callable[[Simulator], tuple[int, int]]
) -> tuple[Simulator, float]:
    """Return a simulator with thresholds that match totals of ON and OFF, and what they miss by.

    `made` returns the totals that a simulator makes.
    """
    levels = simulator.levels
    if levels is None:
        off_by = np.abs(np.subtract(made(simulator), goal)) / np.maximum(goal, 1)
        return simulator, float(np.max(off_by))
    found, miss = match_totals(
        lambda on, off: made(simulator.with_levels(on, off)),
        levels,
        goal,
        within=(min(levels) / WIDEST, max(levels) * WIDEST),
    )
    return simulator.with_levels(*found), miss


def read(folder: str) -> Recording:
    """Return the recording in a folder: DAVIS240C, or with ``events.npz`` for ``events.txt``."""
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
    return Recording(
        name=Path(folder).resolve().name,
        events=recording.events,
        source=source,
        times_us=to_us(times),
        windows=windows,
        still=still_pixels(_light(source, to_us(times), windows)),
        problems=[*recording.problems, *source.notes],
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
    """Return the first half of the windows and the rest."""
    middle = len(windows.used) // 2
    if not middle:
        raise DataError(
            "two frame intervals or more that events cover are needed to match totals on one half"
        )
    first, second = windows.used[:middle], windows.used[middle:]
    return replace(windows, used=first), replace(windows, used=second)


def all_but_one(windows: Windows) -> Iterator[tuple[Windows, Windows]]:
    """Yield, for each of the windows, all others and it alone."""
    if len(windows.used) < 2:
        raise DataError(
            "two frame intervals or more that events cover are needed to leave one of them out"
        )
    for k, one in enumerate(windows.used):
        others = windows.used[:k] + windows.used[k + 1 :]
        yield replace(windows, used=others), replace(windows, used=(one,))
