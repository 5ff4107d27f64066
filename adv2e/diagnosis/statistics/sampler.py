"""Summary statistics of simulations."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from functools import cached_property

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.groups import Array
from adv2e.diagnosis.statistics.summary import SummaryStatistics


class Sampler:
    """Draws the summary statistics of models: simulates, and measures.

    Parameters
    ----------
    simulator : Simulator
    statistics : SummaryStatistics
    bias : (views, statistics)
        Taken off all statistics: what they owe to the interpolation between frames.
    is_rough : bool
        Simulations are as good as the first steps of a fit need.
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

    @cached_property
    def rough(self) -> Sampler:
        """The same with rougher simulations."""
        return Sampler(self.simulator, self.statistics, self._bias, is_rough=True)

    def _measured(self, simulator: Simulator, config: Config, seed: int) -> Array:
        stream = simulator.stream(config, seed, rough=self._is_rough)
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
