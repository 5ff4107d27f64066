"""Marker statistics: numbers by which a recording can differ from its simulations.

Each points to causes: numbers of events by speed and brightness to thresholds, noise and tone;
times between events to dead time and reset; the lag to poles and clocks; and so on.  None matches
events one to one, so noise has its place in all of them.  A group of statistics is a module.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.statistics.base import Entry, Group, Raw
from adv2e.diagnosis.statistics.classes import rate_hz
from adv2e.diagnosis.statistics.intervals import Intervals, Runs
from adv2e.diagnosis.statistics.neighbours import Neighbours
from adv2e.diagnosis.statistics.pixels import Pixels
from adv2e.diagnosis.statistics.rates import Course, Load, Phase, Rates
from adv2e.diagnosis.statistics.spectrum import Spectrum
from adv2e.diagnosis.statistics.stamps import Gaps, RowGaps, Ticks
from adv2e.diagnosis.statistics.timing import Drift, Lag, Shift, Slopes

__all__ = ["BOTH", "VIEWS", "Entry", "Markers"]

BOTH = parts.COUNT
"""The view that joins the parts for fitting and judging."""

VIEWS = parts.COUNT + 1
"""Every part of the data is a view of its own, and there is :data:`BOTH`."""


class Markers:
    """All groups, for one scene and one declared model.

    Parameters
    ----------
    scene : Scene
    pilot : sequence of Placed
        Simulations of the declared model, from which is known what to expect.
    """

    def __init__(self, scene: Scene, pilot: Sequence[Placed]) -> None:
        counter = Pixels(scene)
        expected = np.mean([counter.count(placed) for placed in pilot], axis=0)
        slopes = Slopes(scene)
        self.groups: list[Group] = [
            Rates(),
            Course(scene.times_us[0], scene.times_us[-1]),
            Load(rate_hz(scene, pilot)),
            Intervals(),
            Intervals(at_rest=True),
            Runs(),
            Lag(slopes),
            Drift(slopes),
            Shift(slopes),
            Phase(scene),
            Spectrum(scene),
            Ticks(),
            Gaps(),
            RowGaps(),
            Neighbours(),
            Pixels(scene, expected),
        ]
        self.entries: list[Entry] = [entry for group in self.groups for entry in group.entries]
        self.least = np.concatenate(
            [np.broadcast_to(group.least, len(group.entries)) for group in self.groups]
        )
        self.titles: list[str] = [group.title for group in self.groups for _ in group.entries]

    def measure(self, placed: Placed) -> NDArray[np.float64]:
        """Return all statistics of a stream, (views, statistics)."""
        columns = []
        for group in self.groups:
            raw: Raw = group.count(placed)
            views = [*raw, raw[parts.FIT] + raw[parts.JUDGE]]
            columns.append(np.array([group.values(view) for view in views]))
        return np.concatenate(columns, axis=1)
