#!/usr/bin/env python
"""What the cost of a pixel and frame depends on: one quantity varied at a time.

Sub-steps, frame rate, motion, contrast, size up to 3840x2160, threads.  Each point is a process of
its own, in interleaved rounds, with noise off and with all effects::

    python scripts/benchmarks/scaling.py [--quick] [-o out/scaling.md]

Prints a table; ``-o FILE.md`` also writes it, with the raw numbers in ``FILE.json`` and a figure in
``FILE.png``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import load_pyplot, output_option, save_figure, table, write_report

from adv2e.background import default_threads
from benchmarks.clips import Clip
from benchmarks.machine import about
from benchmarks.options import of_a_plan
from benchmarks.processes import Job, Log, Measured, number, run_rounds
from benchmarks.report import peak_text
from benchmarks.settings import ALL, Plan, stepped

BASE = Clip(width=346, height=260, frames=97)
QUICK_BASE = replace(BASE, frames=17)

RATES = (30.0, 60.0, 120.0, 240.0, 480.0, 960.0)
SPEEDS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0)
SHARES = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
CONTRASTS = (0.05, 0.1, 0.2, 0.4, 0.75, 1.5)
SIZES = ((160, 120), (346, 260), (640, 480), (1280, 720), (1920, 1080), (3840, 2160))
STEPS = (1, 2, 5, 10, 20, 50, 100)
PIXEL_FRAMES = 60_000_000
"""Pixels times frames of the sizes that the base clip's number of frames would take too long."""

_THREADS = "threads"
_TITLES = {"K": "sub-steps K", _THREADS: "threads, wall time"}
"""Of the pictures, where they are not what is varied; other programs lengthen wall times most."""

OFF, EVERY = "noise off", "all effects"
COLOURS = {
    OFF: "#1d3557", EVERY: "#c1121f", "first_order_hold": "#e08a1e", "paper": "#9d7fb8",
}  # fmt: skip


@dataclass(frozen=True)
class Sample:
    """A point of the figure.

    Attributes
    ----------
    axis : str
        What is varied.
    value : float
        Its value; for sizes, megapixels.
    curve : str
    label : str
        The value as text.
    job : Job
    """

    axis: str
    value: float
    curve: str
    label: str
    job: Job


def base_of(plan: Plan) -> Clip:
    """Return the clip that the others vary."""
    return QUICK_BASE if plan.quick else BASE


def thinned(values: Sequence[Any], plan: Plan) -> Sequence[Any]:
    """Return all values, in quick mode every other one from the last backwards."""
    return tuple(reversed(tuple(reversed(values))[::2])) if plan.quick else values


