"""All summary statistics of a stream, in every view of the data, and those of simulations."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from functools import cached_property

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.groups import Array, Entry, Group
from adv2e.diagnosis.statistics.pixels import count_pixels, pixels
from adv2e.diagnosis.statistics.rates import course, load, phase, rate_hz, rates, since_leap
from adv2e.diagnosis.statistics.spectrum import spectrum
from adv2e.diagnosis.statistics.timing import (
    Slopes,
    drift,
    gaps,
    intervals,
    lag,
    neighbours,
    row_gaps,
    runs,
    shift,
    ticks,
)
from adv2e.reports.result import Kind

BOTH = splits.COUNT
"""The view that joins the data for training and validation."""
VIEWS = splits.COUNT + 1
"""Every part of the data is a view of its own, and there is :data:`BOTH`."""


class SummaryStatistics:
    """All groups of statistics, for one scene and one declared model.

    Parameters
    ----------
    pilot : sequence of Stream
        Simulations of the declared model, from which is known what to expect.
    besides : sequence of Group
        Of what only some recordings have.

    Attributes
    ----------
    titles, kinds : list of str
        Of the group of each statistic.
    least : (statistics,)
        Deviation below which each does not count as known.
    """

    def __init__(
        self, scene: Scene, pilot: Sequence[Stream], besides: Sequence[Group] = ()
    ) -> None:
        placed = [Placed.of(stream, scene) for stream in pilot]
        expected = np.mean([count_pixels(one, scene) for one in placed], axis=0)
        slopes = Slopes(scene)
        self.scene = scene
        # of light that is known when it leaps, nothing hangs on when frames were
        of_light = (
            [shift(slopes), phase(scene), spectrum(scene)]
            if scene.leaps is None
            else [since_leap(scene, scene.leaps)]
        )
        self.groups: list[Group] = [
            rates(scene),
            course(scene.times_us[0], scene.times_us[-1]),
            load(rate_hz(scene, placed)),
            intervals(),
            intervals(at_rest=True),
            runs(),
            lag(slopes),
            drift(slopes),
            *of_light,
            *besides,
            ticks(),
            gaps(),
            row_gaps(),
            neighbours(),
            pixels(scene, expected),
        ]
        self.entries: list[Entry] = [entry for group in self.groups for entry in group.entries]
        self.least = np.concatenate(
            [np.broadcast_to(group.least, len(group.entries)) for group in self.groups]
        )
        self.titles: list[str] = [group.title for group in self.groups for _ in group.entries]
        self.kinds: list[Kind] = [group.kind for group in self.groups for _ in group.entries]

    def measure(self, stream: Stream) -> Array:
        """Return all statistics of a stream, (views, statistics)."""
        placed, columns = Placed.of(stream, self.scene), []
        for group in self.groups:
            raw = group.count(placed)
            views = [*raw, raw[splits.TRAIN] + raw[splits.VALIDATION]]
            columns.append(np.array([group.values(view) for view in views]))
        return np.concatenate(columns, axis=1)


# ---- Summary statistics of simulations.


class Sampler:
    """Draws the summary statistics of models: simulates, and measures.

    Parameters
    ----------
    bias : (views, statistics)
        Taken off all statistics: what they owe to the interpolation between frames.
    is_rough : bool
        Simulations are as good as the first steps of a fit need.

    Attributes
    ----------
    trying : dict
        Effects that configurations stand for, to be told while they are simulated.
    """

    def __init__(
        self,
        simulator: Simulator,
        statistics: SummaryStatistics,
        bias: Array | float = 0.0,
        *,
        is_rough: bool = False,
    ) -> None:
        self.simulator, self.statistics = simulator, statistics
        self._bias, self._is_rough = bias, is_rough
        self._held: dict[tuple[Config, int], Array] = {}
        self.trying: dict[Config, str] = {}

    @cached_property
    def rough(self) -> Sampler:
        return Sampler(self.simulator, self.statistics, self._bias, is_rough=True)

    def _measured(self, simulator: Simulator, config: Config, seed: int) -> Array:
        trying = self.trying.get(config, "")
        stream = simulator.stream(config, seed, rough=self._is_rough, trying=trying)
        return self.statistics.measure(stream) - self._bias

    def sample(self, config: Config, seeds: Sequence[int]) -> Array:
        """Return the statistics of simulations of one model, (seeds, views, statistics)."""
        return np.asarray(self.samples([config], seeds)[0])

    def samples(self, configs: Sequence[Config], seeds: Sequence[int]) -> Array:
        """Return the statistics of each configuration with each seed, (configs, seeds, ...).

        What was simulated before is not simulated again: a step of a fit ends where the next one
        begins, and each effect is tried more than once.
        """
        pairs = [(config, seed) for config in configs for seed in seeds]
        fresh = [pair for pair in dict.fromkeys(pairs) if pair not in self._held]
        found = self.simulator.map(lambda pair: self._measured(self.simulator, *pair), fresh)
        self._held.update(zip(fresh, found, strict=True))
        rows = np.array([self._held[pair] for pair in pairs])
        return rows.reshape(len(configs), len(seeds), *rows.shape[1:])

    def there_and_back(
        self, config: Config, shift_px: tuple[float, float], seeds: Sequence[int]
    ) -> Array:
        """Return the statistics for frames moved there and back, (seeds, views, statistics)."""
        with closing(self.simulator.there_and_back(config, shift_px)) as moved:
            return np.array(moved.map(lambda seed: self._measured(moved, config, seed), seeds))
