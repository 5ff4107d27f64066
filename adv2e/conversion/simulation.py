"""From light to events: the pixel array fed with interpolated frames, in bounded memory."""

from __future__ import annotations

import itertools
import math
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import worker_pool
from adv2e.config import Config, Written, load_config
from adv2e.config.active_effects import active_hooks
from adv2e.effects.composition import begin, check_causes, map_events, overrides
from adv2e.effects.frames.brightness import bounded, check_floats
from adv2e.effects.frames.encoding import LightDecoder, full_scale_of
from adv2e.effects.hooks import Frames, Hooks, LightFrame
from adv2e.effects.reorder_buffer import InOrder
from adv2e.errors import ConfigError, DataError, warn
from adv2e.events import Events, empty_events
from adv2e.label import Label
from adv2e.light.decoding import decoder_for, kernel_table, light_line, light_text
from adv2e.light.intervals import Intervals
from adv2e.light.sensor import fitting_of
from adv2e.options import Run, declared
from adv2e.pixel.array import PixelArray
from adv2e.pixel.steps import PRECISE, Coarseness
from adv2e.process import bars
from adv2e.sources.frame import Frame, check_values, light_of_images
from adv2e.sources.times.rates import NS_PER_S, FrameRate, Rate, parse_rate
from adv2e.ticks import check_time

if TYPE_CHECKING:
    from adv2e.light.interpolation.flow import GivenFlow

_FAR_APART_S = 10.0
"""Frames so far apart are told: times in ms or us look like that."""


def simulate(
    frames: Iterable[NDArray[Any]],
    times: Iterable[float] | float | None = None,
    config: Written | Sequence[Written] | None = None,
    *,
    fps: Rate | None = None,
    seed: int | None = None,
    size: tuple[int, int] | None = None,
    effects: Sequence[Hooks] = (),
    threads: int | None = None,
    causes: bool = False,
    progress: bool = False,
    strict: bool = False,
) -> Iterator[Events]:
    """Return an iterator over the events of a sequence of frames, sorted, chunk by chunk.

    Parameters
    ----------
    frames : iterable of (rows, columns) or (rows, columns, 3) arrays
        uint8, uint16, float32 or float64; colour as RGB.  `frames.encoding: auto` means sRGB for 8
        bits and linear for others.  With a `sensor` in the configuration they are brought to its
        size, which is that of the events.
    times : iterable of float, or float, optional
        Time of each frame [s], increasing; or so many frames a second, the first at 0.
    config : Config, or what :func:`adv2e.load_config` takes, optional
        Default: the shipped ``adv2e.yaml``.
    fps : float, Fraction or str, optional
        Frames a second, the first at 0, in place of `times`.
    seed : int, optional
        Seed of all random numbers; default: that of the configuration.
    size : (int, int), optional
        Width and height of the sensor [pixels], as ``sensor`` in the configuration.
    effects : sequence of Hooks, optional
        Effects of your own, besides those of the configuration.
    threads : int, optional
        Default: all cores.  The events do not depend on it.
    causes : bool
        Give each event one more field, ``cause``: the number in :data:`adv2e.causes.CAUSES` of
        what made it.
    progress : bool
        Show a progress bar on stderr.
    strict : bool
        Raise DataError where it must guess what the frames stand for: `frames.encoding` is auto.

    Returns
    -------
    iterator over (n,) arrays of EVENT_DTYPE
        Times in us on the clock of `times`.  None of them is empty, but for a single one where
        there is no event at all, so that ``np.concatenate(list(...))`` always works.

    Raises
    ------
    DataError
        Fewer than two frames, times that do not increase, frames of different sizes or types, NaN,
        another number of times than frames, a rate that cannot be, neither times nor a rate, or
        both.  What the arguments and the first frame show is raised at once.
    UsageError
        `threads` is no whole number from 1 on.
    ConfigError
        As :func:`adv2e.load_config`; effects whose causes cannot be told apart.

    Warns
    -----
    UserWarning
        The second frame comes so late that the times are hardly in seconds.  `frames.encoding` is
        auto, and the frames are grey of 8 bits or of 16 bits, so that what they stand for is a
        guess.

    Examples
    --------
    >>> import numpy as np
    >>> from adv2e import simulate
    >>> frames = [np.full((4, 6, 3), dn, np.uint8) for dn in (50, 80, 130, 200)]
    >>> events = np.concatenate(list(simulate(frames, fps=100)))
    >>> times = [0.0, 0.01, 0.02, 0.03]  # seconds
    >>> sum(map(len, simulate(frames, times, "adv2e"))) == len(events) > 0
    True
    """
    if not isinstance(config, Config) or seed is not None or size is not None:
        config = load_config(config, seed=seed, size=size)
    declared(Run)["threads"].checked("threads", threads)
    instants, has_rate = _instants(times, fps)
    _check_numbers(frames, times)
    hooks = active_hooks(config, effects)
    if causes:
        check_all_causes(hooks, config)
    coming = iter(frames)
    first = next(coming, None)
    if first is None:
        raise DataError("no frames: at least two are needed")
    if strict:
        meant = light_of_images(Frame(np.asarray(first)), "arrays")
        Label().refuse("frames", light_line(meant, 0, config.frames))
    decoder = decoder_of(np.asarray(first), config)
    rows, columns = np.shape(first)[:2]
    fitting = fitting_of(columns, rows, config.sensor, "frame 0")
    table = kernel_table(decoder, config.sampling, hooks, fitting)
    count = len(frames) if isinstance(frames, Sized) else None
    images = _checked(
        itertools.chain([first], coming), instants, config.frames.full_scale, has_rate=has_rate
    )
    light = images if table is not None else ((t, decoder.decode(image)) for t, image in images)
    if fitting is not None:
        light = (
            (t, fitting.light(now, f"frame {number}")) for number, (t, now) in enumerate(light)
        )
    made = events_from_light(
        bars.bar(iterable=light, total=count, unit=" frames") if progress else light,
        config,
        hooks=hooks,
        threads=threads,
        table=table,
        causes=causes,
    )
    return _filled(made)


