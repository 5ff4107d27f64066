"""Simulations of the declared model that tell what to expect, also of other frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.simulations import Simulator
from adv2e.diagnosis.hints.readouts import without_coupling
from adv2e.diagnosis.statistics import Markers

Array = NDArray[np.float64]

COUNT = 16
_FIRST = 10_000


@dataclass(frozen=True)
class Pilot:
    """Simulations of the declared model.

    Attributes
    ----------
    evidence : Evidence
        The recording.
    declared : Config
    scene : Scene
    markers : Markers
    streams : dict of Stream
        By their seeds.
    simulator : callable
        Makes a simulator of a recording.
    """

    evidence: Evidence
    declared: Config
    scene: Scene
    markers: Markers
    streams: dict[int, Stream]
    simulator: Callable[[Evidence], Simulator]

    @classmethod
    def of(cls, evidence: Evidence, declared: Config, scene: Scene, simulator: Simulator) -> Pilot:
        """Return simulations of a recording, and the statistics that they ask for."""
        seeds = range(_FIRST, _FIRST + COUNT)
        streams = simulator.map(lambda seed: simulator.stream(declared, seed), seeds)
        markers = Markers(scene, [Placed.of(stream, scene) for stream in streams])
        by_seed = dict(zip(seeds, streams, strict=True))
        return cls(evidence, declared, scene, markers, by_seed, simulator.of)

    @cached_property
    def sample(self) -> Array:
        """Their statistics, (seeds, views, statistics)."""
        return self._measured(self.streams.values())

    @cached_property
    def undisturbed(self) -> Pilot:
        """The same of a model without frame coupling, for frames that are to be left out."""
        bare = without_coupling(self.declared)
        if bare == self.declared:
            return self
        with closing(self.simulator(self.evidence)) as made:
            streams = made.map(lambda seed: made.stream(bare, seed), self.streams)
        return replace(self, declared=bare, streams=dict(zip(self.streams, streams, strict=True)))

    def of_frames(self, evidence: Evidence) -> Array:
        """Return the statistics of the same simulations with the frames of `evidence`."""
        with closing(self.simulator(evidence)) as made:
            return self._measured(
                made.map(lambda seed: made.stream(self.declared, seed), self.streams)
            )

    def _measured(self, streams: Iterable[Stream]) -> Array:
        return np.array([self.markers.measure(Placed.of(one, self.scene)) for one in streams])
