"""Figure of accuracy against cost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from writing import load_pyplot, save_figure

from benchmarks.frontier import Point

STYLES = {
    "exact": ("#c1121f", "*"),
    "first_order_hold": ("#1d3557", "o"),
    "zero_order_hold": ("#33739b", "s"),
    "euler": ("#6aa5c9", "^"),
    "paper": ("#9d7fb8", "v"),
    "EventCV": ("#2a9d3f", "D"),
    "evlib ESIM": ("#e08a1e", "P"),
    "v2e": ("#7a5230", "X"),
}
"""Colour and marker of each curve."""

LABELS = {
    "exact": "adv2e, exact",
    "first_order_hold": "first-order hold",
    "zero_order_hold": "zero-order hold",
    "euler": "Euler",
    "paper": "as printed",
}
"""What is written at a curve, where that is not its name."""

_OTHER = ("#555555", "h")
_PARTS = {"median": "Median", "mean": "Mean"}
_WRONG = 0.01  # relative error of the number of events from which on a marker is hollow


def draw_frontier(points: Sequence[Point], path: Path) -> None:
    """Draw two pictures side by side: median and mean error, in time, against processor time.

    Raises
    ------
    MissingExtraError
        Matplotlib is not installed.
    """
    pyplot = load_pyplot()
    figure, axes = pyplot.subplots(
        1, len(_PARTS), figsize=(12.5, 5.2), sharex=True, sharey=True, layout="constrained"
    )
    for axis, (part, title) in zip(axes, _PARTS.items(), strict=True):
        _draw(axis, points, part)
        axis.set_title(f"{title} distance of event times from the dense solution", loc="left",
                       fontsize=10.5)  # fmt: skip
    figure.supxlabel(
        "processor time a pixel and frame [ns]          numbers: sub-steps a frame;  hollow: number"
        " of events off by more than 1 %",
        fontsize=9.5,
    )
    save_figure(figure, path)


def _draw(axis: Any, points: Sequence[Point], part: str) -> None:
    curves: dict[str, list[Point]] = {}
    for point in points:
        curves.setdefault(point.curve, []).append(point)
    for name, found in curves.items():
        _draw_curve(axis, name, found, part)
    axis.axhline(1, color="#888888", lw=0.9, ls=":", zorder=1)
    axis.set(xscale="log", yscale="log")
    costs = [point.cpu_ns for point in points]
    axis.set_xlim(0.55 * min(costs), 5.5 * max(costs))  # room for the names
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.yaxis.set_major_formatter(lambda value, _: duration(value))
    axis.grid(which="major", color="#e8e8e8", lw=0.7)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def _draw_curve(axis: Any, name: str, found: Sequence[Point], part: str) -> None:
    colour, marker = _style(name)
    places = [(p.cpu_ns, getattr(p.error, part)) for p in found]
    line = [place for p, place in zip(found, places, strict=True) if p.steps != "adaptive"]
    axis.plot(*zip(*line, strict=True), color=colour, lw=1.4, zorder=3)
    last = max(line)
    for point, place in zip(found, places, strict=True):
        hollow = abs(point.error.ratio - 1) > _WRONG
        axis.plot(
            *place, color=colour, marker=marker, mfc="white" if hollow else colour, zorder=4,
            markersize=17 if name == "exact" else 6.5,
        )  # fmt: skip
        if point.steps == "adaptive":
            _write(axis, "adaptive", place, (-6, -3), colour, ha="right", va="top", fontsize=7.5)
        elif point.steps and place != last:
            _write(axis, point.steps, place, (5, 4), colour, fontsize=7.5)
    _name(axis, name, found, last, colour)


def _name(axis: Any, name: str, found: Sequence[Point], last: Any, colour: str) -> None:
    """Write the curve's name at its last point; above it where it is the only one."""
    label = LABELS.get(name, name)
    if name == "exact":
        _write(axis, label, last, (12, 0), colour, va="center", fontsize=10.5, weight="bold")
    elif len(found) == 1:
        _write(axis, label, last, (0, 7), colour, ha="center", va="bottom", fontsize=9)
    else:
        steps = max(int(point.steps) for point in found if point.steps.isdecimal())
        drop = -7 if name == "EventCV" else 0  # ends beside the forms of adv2e
        _write(axis, f"{steps}  {label}", last, (8, drop), colour, va="center", fontsize=9)


def _write(axis: Any, text: str, place: Any, offset: Any, colour: str, **style: Any) -> None:
    axis.annotate(text, place, offset, textcoords="offset points", color=colour, zorder=6, **style)


def duration(microseconds: float) -> str:
    """Return a time with the unit that suits it."""
    if microseconds < 1000:
        return f"{microseconds:g} µs"
    return f"{microseconds / 1e3:g} ms" if microseconds < 1e6 else f"{microseconds / 1e6:g} s"


def _style(curve: str) -> tuple[str, str]:
    return next((style for name, style in STYLES.items() if curve.startswith(name)), _OTHER)
