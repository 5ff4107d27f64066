"""From light to events: the pixel array fed with interpolated frames, in bounded memory.

Example
-------
>>> import numpy as np
>>> from adv2e import Config, simulate
>>> frames = [np.full((4, 6), dn, np.uint8) for dn in (20, 40, 80, 160)]
>>> times = [0.0, 0.01, 0.02, 0.03]  # seconds
>>> sum(len(events) for events in simulate(frames, times, Config())) > 0
True
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Config
from adv2e.effects.frames.encoding import LightDecoder, encoding_of_images, full_scale_of
from adv2e.errors import DataError
from adv2e.events import Events, empty_events, sort_events
from adv2e.pixel import PixelArray, thread_count
from adv2e.sources.base import check_values
from adv2e.upsampling import make_upsampler

CHUNK_BYTES = 16 << 20
"""Memory for the frames that one call of the kernel takes."""

_CHUNK_INTERVALS = 16


def simulate(
    frames: Iterable[NDArray[Any]],
    times: Iterable[float],
    config: Config | None = None,
    *,
    threads: int | None = None,
) -> Iterator[Events]:
    """Yield the events of a sequence of frames, sorted, chunk by chunk.

    Parameters
    ----------
    frames : iterable of (rows, columns) or (rows, columns, 3) arrays
        uint8, uint16, float32 or float64; colour as RGB.  `frames.encoding: auto` means linear
        here, except for 8-bit colour, which is taken as sRGB.
    times : iterable of float
        Time of each frame [s], increasing.
    config : Config, optional
        Default: the shipped ``adv2e.yaml``.
    threads : int, optional
        Default: all cores.  The events do not depend on it.

    Yields
    ------
    events : (n,) array of EVENT_DTYPE
        Times in us on the clock of `times`.

    Raises
    ------
    DataError
        Fewer than two frames, times that do not increase, frames of different sizes or types, NaN.
    """
    config = config or Config()
    yield from events_from_light(_decoded(frames, times, config), config, threads=threads)


def _decoded(
    frames: Iterable[NDArray[Any]], times: Iterable[float], config: Config
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield (t_ns, light) of raw frames, checked."""
    decoder: LightDecoder | None = None
    first: NDArray[Any] | None = None
    pending = iter(times)
    for number, frame in enumerate(frames):
        image = np.asarray(frame)
        try:
            t_ns = round(float(next(pending)) * 1e9)
        except StopIteration:
            raise DataError(f"frame {number}: has no time (there are fewer times)") from None
        if first is None:
            first = image
            decoder = _decoder_for(image, config)
        elif image.shape != first.shape or image.dtype != first.dtype:
            raise DataError(
                f"frame {number}: {image.dtype} {image.shape}, but the first frame is"
                f" {first.dtype} {first.shape}"
            )
        check_values(image, f"frame {number}")
        assert decoder is not None
        yield t_ns, decoder.decode(image)


def _decoder_for(image: NDArray[Any], config: Config) -> LightDecoder:
    colour = image.ndim == 3
    if image.ndim not in (2, 3) or (colour and image.shape[2] != 3):
        raise DataError(
            f"frame 0: shape {image.shape}, must be (rows, columns) or (rows, columns, 3)"
        )
    encoding = config.frames.encoding
    if encoding == "auto":
        encoding = encoding_of_images(image.dtype, colour)
    full_scale = config.frames.full_scale or full_scale_of(image.dtype)
    return LightDecoder(encoding, full_scale, image.dtype, colour)


def events_from_light(
    light: Iterable[tuple[int, NDArray[Any]]], config: Config, *, threads: int | None = None
) -> Iterator[Events]:
    """Yield the events of a sequence of (t_ns, light [DN]), sorted, chunk by chunk.

    Raises
    ------
    DataError
        Fewer than two frames, or times that do not increase.
    """
    source = iter(light)
    try:
        t_ns, first = next(source)
    except StopIteration:
        raise DataError("no frames: at least two are needed") from None
    workers = thread_count(threads)
    pixel = PixelArray(config.pixel, config.sampling, config.seed, first, t_ns, threads=workers)
    with ThreadPoolExecutor(workers) if workers > 1 else nullcontext() as pool:
        order = _Order()
        interpolated = _interpolated(t_ns, first, source, config, workers)
        for chunk in _chunks(interpolated, config):
            events = pixel.advance(chunk.frames, chunk.times_ns, chunk.last, pool)
            end_us = (chunk.times_ns[-1] + 500) // 1000
            yield order.add(events, end_us)
        yield order.rest()