def _check_numbers(frames: object, times: object) -> None:
    if isinstance(frames, Sized) and isinstance(times, Sized) and len(frames) != len(times):
        raise DataError(f"{len(times)} times for {len(frames)} frames")


def _filled(chunks: Iterator[Events]) -> Iterator[Events]:
    """Yield the chunks that hold events; an empty one if none does."""
    is_any, nothing = False, empty_events()
    for chunk in chunks:
        if chunk.size:
            is_any = True
            yield chunk
        else:
            nothing = chunk
        del chunk  # or it would stay while the next one is made
    if not is_any:
        yield nothing


def _instants(times: Any, fps: Rate | None) -> tuple[Iterable[float], bool]:
    """Return the time of each frame [s], and whether a rate gives them, so that they never end."""
    if fps is not None and times is not None:
        raise DataError("times, fps: give one of them, the times of the frames or their rate")
    if isinstance(times, Iterable) and not isinstance(times, (str, bytes)):
        return times, False
    name, given = ("times", times) if fps is None else ("fps", fps)
    if fps is None and not isinstance(times, (int, float, np.number)):
        raise DataError(
            f"times: must be the time of each frame [s] or a rate [Hz], got {times!r}; or give fps"
        )
    try:
        rate = FrameRate(parse_rate(str(given)))
    except ValueError as error:
        raise DataError(f"{name}: a rate {error}") from None
    return (rate.time_ns(number) / NS_PER_S for number in itertools.count()), True


def tell_far_apart(apart_s: float) -> None:
    """Warn where the first two frames lie so far apart that seconds are hardly meant."""
    if apart_s >= _FAR_APART_S:
        warn(
            f"the second frame comes {apart_s:g} s after the first: times are in seconds; divide"
            " milliseconds by 1e3, microseconds by 1e6"
        )


def checked_time(time: Any, label: str) -> int:
    """Return a time in ns; DataError if it is none."""
    try:
        t_s = float(time)
    except (TypeError, ValueError):
        t_s = math.nan
    if not math.isfinite(t_s):
        raise DataError(f"{label}: its time is {time}, must be a number of seconds")
    check_time(t_s * 1e9, label)
    return round(t_s * 1e9)


