"""Simulations of the recording's own frames with a configuration, many at a time."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.light import light_of
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.instants import Instants, Kept, events_of
from adv2e.diagnosis.statistics import Markers
from adv2e.effects.frames.misregistration import shifted
from adv2e.pixel.steps import Coarseness

Result = TypeVar("Result")

_SEEDS = 1_000_000
"""Of a diagnosis, fewer than these; each seed of the configuration has its own."""
FINE = Coarseness(5.0)
"""Steps of time, where the pixel takes any: some us off, which no statistic shows."""
_ROUGH = Coarseness(5.0, 2.5)
"""Twice as fast with what takes longest, and off by what the first steps of a fit do not show."""


class Simulator:
    """Turns configurations into streams, in threads.

    Parameters
    ----------
    evidence : Evidence
    threads : int
        Simulations at a time, each in one thread.
    progress : callable
        Called with the number of simulations done, and of those likely to be needed in all.
    """

    def __init__(
        self,
        evidence: Evidence,
        threads: int,
        progress: Callable[[int, int], None] = lambda done, likely: None,
    ) -> None:
        self._evidence, self._threads, self._progress = evidence, threads, progress
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="adv2e-simulate")
        self._frames, self._counting = Kept(), threading.Lock()
        self._light: Callable[[Config], Instants] = self._recorded
        self.done = 0
        self._likely = self._after_the_search = 0

    def expect(self, more: int, after_the_search: int | None = None) -> None:
        """Note how many simulations are likely to be needed, for those who are told of progress.

        Parameters
        ----------
        more : int
            From now to the end of the search.
        after_the_search : int, optional
            After it; default: as noted before.
        """
        if after_the_search is not None:
            self._after_the_search = after_the_search
        self._likely = self.done + more + self._after_the_search

    def of(self, evidence: Evidence) -> Simulator:
        """Return the same for another recording; nobody is told of its progress."""
        return Simulator(evidence, self._threads)

    def there_and_back(self, config: Config, shift_px: tuple[float, float]) -> Simulator:
        """Return the same for `config` and frames that were moved by `shift_px` and back."""
        times_ns, light = self._light(config)
        x, y = shift_px
        moved = np.array([shifted(shifted(one, (x, y)), (-x, -y)) for one in light])
        made = self.of(self._evidence)
        made._light = lambda _: (times_ns, moved)
        return made

    def close(self) -> None:
        """Drop what has not begun."""
        self._pool.shutdown(cancel_futures=True)

    def stream(self, config: Config, seed: int, *, rough: bool = False) -> Stream:
        """Return the events of one simulation, cut to the time that is looked at.

        `seed` tells simulations of one diagnosis apart, the configuration's tells diagnoses apart.
        """
        evidence = self._evidence
        events = events_of(
            self._light(config),
            dataclasses.replace(config, seed=(_SEEDS * config.seed + seed) % 2**63),
            threads=1,
            coarseness=_ROUGH if rough else FINE,
        )
        with self._counting:
            self.done += 1
            self._progress(self.done, self._likely)
        first, last = evidence.times_s[0] * 1e6, evidence.times_s[-1] * 1e6
        return Stream.of(events, evidence.width, evidence.height).between(first, last)

    def _recorded(self, config: Config) -> Instants:
        """Return the light of the recording's frames, and what is made of them once."""

        def read() -> Instants:
            shown = self._evidence.simulated
            return shown.times_ns, light_of(shown, config)

        return self._frames.of(config, read)

    def map(self, work: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
        """Return ``work`` of each row of the columns, worked on at the same time."""
        return list(self._pool.map(work, *columns))


class Laboratory:
    """Measures the marker statistics of simulations.

    Parameters
    ----------
    simulator : Simulator
    scene : Scene
    markers : Markers
    bias : (views, statistics), optional
        Taken off all statistics: what they owe to the interpolation between frames.
    rough : bool
        Simulations are as good as a first look needs.
    """

    def __init__(
        self,
        simulator: Simulator,
        scene: Scene,
        markers: Markers,
        bias: NDArray[np.float64] | float | None = None,
        *,
        rough: bool = False,
    ) -> None:
        self.simulator, self.scene, self.markers = simulator, scene, markers
        self._rough = rough
        self._bias = 0.0 if bias is None else bias
        self._held: dict[tuple[Config, int], Any] = {}

    @cached_property
    def for_a_first_look(self) -> Laboratory:
        """The same, as good as the first steps of a fit need."""
        return Laboratory(self.simulator, self.scene, self.markers, self._bias, rough=True)

    def measure(self, config: Config, seed: int) -> Any:
        """Return the statistics of one simulation, (views, statistics)."""
        return self._measured(self.simulator, config, seed)

    def _measured(self, simulator: Simulator, config: Config, seed: int) -> Any:
        stream = simulator.stream(config, seed, rough=self._rough)
        return self.markers.measure(Placed.of(stream, self.scene)) - self._bias

    def ensemble(self, config: Config, seeds: Sequence[int]) -> Any:
        """Return the statistics of simulations of one model, (seeds, views, statistics)."""
        return self.many([config], seeds)[0]

    def many(self, configs: Sequence[Config], seeds: Sequence[int]) -> Any:
        """Return the statistics of each configuration with each seed, (configs, seeds, ...).

        What was simulated before is not simulated again: a step of a fit ends where the next one
        begins, and each effect is probed more than once.
        """
        pairs = [(config, seed) for config in configs for seed in seeds]
        fresh = [pair for pair in dict.fromkeys(pairs) if pair not in self._held]
        self._held.update(
            zip(fresh, self.simulator.map(lambda pair: self.measure(*pair), fresh), strict=True)
        )
        rows = np.array([self._held[pair] for pair in pairs])
        return rows.reshape(len(configs), len(seeds), *rows.shape[1:])

    def there_and_back(
        self, config: Config, shift_px: tuple[float, float], seeds: Sequence[int]
    ) -> Any:
        """Return the statistics for frames moved there and back, (seeds, views, statistics)."""
        with closing(self.simulator.there_and_back(config, shift_px)) as moved:
            return np.array(moved.map(lambda seed: self._measured(moved, config, seed), seeds))
