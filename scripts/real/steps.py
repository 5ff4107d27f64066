"""What a search found, step by step, as it is judged on data that nothing was fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from writing import table

from adv2e.comparison.floor import Floor
from adv2e.comparison.windows import Windows
from adv2e.events import Events
from real.model import SCORE, Judged
from real.table import COLUMNS as TITLES
from real.table import marks, number, with_floors
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
        thresholds = f"{levels.on:.3f} / {levels.off:.3f}"
        rows.append([step.added.text(), thresholds, *judged_cells(step.judged)])
    for label, values in marks(measured, windows, size).items():
        rows.append([label, "", "", "", *cells(values), ""])
    return table(["added", "ON / OFF threshold [ln]", *JUDGED], rows)


def judged_cells(judged: Judged) -> list[str]:
    """Return totals, distances and floors, and what counts without the simulation's own chance."""
    return [
        number(judged.events_ratio),
        f"{number(judged.made.on_share)} / {number(judged.measured.on_share)}",
        *with_floors(judged, COLUMNS),
        number(judged.without_chance(SCORE)),
    ]


def cells(values: Floor) -> list[str]:
    """Return the distances."""
    return [number(values[name]) for name in COLUMNS]
