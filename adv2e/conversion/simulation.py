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

import math
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import worker_pool
from adv2e.config.active_effects import active_hooks
from adv2e.config.model import Config
from adv2e.effects.composition import additions_of, begin, changes_light, map_events, overrides
from adv2e.effects.frames.brightness import bounded, check_floats
from adv2e.effects.frames.encoding import LightDecoder, encoding_of_images
from adv2e.effects.hooks import Frames, Hooks
from adv2e.effects.reorder_buffer import InOrder
from adv2e.errors import ConfigError, DataError
from adv2e.events import Events
from adv2e.light.decoding import decoder_for, kernel_table
from adv2e.light.intervals import Intervals
from adv2e.pixel import array as pixel
from adv2e.pixel.array import PixelArray, thread_count
from adv2e.pixel.steps import PRECISE, Coarseness
from adv2e.sources.base import check_values
from adv2e.ticks import check_time


def simulate(
    frames: Iterable[NDArray[Any]],
    times: Iterable[float],
    config: Config | None = None,
    *,
    effects: Sequence[Hooks] = (),
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
    effects : sequence of Hooks, optional
        Effects of your own, besides those of the configuration.
    threads : int, optional
        Default: all cores.  The events do not depend on it.

    Yields
    ------
    events : (n,) array of EVENT_DTYPE
        Times in us on the clock of `times`.

    Raises
    ------
    DataError
        Fewer than two frames, times that do not increase, frames of different sizes or types, NaN,
        another number of times than frames where both have a length.
    ConfigError
        `config` is none.
    """
    config = Config() if config is None else config
    if not isinstance(config, Config):
        raise ConfigError(
            "config: must be a Config, as adv2e.load_config returns it, got"
            f" {type(config).__name__}"
        )
    if isinstance(frames, Sized) and isinstance(times, Sized) and len(frames) != len(times):
        raise DataError(f"{len(times)} times for {len(frames)} frames")
    raw = _Raw(frames, times, config)
    yield from events_from_light(
        raw.light(), config, threads=threads, table=raw.table, effects=effects
    )


def is_compiled(config: Config) -> bool:
    """Tell whether the code that a simulation needs has been compiled before."""
    return pixel.is_compiled(config.pixel, config.sampling, additions_of(active_hooks(config)))


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
        self._stated = config.frames.full_scale
        self._decoder = _decoder_for(self._first, config)
        self.table = kernel_table(self._decoder, config.sampling)

    def light(self) -> Iterator[tuple[int, NDArray[Any]]]:
        """Yield (t_ns, light), or grey values for the table where there is one."""
        yield self._checked(0, self._first)
        for number, frame in self._frames:
            yield self._checked(number, np.asarray(frame))

    def _checked(self, number: int, image: NDArray[Any]) -> tuple[int, NDArray[Any]]:
        try:
            t_s = float(next(self._times))
        except StopIteration:
            raise DataError(f"frame {number}: has no time (there are fewer times)") from None
        if not math.isfinite(t_s):
            raise DataError(f"frame {number}: its time is {t_s}, must be a number of seconds")
        check_time(t_s * 1e9, f"frame {number}")
        t_ns = round(t_s * 1e9)
        first = self._first
        if image.shape != first.shape or image.dtype != first.dtype:
            raise DataError(
                f"frame {number}: {image.dtype} {image.shape}, but the first frame is"
                f" {first.dtype} {first.shape}"
            )
        check_values(image, f"frame {number}")
        check_floats(image, f"frame {number}", self._stated)
        return t_ns, image if self.table is not None else self._decoder.decode(image)


def _decoder_for(image: NDArray[Any], config: Config) -> LightDecoder:
    colour = image.ndim == 3
    if image.ndim not in (2, 3) or (colour and image.shape[2] != 3):
        raise DataError(
            f"frame 0: shape {image.shape}, must be (rows, columns) or (rows, columns, 3)"
        )
    auto = encoding_of_images(image.dtype, colour)
    return decoder_for(config.frames, image.dtype, colour, auto=auto)


def events_from_light(
    light: Iterable[tuple[int, NDArray[Any]]],
    config: Config,
    *,
    threads: int | None = None,
    table: NDArray[np.float32] | None = None,
    effects: Sequence[Hooks] = (),
    method: str = "auto",
    coarseness: Coarseness = PRECISE,
    complete: Callable[[int], None] | None = None,
) -> Iterator[Events]:
    """Yield the events of a sequence of (t_ns, light [DN]), sorted, chunk by chunk.

    With a `table` of 256 entries [DN], the frames are grey values of 8 bits that it decodes; then
    `sampling.L` should be 1, as every instant looks its frames up again.  `effects`: see
    :func:`simulate`; `method`, `coarseness`: see :class:`adv2e.pixel.array.PixelArray`.  `complete`
    is called now and then with a time [us] before which no event will come any more; not so if
    effects change events, as they may change times.

    Raises
    ------
    DataError
        Fewer than two frames, or times that do not increase.
    """
    hooks = active_hooks(config, effects)
    if table is not None and changes_light(hooks):
        light, table = _decoded(light, table), None
    frames = bounded(begin(hooks, iter(light), config.seed), table)
    how = {"method": method, "coarseness": coarseness}
    if complete is None or any(overrides(hook, "events") for hook in hooks):
        complete = _ignore
    chunks = _pixel_events(frames, config, hooks, threads, table, how, complete)
    yield from map_events(hooks, chunks)


def _ignore(t_us: int) -> None:
    pass


def _decoded(
    frames: Iterable[tuple[int, NDArray[Any]]], table: NDArray[np.float32]
) -> Iterator[tuple[int, NDArray[Any]]]:
    for t_ns, grey in frames:
        yield t_ns, table.take(grey)


def _pixel_events(
    source: Frames,
    config: Config,
    hooks: Sequence[Hooks],
    threads: int | None,
    table: NDArray[np.float32] | None,
    how: Mapping[str, Any],
    complete: Callable[[int], None],
) -> Iterator[Events]:
    """Yield the sorted events of all pixels, as they are before the readout."""
    t_ns, first = next(source)
    workers = thread_count(threads)
    first_light = first if table is None else table.take(first)
    additions = additions_of(hooks)
    array = PixelArray(
        config.pixel,
        config.sampling,
        config.seed,
        first_light,
        t_ns,
        threads=workers,
        additions=additions,
        **how,
    )
    # the main thread cannot be interrupted in compiled code
    apart = workers > 1 or threading.current_thread() is threading.main_thread()
    with worker_pool(workers) if apart else nullcontext() as pool:
        order = InOrder()
        intervals = Intervals(t_ns, first, config.sampling, threads=workers)
        for part in intervals.parts(source):
            end_us, count = (part.times_ns[-1] + 500) // 1000, 0
            for events in array.advance_part(part, table, pool):
                count += events.size
                yield from order.add(events, end_us)
                del events  # or they would stay while the next ones are made
            complete(end_us)
            intervals.expect(count)
            for hook in hooks:
                hook.passed(part.times_ns[-1] * 1e-9)
        yield order.rest()