def check_frame(
    image: NDArray[Any], first: tuple[Any, Any], label: str, full_scale: float | None
) -> None:
    """Refuse a frame of another data type and shape than the `first`, or of wrong numbers."""
    if (image.dtype, image.shape) != first:
        raise DataError(
            f"{label}: {image.dtype} {image.shape}, but the first frame is {first[0]} {first[1]}"
        )
    check_values(image, label)
    check_floats(image, label, full_scale)


def _checked(
    frames: Iterable[NDArray[Any]],
    times: Iterable[float],
    full_scale: float | None,
    *,
    has_rate: bool,
) -> Frames:
    """Yield time [ns] and numbers of each frame; with a rate, there are always more times."""
    coming = iter(times)
    first: NDArray[Any] | None = None
    began_ns = 0
    for number, frame in enumerate(frames):
        label, image, time = f"frame {number}", np.asarray(frame), next(coming, None)
        if time is None:
            raise DataError(f"{label}: has no time (there are fewer times)")
        first = image if first is None else first
        t_ns = checked_time(time, label)
        if number == 0:
            began_ns = t_ns
        elif number == 1:
            tell_far_apart((t_ns - began_ns) * 1e-9)
        check_frame(image, (first.dtype, first.shape), label, full_scale)
        yield t_ns, image
    if not has_rate and next(coming, None) is not None:
        raise DataError(f"more times than frames, of which there are {number + 1}")


def decoder_of(image: NDArray[Any], config: Config) -> LightDecoder:
    """Return the decoder of frames like one in memory; warns where it is a guess."""
    colour = image.ndim == 3
    if image.ndim not in (2, 3) or (colour and image.shape[2] != 3):
        raise DataError(
            f"frame 0: shape {image.shape}, must be (rows, columns) or (rows, columns, 3)"
        )
    light = light_of_images(Frame(image), "arrays")
    decoder = decoder_for(config.frames, image.dtype, colour, auto=light.encoding)
    if config.frames.encoding == "auto" and light.is_doubtful:
        taken = light_text(light, decoder.full_scale, config.frames)
        warn(f"frames are {taken}")
    return decoder


def events_from_light(
    light: Iterable[LightFrame],
    config: Config,
    *,
    hooks: Sequence[Hooks] | None = None,
    threads: int | None = None,
    table: NDArray[np.float32] | None = None,
    coarseness: Coarseness = PRECISE,
    complete: Callable[[int], None] | None = None,
    causes: bool = False,
    given: GivenFlow | None = None,
    fired: Callable[[int], None] | None = None,
) -> Iterator[Events]:
    """Yield the events of a sequence of (t_ns, light [DN]), sorted, chunk by chunk.

    `hooks` are the effects that are on, in signal order; default: those of `config`.  With a
    `table` (:func:`adv2e.light.pictures.kernel_table`), the frames are grey values of 8 bits that
    it decodes.  `coarseness`, `causes`: see :class:`adv2e.pixel.array.PixelArray`.
    `complete` is called now and then with a time [us] before which no event will come any more; not
    so if effects change events, as they may change times.  `given`: see
    :func:`adv2e.light.interpolation.make_upsampler`.  `fired` is told how many events the pixels
    make, of which the readout may lose some.

    Raises
    ------
    DataError
        Fewer than two frames, times that do not increase, or more events than `config.max_events`.
    """
    hooks = active_hooks(config) if hooks is None else hooks
    if causes:
        check_all_causes(hooks, config)
    if any(overrides(hook, "events") for hook in hooks):
        complete = None
    frames = bounded(begin(hooks, iter(light), config.seed), table)
    pixels = Pixels(
        *next(frames), config, hooks, table, given, threads=threads, coarseness=coarseness,
        causes=causes,
    )  # fmt: skip
    threads = pixels.array.threads
    # the main thread cannot be interrupted in compiled code
    apart = threads > 1 or threading.current_thread() is threading.main_thread()
    with worker_pool(threads) if apart else nullcontext() as pool:
        made = pixels.events(frames, pool, complete)
        if fired is not None:
            made = _counted(made, fired)
        yield from limited(map_events(hooks, made, causes), config.max_events)


def _counted(made: Iterator[Events], fired: Callable[[int], None]) -> Iterator[Events]:
    """Yield the events, and tell how many they are."""
    for events in made:
        fired(events.size)
        yield events
        del events  # or they would stay while the next ones are made


