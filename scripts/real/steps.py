"""What a search found, step by step, as it is judged on data that nothing was fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from writing.markdown import table

from adv2e.comparison.distances import distances
from adv2e.comparison.floor import Floor, half_split
from adv2e.comparison.windows import Windows
from adv2e.diagnosis.fitting.nuisances import totals
from adv2e.events import Events, empty_events
from real.model import SCORE, Judged
from real.table import COLUMNS as TITLES
from real.table import number
from real.tried import Added

COLUMNS = {
    name: TITLES[name] for name in ("relative_5_bins", SCORE, "relative_1_bin_smoothed", "error")
}
JUDGED = ("events", "ON share", *COLUMNS.values(), "mean")
"""Titles of the columns of `judged_cells`."""


@dataclass(frozen=True)
class Step:
    """A model on the way, as judged on data that it was not fitted to."""

    added: Added
    judged: Judged


def steps_table(
    size: tuple[int, int], measured: Events, steps: Sequence[Step], windows: Windows
) -> str:
    """Return a row a step, and what chance and no events come to; `measured`: what it is of."""
    rows = []
    for step in steps:
        levels = step.added.config.pixel.thresholds
        judged = judged_cells(step.judged, measured)
        rows.append([step.added.text(), f"{levels.on:.3f} / {levels.off:.3f}", *judged])
    split = half_split(measured, windows, *size)
    nothing = distances(measured, empty_events(), windows, *size).values
    for label, values in (("half split (Poisson)", split), ("no events at all", nothing)):
        rows.append([label, "", "", "", *cells(values), ""])
    return table(["added", "ON / OFF threshold [ln]", *JUDGED], rows)


def judged_cells(judged: Judged, measured: Events) -> list[str]:
    """Return totals, distances and floors, and what counts without the simulation's own chance."""
    share = totals(measured)[0] / len(measured)
    return [
        f"{judged.events_ratio:.2f}",
        f"{number(judged.on_share)} / {share:.2f}",
        *(f"{number(judged.values[n])} ({number(judged.floor[n])})" for n in COLUMNS),
        number(judged.without_chance(SCORE)),
    ]


def cells(values: Floor) -> list[str]:
    """Return the distances."""
    return [number(values[name]) for name in COLUMNS]