def samples(plan: Plan) -> Iterator[Sample]:
    """Yield all points."""
    base = base_of(plan)
    for curve, effects in ((OFF, ()), (EVERY, ALL)):
        for axis, value, label, clip in varied_clips(plan):
            job = plan.job(f"{axis} {label}, {curve}", clip, effects)
            yield Sample(axis, value, curve, label, job)
        most = default_threads()
        for count in range(1, most + 1) if most <= 4 else _powers(most):
            job = plan.job(f"threads {count}, {curve}", base, effects, threads=count)
            yield Sample(_THREADS, count, curve, str(count), job)
    # the exact form, and two that step
    for form, curve in (("exact", OFF), ("first_order_hold",) * 2, ("paper",) * 2):
        for K in thinned(STEPS, plan):
            frames = max(9, base.frames // (1 if form == "exact" or K < 10 else K // 5))
            job = plan.job(f"K {K}, {form}", base, stepped(form, K), frames=frames)
            yield Sample("K", K, curve, str(K), job)


def _powers(most: int) -> list[int]:
    return sorted({*(1 << k for k in range(most.bit_length())), most})


def varied_clips(plan: Plan) -> Iterator[tuple[str, float, str, Clip]]:
    """Yield (what is varied, its value, as text, clip)."""
    base = base_of(plan)
    for rate in thinned(RATES, plan):
        yield "frames a second", rate, f"{rate:g}", replace(base, fps=rate)
    for speed in thinned(SPEEDS, plan):
        pace = 80 * speed
        yield "speed [px/s]", pace, f"{pace:g}", replace(base, speed=speed)
    for share in thinned(SHARES, plan):
        yield "share that moves", share, f"{share:g}", replace(base, moving=share)
    for contrast in thinned(CONTRASTS, plan):
        yield "contrast [ln]", contrast, f"{contrast:g}", replace(base, contrast=contrast)
    for width, height in thinned(SIZES, plan):
        pixels = width * height
        frames = max(5, min(base.frames, (PIXEL_FRAMES // (6 if plan.quick else 1)) // pixels))
        clip = replace(base, width=width, height=height, frames=frames)
        yield "megapixels", pixels / 1e6, f"{width}x{height}", clip


@click.command()
@of_a_plan(rounds=3, quick_rounds=1)
@output_option
def main(plan: Plan, log: Log, output: Path | None) -> None:
    """Measure what the cost of a pixel and frame depends on."""
    if output:
        load_pyplot()  # before the work, so that a missing package costs no time
    points = list(samples(plan))
    found = run_rounds([point.job for point in points], plan.rounds, log, warm=plan.warm())
    measured = {one.job.name: one for one in found}
    points = [point for point in points if point.job.name in measured]
    write(output, points, measured)


def report(points: Sequence[Sample], measured: dict[str, Measured]) -> str:
    """Return the table, in Markdown."""
    header = (
        "varied", "value", "curve", "wall ns a pixel-frame", "CPU ns", "events a pixel-frame",
        "peak MiB",
    )  # fmt: skip
    rows = []
    for point in points:
        one = measured[point.job.name]
        scale = 1e9 / (one.last["pixels"] * one.last["frames"])
        rows.append([
            point.axis, point.label, point.curve, str(one.wall_s().times(scale)),
            number(one.cpu_s().median * scale), number(one.last["events"] * scale / 1e9),
            peak_text(one),
        ])  # fmt: skip
    base = (
        "Unless varied: 346x260, 240 frames a second, 80 px/s, contrast 0.75, everything moves,"
        " exact form, all threads. Medians (least..most) of wall times."
    )
    return "\n\n".join(["# Scaling", about([*measured.values()]), base, table(header, rows)])


def write(output: Path | None, points: Sequence[Sample], measured: dict[str, Measured]) -> None:
    """Print the table; store it, the numbers and the figure."""
    raw = [
        {"axis": p.axis, "value": p.value, "curve": p.curve, **measured[p.job.name].as_dict()}
        for p in points
    ]
    write_report(report(points, measured), output, raw)
    if output:
        draw(points, measured, output.with_suffix(".png"))


def draw(points: Sequence[Sample], measured: dict[str, Measured], path: Path) -> None:
    """Draw one small picture a quantity, all with the same vertical axis.

    Processor time, which other programs on the machine lengthen least; for threads, wall time.
    """
    pyplot = load_pyplot()
    names = list(dict.fromkeys(point.axis for point in points))
    columns = 4
    figure, axes = pyplot.subplots(
        -(-len(names) // columns), columns, figsize=(12.5, 6.0), sharey=True, layout="constrained"
    )
    for axis in axes.flat[len(names) :]:
        axis.set_axis_off()
    for axis, name in zip(axes.flat, names, strict=False):
        _panel(axis, [p for p in points if p.axis == name], measured)
        axis.set_title(_TITLES.get(name, name), loc="left", fontsize=10)
    for row in axes:
        row[0].set_ylabel("processor time a pixel and frame [ns]", fontsize=9)
    handles = {}
    for axis in axes.flat:
        handles.update({h.get_label(): h for h in axis.get_lines()})
    spare = axes.flat[len(names)] if len(names) < axes.size else axes.flat[0]
    spare.legend(handles=list(handles.values()), loc="center", frameon=False, fontsize=10)
    save_figure(figure, path)


def _panel(axis: Any, points: Sequence[Sample], measured: dict[str, Measured]) -> None:
    for curve in dict.fromkeys(point.curve for point in points):
        own = sorted((p for p in points if p.curve == curve), key=lambda p: p.value)
        x = [p.value for p in own]
        spreads = [_ns(measured[p.job.name], wall=p.axis == _THREADS) for p in own]
        colour = COLOURS[curve]
        axis.plot(x, [s[1] for s in spreads], color=colour, marker="o", ms=4, lw=1.4, label=curve)
        axis.fill_between(x, *zip(*[(s[0], s[2]) for s in spreads], strict=True),
                          color=colour, alpha=0.15, lw=0)  # fmt: skip
    values = sorted({p.value for p in points})
    axis.set_yscale("log")
    if values[0] > 0:
        axis.set_xscale("log")
    else:
        axis.set_xscale("symlog", linthresh=values[1])
    texts = [f"{v:.3g}" if v >= 10 else f"{v:.2g}" for v in values]
    axis.set_xticks(values, texts, fontsize=8)
    axis.minorticks_off()
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.grid(color="#e8e8e8", lw=0.7)
    axis.spines[["top", "right"]].set_visible(False)


def _ns(one: Measured, *, wall: bool) -> tuple[float, float, float]:
    """Return least, median and most time a pixel and frame [ns]."""
    spread = one.wall_s() if wall else one.cpu_s()
    spread = spread.times(1e9 / (one.last["pixels"] * one.last["frames"]))
    return spread.least, spread.median, spread.most


if __name__ == "__main__":
    main()
