"""Scores of the study of interpolation, as Markdown tables and a figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from writing import load_pyplot, save_figure, table

_DEFINITIONS = """\
Each cell: {methods}. Perfect: the scene itself, rendered at the times of the frames. px: fastest
motion from frame to frame. Events: count over that of the truth. Distance: norm of the difference
between the signed grids of five bins a frame interval of made and true events, smoothed 3x3 in
space, over the norm of the true ones, all intervals at once; 1 is as far as no events. A row's
intervals are its frames', so that rates do not compare in it. Made to true, true to made: median
time from an event of one stream to the nearest of the other at the same pixel and polarity; none:
half of the events have no other. Frames: how many an interval got in the mean."""


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
    """By what makes the frames between."""
    frames: Mapping[str, float]
    """Made of an interval, in the mean."""


@dataclass(frozen=True)
class Cost:
    """Time for the frames of one interval [ms]."""

    width: int
    height: int
    method: str
    ms: float


def report(rows: Sequence[Row], costs: Sequence[Cost]) -> str:
    """Return all tables as Markdown."""
    methods = list(rows[0].scores)
    head = ["case", "fps", "px", "true events", "events", "distance", "made to true [ms]"]
    head += ["true to made [ms]", "frames"]
    cells = []
    for row in rows:
        scores = list(row.scores.values())
        cells.append(
            [
                row.case,
                f"{row.rate:g}",
                f"{row.step_px:.1f}",
                str(row.true_events),
                _cell([score.ratio for score in scores], 2),
                _cell([score.distance for score in scores], 2),
                _cell([score.made_to_true_ms for score in scores], 2),
                _cell([score.true_to_made_ms for score in scores], 2),
                _cell(row.frames.values(), 1),
            ]
        )
    definitions = _DEFINITIONS.format(methods=" / ".join(methods))
    return "\n\n".join([table(head, cells), definitions, _cost_table(costs)])


def _cell(values: Iterable[float], digits: int) -> str:
    texts = [f"{value:.{digits}f}" if math.isfinite(value) else "none" for value in values]
    return " / ".join(texts)


def _cost_table(costs: Sequence[Cost]) -> str:
    rows = [[f"{cost.width} x {cost.height}", cost.method, f"{cost.ms:.1f}"] for cost in costs]
    return table(("size", "interpolation", "ms an interval of ten frames, this machine"), rows)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Write the figure: distance and count of events by case, frame rates from left to right."""
    names = list(dict.fromkeys(row.case for row in rows))
    methods = list(rows[0].scores)
    marks = dict(zip(methods, "so^vD<>", strict=False))
    figure, axes = load_pyplot().subplots(
        2, 1, figsize=(11.0, 7.0), sharex=True, layout="constrained"
    )
    for axis, field, title in (
        (axes[0], "distance", "Distance from the true events (1: as far as no events)"),
        (axes[1], "ratio", "Events over the true ones"),
    ):
        for method in methods:
            for name in names:
                of_case = [row for row in rows if row.case == name]
                place = [names.index(name) + 0.2 * (k - 1) for k in range(len(of_case))]
                values = [getattr(row.scores[method], field) for row in of_case]
                colour = f"C{methods.index(method)}"
                label = method if name == names[0] else None
                axis.plot(
                    place,
                    values,
                    marks.get(method, ".") + "-",
                    color=colour,
                    ms=5,
                    lw=1,
                    label=label,
                )
        axis.set(title=title, ylim=(0.0, None))
        axis.axhline(1.0, color="grey", lw=0.8)
        axis.grid(alpha=0.3)
    axes[1].legend()
    rates = ", ".join(f"{rate:g}" for rate in dict.fromkeys(row.rate for row in rows))
    axes[1].set_xlabel(f"in each case from left to right: {rates} frames a second")
    axes[1].set_xticks(range(len(names)), [name.replace(" ", "\n") for name in names])
    save_figure(figure, path)
