"""The recording that is diagnosed: frames, events, and what was set aside before anything else."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.stream import Stream
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.recordings import read_recording
from adv2e.reports.result import Masked

LEAST_EVENTS = 1000
"""Below that nothing can be told."""

AFFORDABLE_S = 0.2
"""What one simulation may take, in one thread; a diagnosis takes some thousands of them [s]."""

# about what a simulation and the statistics of its events take, in one thread [s]
_INSTANT_S = 20e-9  # of one pixel
_EVENT_S = 300e-9
_STEPPED = 10
_BLOCK = 8
_SMALLEST = 48


@dataclass(frozen=True)
class Evidence:
    """Frames and events of one recording on one clock.

    Attributes
    ----------
    name : str
    frames : list of (rows, columns[, 3]) arrays
        As stored.
    times_s : (frames,)
        Their stamps [s].
    stream : Stream
        Events between the first frame and the last.
    width, height : int
    masked : list of Masked
    notes : list of str
    """

    name: str
    frames: list[NDArray[Any]]
    times_s: NDArray[np.float64]
    stream: Stream
    width: int
    height: int
    masked: list[Masked] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def times_ns(self) -> list[int]:
        """Stamps of the frames [ns]."""
        return [round(t * 1e9) for t in self.times_s.tolist()]

    @property
    def seconds(self) -> float:
        """Length of the recording [s]."""
        return float(self.times_s[-1] - self.times_s[0])


def read_evidence(path: str | Path) -> Evidence:
    """Read a recording that holds frames and events.

    Raises
    ------
    DataError
        It cannot be read, has no frames, fewer than three, or too few events; frames and events do
        not overlap in time; frames are out of order, not all alike, or of another size than the
        events.
    """
    recording = read_recording(path)
    if recording.frame_times_ns is None or len(recording.frame_times_ns) == 0:
        raise DataError(f"{path}: holds no frames, from which the events could be simulated")
    frames, times = [], []
    for frame in recording.frames():
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
    kept, masked = _between_frames(recording.events, times_s)
    if len(kept) < LEAST_EVENTS:
        raise DataError(
            f"{path}: {len(kept)} events between its first and its last frame; at least"
            f" {LEAST_EVENTS} are needed"
        )
    return Evidence(
        name=str(path),
        frames=frames,
        times_s=times_s,
        stream=Stream.of(kept, width, height),
        width=width,
        height=height,
        masked=masked,
        notes=list(recording.problems),
    )


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


def _between_frames(events: Events, times_s: NDArray[np.float64]) -> tuple[Events, list[Masked]]:
    first, last = times_s[0] * 1e6, times_s[-1] * 1e6
    inside = (events["t"] >= first) & (events["t"] < last)
    lost = 1.0 - float(np.count_nonzero(inside)) / max(1, len(events))
    masked = [Masked("events before the first frame or after the last", lost)] if lost else []
    return events[inside], masked


def affordable(evidence: Evidence, declared: Config) -> Evidence:
    """Return the recording, cropped where simulating all of it many times would take too long.

    A rectangle of the sensor's proportions is kept that holds as many events as any.  A pixel does
    not depend on its neighbours, so that the crop sees what it saw in the whole, but for load of
    the readout and for interpolation along motion at its border.

    Parameters
    ----------
    evidence : Evidence
    declared : Config
        Its `sampling` and the form of its filter decide what a simulation costs.
    """
    instants = (len(evidence.frames) - 1) * declared.sampling.L
    low_pass = declared.pixel.low_pass
    each = 1 if low_pass is None or low_pass.update == "exact" else _STEPPED

    def cost_s(part: Evidence) -> float:
        pixels = part.width * part.height
        return _INSTANT_S * each * instants * pixels + _EVENT_S * len(part.stream)

    kept, share = evidence, 1.0
    while cost_s(kept) > AFFORDABLE_S:
        # where events crowd, a part of the pixels costs more than its share
        share *= 0.98 * AFFORDABLE_S / cost_s(kept)
        width, height = (
            min(length, max(_SMALLEST, round(length * share**0.5 / _BLOCK) * _BLOCK))
            for length in (evidence.width, evidence.height)
        )
        if (width, height) == (kept.width, kept.height):
            break
        kept = _cropped(evidence, *_busiest(evidence, width, height), width, height)
    return kept


def _busiest(evidence: Evidence, width: int, height: int) -> tuple[int, int]:
    """Return column and row, multiples of a block, at which a crop holds the most events."""
    counts = np.bincount(evidence.stream.pixel, minlength=evidence.width * evidence.height)
    sums = np.zeros((evidence.height + 1, evidence.width + 1), np.int64)
    sums[1:, 1:] = counts.reshape(evidence.height, -1).cumsum(axis=0).cumsum(axis=1)
    rows = np.arange(0, evidence.height - height + 1, _BLOCK)[:, None]
    columns = np.arange(0, evidence.width - width + 1, _BLOCK)[None, :]
    inside = sums[rows + height, columns + width] - sums[rows, columns + width]
    inside += sums[rows, columns] - sums[rows + height, columns]
    row, column = np.unravel_index(int(inside.argmax()), inside.shape)
    return int(columns[0, column]), int(rows[row, 0])


def _cropped(evidence: Evidence, left: int, top: int, width: int, height: int) -> Evidence:
    stream = evidence.stream
    y, x = np.divmod(stream.pixel, evidence.width)
    inside = (x >= left) & (x < left + width) & (y >= top) & (y < top + height)
    pixel = ((y - top) * width + (x - left))[inside].astype(np.int32)
    kept = Stream(stream.t[inside], pixel, stream.on[inside], width, height)
    what = f"pixels outside the {width}x{height} at column {left}, row {top}"
    return replace(
        evidence,
        frames=[frame[top : top + height, left : left + width] for frame in evidence.frames],
        stream=kept,
        width=width,
        height=height,
        masked=[*evidence.masked, Masked(what, 1.0 - len(kept) / len(stream))],
        notes=[
            *evidence.notes,
            f"cropped from {evidence.width}x{evidence.height} pixels, as all of them would take too"
            " long to simulate often enough",
        ],
    )
