"""Simulations of the recording's own frames, many at a time, and the progress of a diagnosis."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.simulation.affordable import FINE
from adv2e.diagnosis.simulation.frames import FrameCache, Instants, events_of
from adv2e.effects.frames.misregistration import shifted
from adv2e.pixel.steps import Coarseness

# ---- Progress of a diagnosis.


@dataclass(frozen=True)
class Progress:
    """Progress of a diagnosis: its stage, and the simulations done.

    The total number of simulations is not known before: it depends on their results.

    Attributes
    ----------
    stage : str
        In a few words.
    simulations : int
        Done since the diagnosis began, in all stages.
    """

    stage: str
    simulations: int


Result = TypeVar("Result")

_SEEDS = 1_000_000
"""Of a diagnosis, fewer than these; each seed of the configuration has its own."""
_ROUGH = Coarseness(5.0, 2.5)
"""Twice as fast with what takes longest, and off by what the first steps of a fit do not show."""


class Simulator:
    """Turns configurations into streams, in threads: a simulation in each.

    `progress` is told of each stage that begins and of each simulation that is done.
    """

    def __init__(
        self,
        evidence: Evidence,
        threads: int,
        progress: Callable[[Progress], None] = lambda now: None,
    ) -> None:
        self._evidence, self._threads, self._progress = evidence, threads, progress
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="adv2e-simulate")
        self._frames, self._counting = FrameCache(), threading.Lock()
        self._light: Callable[[Config], Instants] = self._recorded
        self.done, self._stage = 0, ""

    def begin(self, stage: str) -> None:
        """Begin a stage: its name is reported with the simulations that follow."""
        with self._counting:
            self._stage = stage
            self._progress(Progress(stage, self.done))

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
            self._progress(Progress(self._stage, self.done))
        first, last = evidence.times_s[0] * 1e6, evidence.times_s[-1] * 1e6
        return Stream.of(events, evidence.width, evidence.height).between(first, last)

    def streams(self, config: Config, seeds: Iterable[int]) -> list[Stream]:
        """Return the events of simulations of one model."""
        return self.map(lambda seed: self.stream(config, seed), seeds)

    def _recorded(self, config: Config) -> Instants:
        """Return the light of the recording's frames, and what is made of them once."""
        return self._frames.of(config, lambda: self._evidence.instants(config))

    def map(self, work: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
        """Return ``work`` of each row of the columns, worked on at the same time."""
        return list(self._pool.map(work, *columns))
