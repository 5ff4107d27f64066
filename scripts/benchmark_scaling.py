#!/usr/bin/env python
"""What the cost of a pixel and frame depends on: one quantity varied at a time.

Sub-steps, frame rate, motion, contrast, size up to 3840x2160, threads.  Each point is a process of
its own, in interleaved rounds, with noise off and with all effects::

    python scripts/benchmark_scaling.py [--quick] [-o out/scaling.md]

Prints a table; ``-o FILE.md`` also writes it, with the raw numbers in ``FILE.json`` and a figure in
``FILE.png``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import click
from benchmarks.clips import Clip, default_folder, stored
from benchmarks.machine import busy_line, machine_line, versions_line
from benchmarks.processes import Job, JobError, Log, Measured, number, run_rounds
from benchmarks.report import peak_text, table
from benchmarks.settings import ALL, IDEAL, Plan, stepped
from writing.pyplot import load_pyplot

from adv2e.errors import Adv2eError
from adv2e.process.cores import default_threads

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


@dataclass(frozen=True)
class Setup:
    """Folder of the clips, length, threads."""

    folder: Path
    quick: bool
    threads: int | None

    @property
    def base(self) -> Clip:
        """The clip that the others vary."""
        return QUICK_BASE if self.quick else BASE

    def thinned(self, values: Sequence[Any]) -> Sequence[Any]:
        """Return all values, in quick mode every other one from the last backwards."""
        return tuple(reversed(tuple(reversed(values))[::2])) if self.quick else values

    def job(self, name: str, clip: Clip, sets: Sequence[str], threads: int | None = None) -> Job:
        """Return the job of a clip and what is added to the ideal pixel."""
        threads = threads or self.threads
        options = {"config": [], "sets": [*IDEAL, *sets], "threads": threads}
        return Job(
            name=name,
            clip=str(stored(clip, self.folder)),
            fps=clip.fps,
            options=options,
            threads=threads,
        )


def samples(setup: Setup) -> Iterator[Sample]:
    """Yield all points."""
    for curve, effects in ((OFF, ()), (EVERY, ALL)):
        for axis, value, label, clip in varied_clips(setup):
            job = setup.job(f"{axis} {label}, {curve}", clip, effects)
            yield Sample(axis, value, curve, label, job)
        most = default_threads()
        for count in range(1, most + 1) if most <= 4 else _powers(most):
            job = setup.job(f"threads {count}, {curve}", setup.base, effects, count)
            yield Sample(_THREADS, count, curve, str(count), job)
    yield from _stepped(setup)


def _powers(most: int) -> list[int]:
    return sorted({*(1 << k for k in range(most.bit_length())), most})


def _stepped(setup: Setup) -> Iterator[Sample]:
    """Yield the points over the sub-steps K: the exact form, and two that step."""
    for form, curve in (("exact", OFF), ("first_order_hold",) * 2, ("paper",) * 2):
        for K in setup.thinned(STEPS):
            frames = max(9, setup.base.frames // (1 if form == "exact" or K < 10 else K // 5))
            clip = setup.base
            job = setup.job(f"K {K}, {form}", clip, stepped(form, K))
            yield Sample("K", K, curve, str(K), replace(job, frames=frames))


def varied_clips(setup: Setup) -> Iterator[tuple[str, float, str, Clip]]:
    """Yield (what is varied, its value, as text, clip)."""
    base = setup.base
    for rate in setup.thinned(RATES):
        yield "frames a second", rate, f"{rate:g}", replace(base, fps=rate)
    for speed in setup.thinned(SPEEDS):
        pace = 80 * speed
        yield "speed [px/s]", pace, f"{pace:g}", replace(base, speed=speed)
    for share in setup.thinned(SHARES):
        yield "share that moves", share, f"{share:g}", replace(base, moving=share)
    for contrast in setup.thinned(CONTRASTS):
        yield "contrast [ln]", contrast, f"{contrast:g}", replace(base, contrast=contrast)
    for width, height in setup.thinned(SIZES):
        pixels = width * height
        frames = max(5, min(base.frames, (PIXEL_FRAMES // (6 if setup.quick else 1)) // pixels))
        clip = replace(base, width=width, height=height, frames=frames)
        yield "megapixels", pixels / 1e6, f"{width}x{height}", clip


@click.command()
@click.option("--quick", is_flag=True, help="Fewer points, short clips, one round.")
@click.option("--rounds", type=click.IntRange(min=1), help="[default: 3, with --quick 1]")
@click.option("--threads", type=click.IntRange(min=1), help="[default: all cores]")
@click.option("--clips", "folder", type=click.Path(file_okay=False, path_type=Path))
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.md")
def main(
    quick: bool, rounds: int | None, threads: int | None, folder: Path | None, output: Path | None
) -> None:
    """Measure what the cost of a pixel and frame depends on."""
    folder = folder or default_folder()
    setup = Setup(folder, quick, threads)
    log = Log(partial(click.echo, err=True))
    try:
        if output:
            load_pyplot()  # before the work, so that a missing package costs no time
        points = list(samples(setup))
        warm = Plan(folder, quick, threads).warm()
        found = run_rounds([p.job for p in points], rounds or (1 if quick else 3), log, warm=warm)
    except (Adv2eError, JobError, OSError) as error:
        raise click.ClickException(str(error)) from None
    measured = {one.job.name: one for one in found}
    points = [p for p in points if p.job.name in measured]
    text = report(points, measured)
    click.echo(text)
    if output:
        write(output, text, points, measured)
    if log.failures:
        raise click.ClickException("; ".join(log.failures))


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
    every = list(measured.values())
    about = f"{machine_line()}. {versions_line(every)}. {busy_line(every)}"
    base = (
        "Unless varied: 346x260, 240 frames a second, 80 px/s, contrast 0.75, everything moves,"
        " exact form, all threads. Medians (least..most) of wall times."
    )
    return "\n\n".join(["# Scaling", about, base, table(header, rows)])


def write(output: Path, text: str, points: Sequence[Sample], measured: dict[str, Measured]) -> None:
    """Store the table, the numbers and the figure."""
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(text + "\n", encoding="utf-8")
    raw = [
        {"axis": p.axis, "value": p.value, "curve": p.curve, **measured[p.job.name].as_dict()}
        for p in points
    ]
    numbers = json.dumps(raw, indent=1)
    output.with_suffix(".json").write_text(numbers + "\n", encoding="utf-8")
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
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


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
