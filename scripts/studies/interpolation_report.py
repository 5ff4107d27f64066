"""Scores of the study of interpolation, as Markdown tables and a figure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from writing import load_pyplot, save_figure, table

METHODS = ("linear", "flow", "perfect")
"""What makes the in-between frames; perfect: the scene itself, rendered at their times."""

_DEFINITIONS = """\
Each cell: linear / flow / perfect. px: fastest motion from frame to frame. Events: count over that
of the truth. Distance: norm of the difference between the signed grids of five bins a frame
interval of made and true events, smoothed 3x3 in space, over the norm of the true ones, all
intervals at once; 1 is as far as no events. A row's intervals are its frames', so that rates do not
compare in it. Made to true, true to made: median time from an event of one stream to the nearest of
the other at the same pixel and polarity; none: half of the events have no other."""


@dataclass(frozen=True)
class Score:
    """How far made events are from the true ones; see `_DEFINITIONS`."""

    ratio: float
    distance: float
    made_to_true_ms: float
    true_to_made_ms: float


@dataclass(frozen=True)
class Row:
    """One case at one frame rate."""

    case: str
    rate: float
    step_px: float
    true_events: int
    scores: Mapping[str, Score]


@dataclass(frozen=True)
class Cost:
    """Time for the frames of one interval [ms]."""

    width: int
    height: int
    method: str
    ms: float


def report(rows: Sequence[Row], costs: Sequence[Cost]) -> str:
    """Return all tables as Markdown."""
    head = ("case", "fps", "px", "true events", "events", "distance", "made to true [ms]")
    cells = [
        [
            row.case,
            f"{row.rate:g}",
            f"{row.step_px:.1f}",
            str(row.true_events),
            _cell([row.scores[method].ratio for method in METHODS], 2),
            _cell([row.scores[method].distance for method in METHODS], 2),
            _cell([row.scores[method].made_to_true_ms for method in METHODS], 2),
            _cell([row.scores[method].true_to_made_ms for method in METHODS], 2),
        ]
        for row in rows
    ]
    parts = [table([*head, "true to made [ms]"], cells), _DEFINITIONS, _cost_table(costs)]
    return "\n\n".join(parts)


def _cell(values: Sequence[float], digits: int) -> str:
    texts = [f"{value:.{digits}f}" if math.isfinite(value) else "none" for value in values]
    return " / ".join(texts)


def _cost_table(costs: Sequence[Cost]) -> str:
    rows = [[f"{cost.width} x {cost.height}", cost.method, f"{cost.ms:.1f}"] for cost in costs]
    return table(("size", "interpolation", "ms an interval of ten frames, this machine"), rows)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Write the figure: distance and count of events by case, frame rates from left to right."""
    names = list(dict.fromkeys(row.case for row in rows))
    figure, axes = load_pyplot().subplots(
        2, 1, figsize=(11.0, 7.0), sharex=True, layout="constrained"
    )
    for axis, field, title in (
        (axes[0], "distance", "Distance from the true events (1: as far as no events)"),
        (axes[1], "ratio", "Events over the true ones"),
    ):
        for method, mark in zip(METHODS, ("s", "o", "_"), strict=True):
            for name in names:
                of_case = [row for row in rows if row.case == name]
                place = [names.index(name) + 0.2 * (k - 1) for k in range(len(of_case))]
                values = [getattr(row.scores[method], field) for row in of_case]
                colour = f"C{METHODS.index(method)}"
                label = method if name == names[0] else None
                axis.plot(place, values, mark + "-", color=colour, ms=5, lw=1, label=label)
        axis.set(title=title, ylim=(0.0, None))
        axis.axhline(1.0, color="grey", lw=0.8)
        axis.grid(alpha=0.3)
    axes[1].legend()
    rates = ", ".join(f"{rate:g}" for rate in dict.fromkeys(row.rate for row in rows))
    axes[1].set_xlabel(f"in each case from left to right: {rates} frames a second")
    axes[1].set_xticks(range(len(names)), [name.replace(" ", "\n") for name in names])
    save_figure(figure, path)
