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

from bisect import bisect_left
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
from adv2e.intervals import Intervals
from adv2e.pixel import PixelArray, thread_count
from adv2e.sources.base import check_values


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
    raw = _Raw(frames, times, config)
    yield from events_from_light(raw.light(), config, threads=threads, table=raw.table)


class _Raw:
    """Frames as given, checked, with what turns them into light."""

    def __init__(
        self, frames: Iterable[NDArray[Any]], times: Iterable[float], config: Config
    ) -> None:
        self._frames = enumerate(frames)
        self._times = iter(times)
        _, image = next(self._frames, (0, None))
        if image is None:
            raise DataError("no frames: at least two are needed")
        self._first = np.asarray(image)
        self._decoder = _decoder_for(self._first, config)
        # decoded by the kernel, unless many instants are made of each frame
        self.table = self._decoder.grey_table if config.sampling.L == 1 else None

    def light(self) -> Iterator[tuple[int, NDArray[Any]]]:
        """Yield (t_ns, light), or grey values for the table where there is one."""
        yield self._checked(0, self._first)
        for number, frame in self._frames:
            yield self._checked(number, np.asarray(frame))

    def _checked(self, number: int, image: NDArray[Any]) -> tuple[int, NDArray[Any]]:
        try:
            t_ns = round(float(next(self._times)) * 1e9)
        except StopIteration:
            raise DataError(f"frame {number}: has no time (there are fewer times)") from None
        first = self._first
        if image.shape != first.shape or image.dtype != first.dtype:
            raise DataError(
                f"frame {number}: {image.dtype} {image.shape}, but the first frame is"
                f" {first.dtype} {first.shape}"
            )
        check_values(image, f"frame {number}")
        return t_ns, image if self.table is not None else self._decoder.decode(image)


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
    light: Iterable[tuple[int, NDArray[Any]]],
    config: Config,
    *,
    threads: int | None = None,
    table: NDArray[np.float32] | None = None,
) -> Iterator[Events]:
    """Yield the events of a sequence of (t_ns, light [DN]), sorted, chunk by chunk.

    With a `table` of 256 entries [DN], the frames are grey values of 8 bits that it decodes; then
    `sampling.L` should be 1, as every instant looks its frames up again.

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
    first_light = first if table is None else table.take(first)
    pixel = PixelArray(
        config.pixel, config.sampling, config.seed, first_light, t_ns, threads=workers
    )
    with ThreadPoolExecutor(workers) if workers > 1 else nullcontext() as pool:
        order = _Order()
        intervals = Intervals(t_ns, first, config.sampling, threads=workers)
        for part in intervals.parts(source):
            end_us, count = (part.times_ns[-1] + 500) // 1000, 0
            for events in pixel.advance_part(part, table, pool):
                count += events.size
                yield from order.add(events, end_us)
                del events  # or they would stay while the next ones are made
            intervals.expect(count)
        yield order.rest()


def _before(events: Events, t_us: int) -> int:
    """Return how many of the sorted events come before a time [us]."""
    # NumPy's search would copy the column
    return bisect_left(range(events.size), t_us, key=lambda k: int(events["t"][k]))


class _Order:
    """Hands events on in order; those that share the last microsecond of a chunk wait."""

    def __init__(self) -> None:
        self._held = empty_events()

    def add(self, events: Events, end_us: int) -> Iterator[Events]:
        """Yield what is in final order once `events`, sorted and up to about `end_us`, are in."""
        if self._held.size:
            split = _before(events, int(self._held["t"].max()) + 1)
            border = sort_events(np.concatenate([self._held, events[:split]]))
            keep = _before(border, end_us)
            self._held = border[keep:]
            if keep:
                yield border[:keep]
            events = events[split:]
        keep = _before(events, end_us)
        if keep < events.size:
            self._held = np.concatenate([self._held, events[keep:]])
        if keep:
            yield events[:keep]

    def rest(self) -> Events:
        """Return the events still held."""
        rest, self._held = self._held, empty_events()
        return rest
