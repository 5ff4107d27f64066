"""An event camera in a loop: a simulator, or a real camera, gives it one frame after the other."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adv2e import __version__
from adv2e.background import default_threads
from adv2e.causes import CAUSED_DTYPE
from adv2e.config import Config, Written, load_config, to_dict
from adv2e.config.active_effects import active_hooks, user_sources
from adv2e.config.tree import flat
from adv2e.conversion import simulation
from adv2e.effects.composition import begin, light_now, map_events
from adv2e.effects.frames.brightness import bounded
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.effects.hooks import Hooks
from adv2e.errors import ConfigError, DataError, UsageError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.in_python import reworded
from adv2e.light.decoding import kernel_table
from adv2e.light.sensor import Fitting, fitting_of
from adv2e.options import Run, declared

Image = NDArray[Any]


class Camera:
    """An event camera, or several of them, fed frame by frame.

    The events of all pushes, and those of :meth:`close`, are together byte for byte those that
    :func:`adv2e.simulate` makes of the same frames and times.

    Parameters
    ----------
    size : (int, int), optional
        Width and height of the sensor [pixels], to which frames are brought, as ``sensor`` in the
        configuration; default: as that says, or else the size of the frames.
    config : Config, or what :func:`adv2e.load_config` takes, optional
        Default: the shipped ``adv2e.yaml``.
    seed : int, optional
        Seed of all random numbers; default: that of the configuration.
    count : int, optional
        So many cameras of one kind: frames, times and events are then of each.  The first has the
        seed given, each other one the next, and the events of a single camera of that seed.
    effects : sequence of Hooks, optional
        Effects of your own, besides those of the configuration; each camera has copies.
    threads : int, optional
        Default: all cores.  The events do not depend on it.
    causes : bool
        As for :func:`adv2e.simulate`.

    Raises
    ------
    ConfigError
        As :func:`adv2e.load_config`; or something is on that needs frames that are still to come:
        an interpolation that is not linear, ``frames.exposure_us``, frame coupling before a frame,
        an effect of your own by `light` or `events` where `light_now` or `events_now` would do.
    UsageError
        `threads` or `count` is no whole number from 1 on.

    Notes
    -----
    A push returns the events before its frame, but for those of the frame's own microsecond, which
    others may share.  What comes later, with a push that follows or with :meth:`close`: events that
    wait for ``readout.arbiter``; those of the last tick of ``readout.tick_us``, of the last
    microsecond with ``readout.double_read``; those of the last of the `sampling.L` parts of the
    interval with ``sampling.last_interval: printed``.

    Examples
    --------
    >>> import numpy as np
    >>> from adv2e import Camera
    >>> camera = Camera((346, 260), "davis346", seed=1)
    >>> for number in range(3):
    ...     frame = np.full((260, 346, 3), 60 + 40 * number, np.uint8)
    ...     events = camera.push(frame, number / 240)
    >>> events.dtype == np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
    True
    """

    @reworded
    def __init__(
        self, size: tuple[int, int] | None = None,
        config: Written | Sequence[Written] | None = None, seed: int | None = None, *,
        count: int | None = None, effects: Sequence[Hooks] = (), threads: int | None = None,
        causes: bool = False,
    ) -> None:  # fmt: skip
        known = declared(Run)
        for name, number in (("threads", threads), ("count", count)):
            known["threads"].checked(name, number)
        self.config = load_config(config, seed=seed, size=size)
        self.count = count
        self._given: dict[str, Any] = {"effects": effects, "threads": threads, "causes": causes}
        self._threads = threads or default_threads()
        self._pool: tuple[int, ThreadPoolExecutor] | None = None
        # several work side by side, each in one thread
        inside = self._threads if count is None else 1
        self._all = [
            _Sensor(_seeded(self.config, k), effects, inside, causes, name)
            for k, name in enumerate(
                [""] if count is None else map("camera {}: ".format, range(count))
            )
        ]

    def push(self, frame: ArrayLike, t: ArrayLike) -> Any:
        """Take a frame; return the events since the one before.

        Parameters
        ----------
        frame : (rows, columns) or (rows, columns, 3)
            As for :func:`adv2e.simulate`; also a tensor of PyTorch on the CPU, or what else NumPy
            takes or DLPack hands on, without a copy.  It may be overwritten afterwards.
        t : float
            Its time [s], after the one before.

        With `count` cameras: as many frames, in one array or a sequence, and a time for all or one
        for each.

        Returns
        -------
        (n,) array of EVENT_DTYPE, or a list of `count` of them
            Sorted by time, ties by row and column, t in us on the clock of `t`; none at the first
            frame.  What comes later is told in the notes on :class:`Camera`.

        Raises
        ------
        DataError
            A frame of another size or type than the first, NaN, a time that does not increase, more
            than ``max_events`` at once.  Another one may follow a frame that is refused as it
            came.
        UsageError
            It was closed, or failed or was interrupted in the midst of a frame, such as by light
            that is too bright behind an effect: :meth:`reset` begins anew.
        """
        if self.count is None:
            image, t_ns = self._all[0].checked(frame, t)
            return self._all[0].push(image, t_ns, self._workers())
        frames: Any = frame if isinstance(frame, (list, tuple)) else _array(frame, "frames")
        times = np.asarray(t)
        number = len(frames) if isinstance(frames, (list, tuple)) or frames.ndim else 0
        if number != self.count:
            raise DataError(f"{number} frames for {self.count} cameras")
        if times.shape not in ((), (self.count,)):
            raise DataError(f"times of shape {times.shape} for {self.count} cameras")
        given = zip(self._all, frames, np.broadcast_to(times, self.count), strict=True)
        checked = [one.checked(image, time) for one, image, time in given]
        return self._each(_Sensor.push, *zip(*checked, strict=True))

    def close(self) -> Any:
        """Return the events that were held back, as :meth:`push` does; the episode is over."""
        if self.count is None:
            return self._all[0].close(self._workers())
        return self._each(_Sensor.close)

    @reworded
    def reset(self, seed: int | None = None, where: ArrayLike | None = None) -> None:
        """Begin anew: the same frames then make the same events as with a new camera.

        Parameters
        ----------
        seed : int, optional
            Another seed, of `count` cameras that of the first; default: the noise is the same
            again.
        where : (count,) of bool, optional
            Those of `count` cameras that begin anew; default: all.
        """
        chosen = np.ones(len(self._all), np.bool_) if where is None else np.asarray(where)
        if chosen.shape != (len(self._all),) or chosen.dtype != np.bool_:
            raise UsageError(
                f"where: must be {len(self._all)} of bool, got {chosen.dtype} {chosen.shape}"
            )
        config = load_config(self.config, seed=seed)
        for k in np.flatnonzero(chosen).tolist():
            self._all[k].reset(None if seed is None else _seeded(config, k))

    def state(self) -> dict[str, Any]:
        """Return all that the events to come depend on, to be pickled or kept for :meth:`load`."""
        return deepcopy({**self._identity(), "cameras": [one.state() for one in self._all]})

    def load(self, state: dict[str, Any]) -> None:
        """Go on from a state, of this or another camera of the same size and configuration.

        Raises
        ------
        DataError
            It is of another version, size, number or configuration; the text names what differs.
        """
        if not isinstance(state, dict) or "cameras" not in state:
            raise DataError("state: must be what state() of a Camera returned")
        ours = self._identity()
        for name in sorted(ours.keys() | state.keys() - {"cameras"}):
            pair = [one.get(name, "nothing") for one in (state, ours)]
            if pair[0] != pair[1]:
                raise DataError("state: {}: {}, where this camera has {}".format(name, *pair))
        for one, kept in zip(self._all, deepcopy(state["cameras"]), strict=True):
            one.load(kept)

    def warm(self, frame: ArrayLike | None = None) -> None:
        """Compile, or load, all that a push needs, so that none takes longer for that.

        Parameters
        ----------
        frame : array, optional
            One of the type of those to come; default: of 8 bits, grey and in colour.
        """
        usual = [np.zeros((1, 1), np.uint8), np.zeros((1, 1, 3), np.uint8)]
        for kind in usual if frame is None else [_array(frame, "frame")]:
            simulation.warm(self.config, kind, **deepcopy(self._given))

    def _each(self, call: Any, *arguments: Sequence[Any]) -> list[Events]:
        """Return what a method of each of several cameras returns, which work side by side."""
        pool = self._workers()
        return list((pool.map if pool else map)(call, self._all, *arguments))

    def _workers(self) -> ThreadPoolExecutor | None:
        """Return the threads, which end with the camera; a process that was forked has none yet."""
        if self._threads == 1:
            return None
        if self._pool is None or self._pool[0] != os.getpid():
            self._pool = os.getpid(), ThreadPoolExecutor(self._threads, "adv2e-camera")
        return self._pool[1]

    def _identity(self) -> dict[str, Any]:
        sources, own = user_sources(self.config), [one.name for one in self._given["effects"]]
        kept = {"adv2e": __version__, "count": self.count, "causes": self._given["causes"]}
        named = {"effects": own, "sources": [dict(one) for one in sources]}
        return {**kept, **named, **dict(flat(to_dict(replace(self.config, seed=0))))}


class _Sensor:
    """One of the cameras; `name` is what it is called in messages."""

    _config: Config
    _hooks: list[Hooks]

    def __init__(
        self, config: Config, effects: Sequence[Hooks], threads: int, causes: bool, name: str
    ) -> None:
        self._effects, self._threads, self._causes, self._name = effects, threads, causes, name
        self._layout: tuple[Any, Any] | None = None
        sampling = config.sampling
        if sampling.interpolation != "linear" and sampling.L > 1:
            raise ConfigError(
                f"sampling.interpolation: {sampling.interpolation} needs frames that are still to"
                " come, and a Camera has none: say linear"
            )
        self.reset(config)
        for hook in self._hooks:
            if hook.looks_ahead:
                raise ConfigError(
                    f"effect {hook.name}: needs what is still to come, and a Camera has nothing of"
                    " that: switch it off (null, or 0)"
                )
        if causes:
            simulation.check_all_causes(self._hooks, config)

    def reset(self, config: Config | None = None) -> None:
        """Begin anew; by another configuration, that of another seed."""
        self._config = config or self._config
        self._hooks = active_hooks(self._config, deepcopy(self._effects))
        self._pixels: simulation.Pixels | None = None
        self._number, self._start_ns, self._last_ns = 0, 0, 0
        self._fault = ""

    @property
    def label(self) -> str:
        return f"{self._name}frame {self._number}"

    def checked(self, frame: Any, time: Any) -> tuple[Image, int]:
        """Return a frame and its time [ns], after checking both."""
        image = _array(frame, self.label)
        if self._fault:
            raise UsageError(f"{self._name}the camera {self._fault}: reset() begins anew")
        t_ns, config = simulation.checked_time(time, self.label), self._config
        if self._number == 0 and (image.dtype, image.shape) != self._layout:
            self._take_layout(image)
        if self._number and t_ns <= self._last_ns:
            raise DataError(
                f"{self.label}: its time {t_ns * 1e-9:.9f} s is not after the one before"
                f" ({self._last_ns * 1e-9:.9f} s)"
            )
        if self._number == 1:
            simulation.tell_far_apart((t_ns - self._last_ns) * 1e-9)
        simulation.check_frame(
            image, self._layout or (None, None), self.label, config.frames.full_scale
        )
        return image, t_ns

    def _take_layout(self, image: Image) -> None:
        config = self._config
        self._decoder: LightDecoder = simulation.decoder_of(image, config)
        rows, columns = image.shape[:2]
        self._fitting: Fitting | None = fitting_of(columns, rows, config.sensor, self.label)
        self._table = kernel_table(self._decoder, config.sampling, self._hooks, self._fitting)
        self._layout = image.dtype, image.shape

    def push(self, image: Image, t_ns: int, pool: ThreadPoolExecutor | None = None) -> Events:
        """Return the events up to a frame that was checked."""
        light = image if self._table is not None else self._decoder.decode(image)
        if self._fitting is not None:
            light = self._fitting.light(light, self.label)
        self._fault = "failed, or was interrupted, in the midst of a frame"
        hooks, seed, number = self._hooks, self._config.seed, self._number
        if self._pixels is None:
            first = bounded(begin(hooks, iter([(t_ns, light)]), seed), self._table)
            self._make_pixels(*next(first))
            events = self._nothing()
        else:
            frame = light_now(hooks, t_ns, light)
            frames = bounded(iter([frame]), self._table, number)
            events = self._out(self._pixels.events(frames, pool, ends=False), ends=False)
        self._number, self._last_ns, self._fault = number + 1, t_ns, ""
        return events

    def close(self, pool: ThreadPoolExecutor | None = None) -> Events:
        """Return the events that were held back."""
        if self._fault:
            raise UsageError(f"the camera {self._fault}: reset() begins anew")
        self._fault = "was closed"
        if self._pixels is None or self._number < 2:
            return self._nothing()
        return self._out(self._pixels.events(iter(()), pool), ends=True)

    def _make_pixels(self, t_ns: int, light: Image) -> None:
        self._start_ns = t_ns
        self._pixels = simulation.Pixels(
            t_ns, light, self._config, self._hooks, self._table, threads=self._threads,
            causes=self._causes,
        )  # fmt: skip

    def _nothing(self) -> Events:
        return np.empty(0, CAUSED_DTYPE if self._causes else EVENT_DTYPE)

    def _out(self, made: Iterator[Events], *, ends: bool) -> Events:
        seen = map_events(self._hooks, made, self._causes, ends=ends)
        chunks = [
            chunk for chunk in simulation.limited(seen, self._config.max_events) if chunk.size
        ]
        return chunks[0] if len(chunks) == 1 else np.concatenate([self._nothing(), *chunks])

    def state(self) -> dict[str, Any]:
        """Return what makes the camera what it is; not copied."""
        kept: dict[str, Any] = {
            "seed": self._config.seed,
            "layout": self._layout,
            "begun": (self._number, self._start_ns, self._last_ns, self._fault),
            "hooks": [
                {name: value for name, value in vars(hook).items() if name != "parameters"}
                for hook in self._hooks
            ],
        }
        if self._pixels is not None:
            kept["pixels"] = self._pixels.state()
        return kept

    def load(self, kept: dict[str, Any]) -> None:
        """Go on from a state, which becomes part of the camera."""
        if self._layout not in (None, kept["layout"]) and kept["layout"] is not None:
            ours, theirs = (f"{dtype} {shape}" for dtype, shape in (self._layout, kept["layout"]))
            raise DataError(f"state: of frames of {theirs}, where this camera has {ours}")
        self.reset(replace(self._config, seed=kept["seed"]))
        for hook, values in zip(self._hooks, kept["hooks"], strict=True):
            vars(hook).update(values)
        if kept["layout"] is not None:
            self._take_layout(np.zeros(kept["layout"][1], kept["layout"][0]))
        self._number, self._start_ns, self._last_ns, self._fault = kept["begun"]
        if "pixels" in kept:
            self._make_pixels(self._start_ns, kept["pixels"]["intervals"][0][0])
            assert self._pixels is not None
            self._pixels.load(kept["pixels"])


def _array(frame: Any, label: str) -> Image:
    """Return a frame as NumPy sees it, in the same memory where it can."""
    try:
        if hasattr(frame, "__dlpack__") and not hasattr(frame, "__array__"):
            return np.asarray(np.from_dlpack(frame))
        return np.asarray(frame)
    except (TypeError, ValueError, RuntimeError, BufferError) as error:
        raise DataError(f"{label}: no array in the memory of the CPU: {error}") from error


def _seeded(config: Config, number: int) -> Config:
    """Return the configuration of one of several cameras."""
    return replace(config, seed=config.seed + number)
