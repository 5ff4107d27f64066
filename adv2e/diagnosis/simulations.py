"""Simulations of the recording's own frames with a configuration, many at a time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.evidence import Evidence
from adv2e.diagnosis.markers import Markers
from adv2e.diagnosis.scene import Placed, Scene
from adv2e.diagnosis.stream import Stream
from adv2e.events import empty_events
from adv2e.simulation import simulate

Result = TypeVar("Result")


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
        self._evidence, self._progress = evidence, progress
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="adv2e-simulate")
        self.done = 0
        self.likely = 0

    def close(self) -> None:
        """Drop what has not begun."""
        self._pool.shutdown(cancel_futures=True)

    def stream(self, config: Config, seed: int) -> Stream:
        """Return the events of one simulation, cut to the time of the frames."""
        evidence = self._evidence
        chunks = simulate(
            evidence.frames, evidence.times_s, dataclasses.replace(config, seed=seed), threads=1
        )
        events = np.concatenate([empty_events(), *chunks])
        self.done += 1
        self._progress(self.done, self.likely)
        first, last = evidence.times_s[0] * 1e6, evidence.times_s[-1] * 1e6
        return Stream.of(events, evidence.width, evidence.height).between(first, last)

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
    """

    def __init__(self, simulator: Simulator, scene: Scene, markers: Markers) -> None:
        self.simulator, self.scene, self.markers = simulator, scene, markers

    def measure(self, config: Config, seed: int) -> Any:
        """Return the statistics of one simulation, (views, statistics)."""
        stream = self.simulator.stream(config, seed)
        return self.markers.measure(Placed.of(stream, self.scene))

    def ensemble(self, config: Config, seeds: Sequence[int]) -> Any:
        """Return the statistics of simulations of one model, (seeds, views, statistics)."""
        return np.array(self.simulator.map(lambda seed: self.measure(config, seed), seeds))

    def many(self, configs: Sequence[Config], seeds: Sequence[int]) -> Any:
        """Return the statistics of each configuration with each seed, (configs, seeds, ...)."""
        pairs = [(config, seed) for config in configs for seed in seeds]
        rows = self.simulator.map(lambda pair: self.measure(*pair), pairs)
        return np.array(rows).reshape(len(configs), len(seeds), *rows[0].shape)
