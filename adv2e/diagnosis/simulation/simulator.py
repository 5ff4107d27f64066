"""Simulations of the recording's own frames, many at a time, frames made once, and progress."""

from __future__ import annotations

import copy
import dataclasses
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.config.active_effects import active_hooks, frame_hooks
from adv2e.config.model import Frames, Sampling
from adv2e.config.user_effects import user_effects
from adv2e.conversion.simulation import events_from_light
from adv2e.diagnosis.configurations import coupling_of
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.simulation.affordable import FINE
from adv2e.effects.frames.misregistration import shifted
from adv2e.effects.hooks import Hooks, LightFrame
from adv2e.effects.readout.frame_coupling import FrameCouplingHooks
from adv2e.events import Events
from adv2e.light.interpolation import make_upsampler
from adv2e.light.interpolation.linear import instant_ns, neighbours
from adv2e.pixel.steps import PRECISE, Coarseness

Result = TypeVar("Result")

_SEEDS = 1_000_000
"""Of a diagnosis, fewer than these; each seed of the configuration has its own."""
_ROUGH = Coarseness(5.0, 2.5)
"""Twice as fast with what takes longest, and off by what the first steps of a fit do not show."""


class Progress:
    """Counts simulations, in many threads, and tells of them and of stages.

    `progress` takes the stage, in a few words, and the number of simulations done in all stages: at
    each stage that begins, and after each simulation.
    """

    def __init__(self, progress: Callable[[str, int], None]) -> None:
        self._progress, self._counting = progress, threading.Lock()
        self.done, self._stage = 0, ""

    def begin(self, stage: str) -> None:
        """Begin a stage: its name is reported with the simulations that follow."""
        with self._counting:
            self._stage = stage
            self._progress(stage, self.done)

    def count(self, trying: str = "") -> None:
        """Count a simulation; `trying` names the effect that it was made for, to be told."""
        with self._counting:
            self.done += 1
            also = f": {trying}" if trying not in self._stage else ""
            self._progress(self._stage + also, self.done)