def _interpolated(
    t_ns: int,
    first: NDArray[Any],
    source: Iterator[tuple[int, NDArray[Any]]],
    config: Config,
    threads: int,
) -> Iterator[tuple[int, NDArray[Any], bool]]:
    """Yield (t_ns, light, ends an input interval) of all frames after interpolation."""
    count = config.sampling.L
    upsampler = make_upsampler(config.sampling.interpolation, count, threads=threads)
    before_ns, before = t_ns, first
    yield t_ns, first, True
    number = 0
    for number, (now_ns, now) in enumerate(source, start=1):
        if now_ns <= before_ns:
            raise DataError(
                f"frame {number}: its time {now_ns * 1e-9:.9f} s is not after the one before"
                f" ({before_ns * 1e-9:.9f} s)"
            )
        span = now_ns - before_ns
        for step, frame in enumerate(upsampler.between(before, now), start=1):
            yield before_ns + (span * step + count // 2) // count, frame, step == count
        before_ns, before = now_ns, now
    if number == 0:
        raise DataError("a single frame: at least two are needed")


class _Chunk:
    """Frames and times of a few intervals."""

    def __init__(self, frames: NDArray[Any], times_ns: list[int], last: NDArray[np.bool_]) -> None:
        self.frames, self.times_ns, self.last = frames, times_ns, last


def _chunks(frames: Iterator[tuple[int, NDArray[Any], bool]], config: Config) -> Iterator[_Chunk]:
    """Gather interpolated frames to chunks; neighbouring chunks share their border frame.

    With the paper's last interval as printed, a chunk holds one frame more, as its samples look
    ahead.
    """
    printed = config.sampling.last_interval == "printed"
    ahead = 1 if printed else 0
    t_ns, frame, _ = next(frames)
    size = max(1, min(_CHUNK_INTERVALS, CHUNK_BYTES // max(1, frame.nbytes)))
    held = np.empty((size + 1 + ahead, *frame.shape), frame.dtype)
    times: list[int] = []
    ends: list[bool] = []

    def put(t_ns: int, frame: NDArray[Any], end: bool) -> None:
        held[len(times)] = frame
        times.append(t_ns)
        ends.append(end and printed)

    def chunk(intervals: int) -> _Chunk:
        last = np.zeros(intervals + 1, np.bool_)
        known = ends[1 : intervals + 2]
        last[: len(known)] = known
        return _Chunk(held[: len(times)], times[: intervals + 1], last)

    put(t_ns, frame, False)
    for item in frames:
        put(*item)
        if len(times) == size + 1 + ahead:
            yield chunk(size)
            kept = times[size:], ends[size:]
            held[: 1 + ahead] = held[size:].copy()
            times[:], ends[:] = kept
    if len(times) > 1:
        yield chunk(len(times) - 1)


class _Order:
    """Hands events on in order; those that share the last microsecond of a chunk wait."""

    def __init__(self) -> None:
        self._held = empty_events()

    def add(self, events: Events, end_us: int) -> Events:
        """Return what is in final order once `events`, sorted and up to about `end_us`, are in."""
        if self._held.size:
            split = int(np.searchsorted(events["t"], self._held["t"].max(), side="right"))
            border = sort_events(np.concatenate([self._held, events[:split]]))
            events = np.concatenate([border, events[split:]])
        keep = int(np.searchsorted(events["t"], end_us, side="left"))
        self._held = events[keep:].copy()
        return events[:keep]

    def rest(self) -> Events:
        """Return the events still held."""
        rest, self._held = self._held, empty_events()
        return rest