def limited(made: Iterator[Events], most: int) -> Iterator[Events]:
    """Yield the events, up to `most`; more are an error."""
    count = 0
    for events in made:
        count += events.size
        if count > most:
            t_s = float(events["t"][-1]) * 1e-6
            raise DataError(
                f"max_events: more than {most:,} events were made by {t_s:.3f} s: set it higher if"
                " they are meant; if not, look at pixel.thresholds, at the times of the frames, and"
                " at what the frames hold"
            )
        yield events
        del events  # or they would stay while the next ones are made


class Pixels:
    """The pixels of a sensor, which frames come to; their events, as they are before the readout.

    Parameters
    ----------
    t_ns, first : int, (rows, columns)
        Time and light of the first frame, or its grey values with a `table`.
    hooks : sequence of Hooks
        Effects that have begun, in signal order.
    **options
        Further arguments of :class:`adv2e.pixel.array.PixelArray`.
    """

    def __init__(
        self, t_ns: int, first: NDArray[Any], config: Config, hooks: Sequence[Hooks],
        table: NDArray[np.float32] | None, given: GivenFlow | None = None, **options: Any,
    ) -> None:  # fmt: skip
        light = first if table is None else table.take(first)
        self.array = PixelArray(
            config.pixel, config.sampling, config.seed, light, t_ns, hooks=hooks, **options
        )
        threads = self.array.threads
        self.intervals = Intervals(
            t_ns, first, config.sampling, threads=threads, given=given, whole=self.array.merges
        )
        self.order = InOrder()
        self._hooks, self._table = hooks, table

    def events(
        self, frames: Frames, pool: ThreadPoolExecutor | None,
        complete: Callable[[int], None] | None = None, *, ends: bool = True,
    ) -> Iterator[Events]:  # fmt: skip
        """Yield the sorted events up to the last of the frames that follow.

        Unless they end there, those of its microsecond wait for others; see :meth:`Intervals.parts`
        for what else may.
        """
        for part in self.intervals.parts(frames, ends=ends):
            end_us, count = (part.times_ns[-1] + 500) // 1000, 0
            for events in self.array.advance_part(part, self._table, pool):
                count += events.size
                yield from self.order.add(events, end_us)
                del events  # or they would stay while the next ones are made
            if complete is not None:
                complete(end_us)
            self.intervals.expect(count)
            for hook in self._hooks:
                hook.passed(part.times_ns[-1] * 1e-9)
        if ends:
            yield self.order.rest()

    def state(self) -> dict[str, Any]:
        """Return all that the events to come depend on; not copied.

        Rows of the state of the pixels that nothing wrote to are left out.
        """
        rows = {k: row for k, row in enumerate(self.array.state) if row.view(np.int64).any()}
        kept = {"rows": rows, "started": self.array.started, "held": self.order.held}
        return {**kept, "intervals": self.intervals.state()}

    def load(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        for k, row in enumerate(self.array.state):
            row[:] = state["rows"].get(k, 0.0)
        self.array.started, self.order.held = state["started"], state["held"]
        self.intervals.load(state["intervals"])


def warm(config: Config, kind: NDArray[Any], **options: Any) -> None:
    """Compile, or load, all that frames of the type and channels of one need.

    `options`: those of :func:`simulate`.
    """
    config = replace(config, sensor=None)
    white = config.frames.full_scale or full_scale_of(kind.dtype)
    flashes = np.array([0.1, 0.9, 0.1, 0.9, 0.9]).reshape(-1, *[1] * kind.ndim) * white
    frames = np.broadcast_to(flashes, (5, 32, 32, *kind.shape[2:])).astype(kind.dtype)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in simulate(frames, 100.0, config, **options):
            pass


def check_all_causes(hooks: Sequence[Hooks], config: Config) -> None:
    """Raise ConfigError where the causes of events cannot be told."""
    check_causes(hooks)
    if config.pixel.high_pass and config.pixel.photoreceptor_noise:
        raise ConfigError(
            "causes: pixel.photoreceptor_noise is not told from the light behind pixel.high_pass:"
            " switch one of both off"
        )