class Simulator(Progress):
    """Turns configurations into streams, in threads: a simulation in each."""

    def __init__(
        self,
        evidence: Evidence,
        threads: int,
        progress: Callable[[str, int], None] = lambda stage, simulations: None,
    ) -> None:
        super().__init__(progress)
        self._evidence, self._threads = evidence, threads
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="adv2e-simulate")
        self._frames = FrameCache()
        self._light: Callable[[Config], Instants] = lambda config: self._frames.of(
            config, lambda: evidence.instants(config)
        )

    def of(self, evidence: Evidence) -> Simulator:
        """Return a simulator of another recording, which reports no progress."""
        return Simulator(evidence, self._threads)

    def aside(self) -> Simulator:
        """Return one of the same frames that neither counts nor tells; it is not to be closed."""
        made = copy.copy(self)
        made._progress = lambda stage, simulations: None
        return made

    def there_and_back(self, config: Config, shift_px: tuple[float, float]) -> Simulator:
        """Return a simulator of frames that were shifted by `shift_px` and back, for `config`."""
        times_ns, light = self._light(config)
        x, y = shift_px
        moved = np.array([shifted(shifted(one, (x, y)), (-x, -y)) for one in light])
        made = self.of(self._evidence)
        made._light = lambda _: (times_ns, moved)
        return made

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)

    def stream(self, config: Config, seed: int, *, rough: bool = False, trying: str = "") -> Stream:
        """Return the events of one simulation, cut to the time that is looked at.

        `seed` tells simulations of one diagnosis apart, the configuration's tells diagnoses apart.
        `trying` names the effect that it is made for, to be told.
        """
        evidence = self._evidence
        events = events_of(
            self._light(config),
            dataclasses.replace(config, seed=(_SEEDS * config.seed + seed) % 2**63),
            threads=1,
            coarseness=_ROUGH if rough else FINE,
        )
        self.count(trying)
        first, last = evidence.times_s[0] * 1e6, evidence.times_s[-1] * 1e6
        return Stream.of(events, evidence.width, evidence.height).between(first, last)

    def streams(self, config: Config, seeds: Iterable[int]) -> list[Stream]:
        return self.map(lambda seed: self.stream(config, seed), seeds)

    def map(self, work: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
        """Return ``work`` of each row of the columns, worked on at the same time."""
        return list(self._pool.map(work, *columns))


# ---- Frames made once for many simulations, where making them takes longer than all else.
#
# Sharp frames, and those along the motion, depend on the frames and their exposure alone, so they
# can be given to the pixels as if they had been recorded. What else acts on the light of each
# frame is laid over them: it moves the motion that is found by next to nothing. A picture that is
# moved is made once, too, from those.


Instants = tuple[list[int], NDArray[np.float32]]
"""Times [ns], and the light at them [DN], (instants, rows, columns)."""

_KEPT = 4
"""Ways to make frames of which they are kept: those tried one beside another."""


_Held = dict[Any, tuple[threading.Lock, list[Instants]]]


class FrameCache:
    """Frames of a recording, read and made once for each way to do that; for many threads."""

    def __init__(self) -> None:
        self._made, self._moved, self._lock = _Held(), _Held(), threading.Lock()

    def of(self, config: Config, read: Callable[[], Instants]) -> Instants:
        """Return the frames, as `read` does, and what is :func:`made` of them where that is done.

        They are for :func:`events_of`.
        """
        frames, sampling = config.frames, config.sampling
        once = is_made_once(config)
        how = (sampling, frames.exposure_us) if once else None
        key, acting = (frames.encoding, frames.full_scale, how), _until_moved(config)

        def in_place() -> Instants:
            return self._of(self._made, key, lambda: made(config, *read()) if once else read())

        def moved() -> Instants:
            times_ns, light = in_place()
            return times_ns, _after(acting, config, times_ns, light)

        return self._of(self._moved, (key, acting), moved) if _is_moved(config) else in_place()

    def _of(self, held: _Held, key: Any, make: Callable[[], Instants]) -> Instants:
        """Return the cached value of a key, made by `make` if there is none.

        The oldest are dropped.  Who asks for another key does not wait for this one.
        """
        with self._lock:
            found = held.pop(key, None) or (threading.Lock(), [])
            while len(held) >= _KEPT:
                del held[next(iter(held))]
            held[key] = found
        making, value = found
        with making:
            if not value:
                value.append(make())
        return value[0]


def events_of(
    instants: Instants,
    config: Config,
    *,
    threads: int | None = None,
    coarseness: Coarseness = PRECISE,
) -> Events:
    """Return the events of frames that were made once for a configuration, (n,), sorted.

    `instants`: as :meth:`FrameCache.of` returns them, or the first of them.
    """
    lean, effects = _as_recorded(config)
    frames = zip(*instants, strict=True)
    hooks = active_hooks(lean, effects)
    chunks = events_from_light(frames, lean, hooks=hooks, threads=threads, coarseness=coarseness)
    return np.concatenate(list(chunks))


def is_made_once(config: Config) -> bool:
    """Tell whether sharp or in-between frames may be given as frames.

    Not where an effect needs to know which of them were recorded, and not where making them costs
    nothing: linear interpolation, of frames as they are.
    """
    sampling, user, coupling = config.sampling, getattr(config, "user", None), coupling_of(config)
    # which were recorded is counted, and intervals differ in number
    uneven = sampling.max_motion_px is not None
    return (
        (_is_along_motion(config) or config.frames.exposure_us > 0.0)
        and sampling.last_interval != "printed"
        and not (uneven and coupling is not None and coupling.amplitude)
        and not any(getattr(user, name) is not None for name in user_effects(config))
    )


def _is_along_motion(config: Config) -> bool:
    return config.sampling.interpolation != "linear" and config.sampling.L > 1


def _is_moved(config: Config) -> bool:
    """Tell whether moved frames may be given as frames: frames that are already sharp may."""
    return any(config.frames.shift_px) and (
        is_made_once(config) or config.frames.exposure_us == 0.0
    )


def _until_moved(config: Config) -> Frames:
    """Return the frame settings that act on light up to the shift: black level, depth, shift."""
    frames = config.frames
    return Frames(
        black_level_dn=frames.black_level_dn,
        black_depth_dn=frames.black_depth_dn,
        shift_px=frames.shift_px,
    )


def _after(
    acting: Frames, config: Config, times_ns: list[int], light: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the light of frames after some of the effects on it."""
    frames: Iterator[LightFrame] = zip(times_ns, light, strict=True)
    for hook in frame_hooks(acting, config.sampling):
        frames = hook.light(frames)
    return np.array([one for _, one in frames], np.float32)


def made(config: Config, times_ns: list[int], light: NDArray[np.float32]) -> Instants:
    """Return the frames, sharp where they are exposed, and what is between them.

    Linear interpolation is left to the pixels.
    """
    sharp = _after(Frames(exposure_us=config.frames.exposure_us), config, times_ns, light)
    if not _is_along_motion(config):
        return times_ns, sharp
    upsampler = make_upsampler(config.sampling)
    times: list[int] = []
    found: list[NDArray[np.float32]] = []
    for (t0, first), (t1, second), beside in neighbours(zip(times_ns, sharp, strict=True)):
        if not times:
            times.append(t0)
            found.append(first)
        count = upsampler.count(first, second, beside)
        times += [instant_ns(t0, t1, k, count) for k in range(1, count + 1)]
        found += list(upsampler.between(first, second, beside))
    return times, np.array(found, np.float32)


def _as_recorded(config: Config) -> tuple[Config, list[Hooks]]:
    """Return `config` for what is made once: frames sharp and in place, and all between them.

    And the effects on other than frames that need to know how these were recorded.
    """
    frames, sampling, readout = config.frames, config.sampling, config.readout
    effects: list[Hooks] = []
    if is_made_once(config):
        coupling = coupling_of(config)
        if readout is not None and coupling is not None and coupling.amplitude:
            every = sampling.L if _is_along_motion(config) else 1
            effects.append(FrameCouplingHooks(coupling, 0.5 * frames.exposure_us, every))
            readout = replace(readout, frame_coupling=None)
        frames = replace(frames, exposure_us=0.0)
        if _is_along_motion(config):
            sampling = Sampling(L=1, K=sampling.K, last_interval=sampling.last_interval)
    if _is_moved(config):
        frames = replace(frames, black_level_dn=0.0, black_depth_dn=0.0, shift_px=(0.0, 0.0))
    return replace(config, frames=frames, sampling=sampling, readout=readout), effects
