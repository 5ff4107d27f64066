"""The comparison as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from writing.markdown import table

from adv2e.comparison.distances import MEASURES
from adv2e.comparison.floor import Floor

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


@dataclass(frozen=True)
class Stream:
    """What is told of a stream by itself: None where it is not defined."""

    events: float
    on_share: float | None
    still_hz: float | None


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    label: str
    values: Floor
    floor: Floor | None = None
    stream: Stream | None = None


def preamble() -> str:
    """Return what must be known to read the tables."""
    return "\n\n".join([HEADER, f"{PAIRS} {FLOORS} {STILL} {HALF_SPLIT}"])


def definitions() -> str:
    """Return what each distance is, as a list."""
    lines = [f"- {COLUMNS[name]}: {about.definition}." for name, about in MEASURES.items()]
    return "\n".join(["## Distances", "", *lines])


def markdown(rows: Sequence[Row], measured: Stream) -> str:
    """Return the table."""
    names = ["configuration", "events", "ON share", *COLUMNS.values(), "still"]
    return table(names, (_cells(row, measured) for row in rows))


def _cells(row: Row, measured: Stream) -> list[str]:
    apart = [_distance(row, name) for name in COLUMNS]
    if row.stream is None:
        return [row.label, "", "", *apart, ""]
    ratio = row.stream.events / measured.events if measured.events else None
    return [
        row.label,
        f"{row.stream.events:,.0f} / {measured.events:,.0f} ({number(ratio)})",
        f"{number(row.stream.on_share)} / {number(measured.on_share)}",
        *apart,
        f"{number(row.stream.still_hz)} / {number(measured.still_hz)}",
    ]


def _distance(row: Row, name: str) -> str:
    value = number(row.values[name])
    return value if row.floor is None else f"{value} ({number(row.floor[name])})"


def number(value: float | None) -> str:
    """Return a number with as many digits as count, or a dash for None."""
    if value is None:
        return "-"
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"
