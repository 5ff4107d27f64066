"""Tables of comparisons, and of what a search found step by step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from writing import table

from adv2e.comparison.distances import MEASURES, distances
from adv2e.comparison.floor import Floor, half_split
from adv2e.comparison.windows import Windows
from adv2e.events import Events, empty_events
from real.model import SCORE, Judged
from real.tried import Added

HEADER = (
    "Configurations named after a tool are that tool's parameters in the pixel of adv2e, not the"
    " tool."
)
COLUMNS = {
    "bins_shared_window": "shared window",
    "bins_own_span": "own window",
    "bins_z_scored": "z-scored",
    "relative_5_bins": "5 bins",
    "relative_5_bins_smoothed": "smoothed 5",
    "relative_1_bin_smoothed": "smoothed 1",
    "error": "over time",
}
"""Measures and what the table calls them."""

SHORT = {
    name: COLUMNS[name] for name in ("relative_5_bins", SCORE, "relative_1_bin_smoothed", "error")
}
"""Measures of the tables of a search."""
JUDGED = ("events", "ON share", *SHORT.values(), "mean")
"""Titles of the columns of `judged_cells`."""

PAIRS = "Pairs are simulated / measured; events and ON share are those of the intervals compared."
FLOORS = (
    "Distances are value (floor), the floor being the distance between seeds of the same"
    " configuration. †: its seeds give the same events; its floor is between random references to"
    " start from."
)
STILL = (
    "still: events a second of a pixel whose grey value, and that of its neighbours, keeps still."
)
HALF_SPLIT = (
    "Half split: distance between two halves of the measured events, split by chance. As far as"
    " events are a Poisson process, their true rate would come about as near."
)


def preamble() -> str:
    """Return what must be known to read the tables."""
    return "\n\n".join([HEADER, f"{PAIRS} {FLOORS} {STILL} {HALF_SPLIT}"])


def definitions() -> str:
    """Return what each distance is, as a list."""
    lines = [f"- {COLUMNS[name]}: {about.definition}." for name, about in MEASURES.items()]
    return "\n".join(["## Distances", "", *lines])


def marks(events: Events, windows: Windows, size: tuple[int, int]) -> dict[str, Floor]:
    """Return what to go by: the distances of a half of the measured events, and of none at all."""
    return {
        "half split (Poisson)": half_split(events, windows, *size),
        "no events at all": distances(events, empty_events(), windows, *size).values,
    }


def markdown(judged: Mapping[str, Judged], others: Mapping[str, Floor]) -> str:
    """Return the table of configurations, and of the marks to go by."""
    names = ["simulator", "events", "ON share", *COLUMNS.values(), "still"]
    rows = [[label, *_cells(one)] for label, one in judged.items()]
    rows += [[label, "", "", *cells(one, COLUMNS), ""] for label, one in others.items()]
    return table(names, rows)


def _cells(judged: Judged) -> list[str]:
    made, measured = judged.made, judged.measured
    return [
        f"{made.events:,.0f} / {measured.events:,.0f} ({number(judged.events_ratio)})",
        f"{number(made.on_share)} / {number(measured.on_share)}",
        *with_floors(judged, COLUMNS),
        f"{number(made.still_hz)} / {number(measured.still_hz)}",
    ]


def with_floors(judged: Judged, names: Iterable[str]) -> list[str]:
    """Return distances of these names, in brackets those between seeds."""
    return [f"{number(judged.values[name])} ({number(judged.floor[name])})" for name in names]


def number(value: float | None) -> str:
    """Return a number with as many digits as count, or a dash for None."""
    if value is None:
        return "-"
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"


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
        *with_floors(judged, SHORT),
        number(judged.without_chance(SCORE)),
    ]


def cells(found: Floor, names: Iterable[str] = tuple(SHORT)) -> list[str]:
    """Return distances of these names."""
    return [number(found[name]) for name in names]
