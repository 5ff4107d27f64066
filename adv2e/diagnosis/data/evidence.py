"""The recording that is diagnosed: frames, events, and what was set aside before anything else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.config.model import Sensor
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.data.stimulus import Seen, Stimulus, joined
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import DataError
from adv2e.files.regular import shown
from adv2e.formats.reading import read_events
from adv2e.geometry import Rectangle
from adv2e.light.decoding import decoder_for
from adv2e.light.sensor import check_beside
from adv2e.reports.result import Masked

LEAST_EVENTS = 1000
"""Below that nothing can be told."""
RUN_IN_S = 0.5
"""Run-in: simulated time before the first frame of interest [s]; most pixels fire in it."""
_RUN_IN_SHARE = 0.5
"""Longest run-in, as a share of the time of interest."""
_UNCOVERED = 10.0
"""A pause at an end that is longer than the longest within by this factor is no pause."""


@dataclass(frozen=True)
class RunIn:
    """Frames before the first that is looked at, with their times [s]: pixels saw them."""

    frames: Sequence[NDArray[Any]] = field(default_factory=list)
    times_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Evidence:
    """Frames, or known light, and events of one recording on one clock.

    Attributes
    ----------
    frames : sequence of (rows, columns[, 3]) arrays
        As stored; of known light, evenly spaced instants of it.
    times_s : (frames,)
        Their stamps [s].
    stream : Stream
        Events between the first frame and the last.
    encoding : str
        What ``frames.encoding: auto`` means for the frames.
    run_in : RunIn
        What pixels saw before; events of that time are of no recording and no simulation.
    white : float, optional
        Number that means white in the frames; None: that of their data type.
    stimulus : Stimulus, optional
        Light that is known at all times: what is simulated, in the place of frames.
    """

    name: str
    frames: Sequence[NDArray[Any]]
    times_s: NDArray[np.float64]
    stream: Stream
    width: int
    height: int
    encoding: str = "linear"
    masked: list[Masked] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    run_in: RunIn = field(default_factory=RunIn)
    white: float | None = None
    stimulus: Stimulus | None = None

    @property
    def times_ns(self) -> list[int]:
        return [round(t * 1e9) for t in self.times_s.tolist()]

    @property
    def seconds(self) -> float:
        return float(self.times_s[-1] - self.times_s[0])

    @property
    def before_s(self) -> float:
        """Time from the first frame that is simulated to the first that is looked at [s]."""
        before = self.run_in.times_s
        return float(self.times_s[0] - before[0]) if len(before) else 0.0

    @property
    def simulated(self) -> Evidence:
        """The same with the frames that are simulated: after those of the run-in."""
        before = self.run_in
        if not before.frames:
            return self
        return replace(
            self,
            frames=joined(before.frames, self.frames),
            times_s=np.concatenate([before.times_s, self.times_s]),
            run_in=RunIn(),
        )

    def _decoder(self, declared: Config) -> LightDecoder:
        image, auto = self.frames[0], self.encoding
        is_colour = image.ndim == 3
        return decoder_for(declared.frames, image.dtype, is_colour, auto=auto, white=self.white)

    def lights(self, declared: Config) -> Iterator[NDArray[Any]]:
        """Yield the light of each frame [DN], (rows, columns), as a model reads their numbers."""
        yield from map(self._decoder(declared).decode, self.frames)

    def light(self, declared: Config) -> NDArray[np.float32]:
        """Return the light of all frames [DN], (frames, rows, columns)."""
        return np.array(list(self.lights(declared)), np.float32)

    def quantum_dn(self, declared: Config) -> float:
        """Return the step of the frames' numbers [DN]; zero for floating-point frames."""
        decoder = self._decoder(declared)
        return 255.0 / decoder.full_scale if np.issubdtype(decoder.dtype, np.integer) else 0.0

    def instants(self, declared: Config) -> tuple[list[int], NDArray[np.float32]]:
        """Return times [ns] and light [DN] of what is simulated, (instants, rows, columns).

        Those of the frames, with the run-in; of a known light, all instants at which it bends.
        """
        shown = self.simulated
        if self.stimulus is None:
            return shown.times_ns, shown.light(declared)
        course = self.stimulus.between(shown.times_ns[0], shown.times_ns[-1])
        return course.times_ns.tolist(), course.light.astype(np.float32)[:, course.region]

    def cut(self, rows: slice, columns: slice) -> Evidence:
        """Return the frames and events of a rectangle of pixels, given as slices."""
        number = np.arange(self.width * self.height).reshape(self.height, self.width)
        chosen = number[rows, columns]
        place = np.full(number.size, -1, np.int32)
        place[chosen.ravel()] = np.arange(chosen.size)
        pixel, (height, width) = place[self.stream.pixel], chosen.shape
        inside = pixel >= 0
        stream = self.stream
        kept = Stream(stream.t[inside], pixel[inside], stream.on[inside], width, height)
        part = replace(self, stream=kept, width=width, height=height)
        if self.stimulus is None:
            return part.with_frames(lambda frame: frame[rows, columns])
        seen = self.stimulus.cut(rows, columns)

        def of_part(frames: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
            return Seen(frames.light, seen.region) if isinstance(frames, Seen) else frames

        before = replace(self.run_in, frames=of_part(self.run_in.frames))
        return replace(part, stimulus=seen, frames=of_part(self.frames), run_in=before)

    def without(self, what: str, of: int | None = None) -> Evidence:
        """Return the same with a note on what was set aside; `of`: events that there were."""
        lost = 0.0 if of is None else 1.0 - len(self.stream) / of
        return replace(self, masked=[*self.masked, Masked(what, lost)])

    def with_frames(self, changed: Callable[[NDArray[Any]], NDArray[Any]]) -> Evidence:
        before = replace(self.run_in, frames=[changed(one) for one in self.run_in.frames])
        return replace(self, frames=[changed(one) for one in self.frames], run_in=before)

    def during(self, first: int, last: int) -> Evidence:
        """Return the recording from frame `first` to frame `last`; pixels saw those before."""
        whole = self.simulated
        begin = first + len(self.run_in.frames)
        looked_at_s = self.times_s[last] - self.times_s[first]
        since_s = self.times_s[first] - min(RUN_IN_S, _RUN_IN_SHARE * looked_at_s)
        since = int(np.searchsorted(whole.times_s, since_s))
        return replace(
            self,
            frames=self.frames[first : last + 1],
            times_s=self.times_s[first : last + 1],
            stream=self.stream.between(self.times_s[first] * 1e6, self.times_s[last] * 1e6),
            run_in=RunIn(whole.frames[since:begin], whole.times_s[since:begin]),
        )


def read_evidence(path: str | Path, sensor: Sensor | None = None, **reading: Any) -> Evidence:
    """Read a recording that holds frames and events; `reading` as :func:`read_events` takes it.

    Raises
    ------
    DataError
        It does not have the size of the `sensor` that is declared; it cannot be read, has no
        frames, fewer than three, or too few events; frames and events do not overlap in time;
        frames are out of order, not all alike, or of another size than the events.
    """
    recording = read_events(path, **reading)
    check_beside(recording.width, recording.height, sensor, recording.path)
    if recording.frame_times_ns is None or len(recording.frame_times_ns) == 0:
        raise DataError(f"{path}: holds no frames, from which the events could be simulated")
    frames, times = [], []
    white = None
    for frame in recording.frames():
        if frame.odd_white or frame.alpha is not None:
            raise DataError(
                f"{frame.label}: {frame.odd_white or 'must have no transparent pixels'}"
            )
        white = frame.white
        frames.append(np.asarray(frame.image))
        times.append(frame.t_ns * 1e-9)
    if len(frames) < 3:
        raise DataError(f"{path}: holds {len(frames)} frames, at least 3 are needed")
    times_s = np.array(times)
    if np.any(np.diff(times_s) <= 0):
        first = int(np.argmax(np.diff(times_s) <= 0)) + 1
        raise DataError(f"{path}: frame {first} is not later than the one before it")
    _check_alike(path, frames)
    height, width = frames[0].shape[:2]
    if (width, height) != (recording.width, recording.height):
        raise DataError(
            f"{path}: frames have {width}x{height} pixels, events {recording.width}x"
            f"{recording.height}"
        )
    times_us = recording.events["t"]
    inside = (times_us >= times_s[0] * 1e6) & (times_us < times_s[-1] * 1e6)
    kept = recording.events[inside]
    if len(recording.events) and not len(kept):
        spans = (recording.events["t"][[0, -1]] * 1e-6).tolist(), times_s[[0, -1]].tolist()
        events, pictures = (f"{first:.3f} to {last:.3f} s" for first, last in spans)
        raise DataError(
            f"{path}: events come from {events}, frames from {pictures}: they must be on one clock"
        )
    check_events(len(kept), path, "between its first and its last frame")
    lost = 1.0 - len(kept) / len(inside)
    masked = [Masked("events before the first frame or after the last", lost)] if lost else []
    whole = Evidence(
        name=shown(path),
        frames=frames,
        times_s=times_s,
        stream=Stream.of(kept, width, height),
        width=width,
        height=height,
        encoding=recording.encoding,
        masked=masked,
        notes=list(recording.problems),
        white=white,
    )
    return of_covered_time(whole, kept["t"])


def part_of(
    evidence: Evidence,
    start_s: float | None = None,
    stop_s: float | None = None,
    crop: Rectangle | None = None,
) -> Evidence:
    """Return a part of a recording: time since its first frame [s], and a part of its sensor.

    Raises
    ------
    DataError
        The part is not on the sensor, or holds fewer than three frames or too few events.
    """
    part, name = evidence, evidence.name
    if crop is not None:
        if not crop.is_inside(part.width, part.height):
            raise DataError(
                f"{name}: --crop {crop} does not lie on the sensor of {part.width}x{part.height}"
                " pixels"
            )
        columns = slice(crop.x, crop.x + crop.width)
        part = part.cut(slice(crop.y, crop.y + crop.height), columns)
    if start_s is not None or stop_s is not None:
        since_s = np.round(part.times_s - part.times_s[0], 9)
        first = int(np.searchsorted(since_s, start_s or 0.0))
        last = len(since_s) - 1
        if stop_s is not None:
            last = int(np.searchsorted(since_s, stop_s, "right")) - 1
        if last - first < 2:
            raise DataError(
                f"{name}: --start and --stop leave {max(0, last - first + 1)} of its"
                f" {len(since_s)} frames, which last {since_s[-1]:.6g} s; at least 3 are needed"
            )
        part = part.during(first, last)
    if part is evidence:
        return evidence
    check_events(len(part.stream), name, "in the part that is asked for")
    return part.without("all but the part asked for", of=len(evidence.stream))


def _check_alike(path: str | Path, frames: list[NDArray[Any]]) -> None:
    first = frames[0]
    for number, frame in enumerate(frames):
        if (frame.shape, frame.dtype) != (first.shape, first.dtype):
            raise DataError(
                f"{path}: frame {number} is {_form(frame)}, frame 0 is {_form(first)}; all must be"
                " alike"
            )
        if frame.dtype.kind == "f" and not np.all(np.isfinite(frame)):
            raise DataError(f"{path}: frame {number} has values that are no finite numbers")


def _form(frame: NDArray[Any]) -> str:
    height, width = frame.shape[:2]
    return f"{width}x{height} {'colour' if frame.ndim == 3 else 'grey'} {frame.dtype}"


def check_events(number: int, name: object, where: str) -> None:
    """Raise DataError for fewer events than statistics can be made of."""
    if number < LEAST_EVENTS:
        raise DataError(f"{name}: {number} events {where}; at least {LEAST_EVENTS} are needed")


def of_covered_time(whole: Evidence, t_us: NDArray[np.int64]) -> Evidence:
    """Return a recording without time at its ends that its events, at `t_us`, do not cover.

    Streams are often cut, or begin late; what no event was kept of did not happen without any.
    """
    times_s, t_s = whole.times_s, t_us * 1e-6
    first, last = 0, len(times_s) - 1
    usual = max(_UNCOVERED * float(np.diff(t_s).max()), 2.0 * float(np.diff(times_s).max()))
    if t_s[0] - times_s[0] > usual:
        first = int(np.searchsorted(times_s, t_s[0], "right")) - 1
    if times_s[-1] - t_s[-1] > usual:
        last = int(np.searchsorted(times_s, t_s[-1]))
    ends = (times_s[first] - times_s[0], "first"), (times_s[-1] - times_s[last], "last")
    shown = "frames" if whole.stimulus is None else "instants"
    which = [f"{time:.3g} s at the {end} {shown}" for time, end in ends if time > 0.0]
    if last - first < 2 or not which:
        return whole
    part = whole.during(first, last)
    return part.without(f"{' and '.join(which)}, which the events do not cover")
