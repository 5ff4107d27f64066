#!/usr/bin/env python
"""How much memory a conversion takes, against what it may take whatever the clip.

Makes its own clips, a scene in motion and a burst of about 100 million events a second, and runs
``adv2e convert`` on each in a process of its own::

    python scripts/benchmarks/memory.py --quick
    python scripts/benchmarks/memory.py --size 1280x720 --format h5
    python scripts/benchmarks/memory.py --lengths

``--lengths`` converts clips that differ in length alone, of 12, 120 and 1,200 frames, of four
sizes.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
from writing import output_option, table, write_report

from benchmarks.clips import Burst, Clip, stored
from benchmarks.measure import Job, Log, Measured, Plan, about, number, of_a_plan, run_rounds

FORMATS = ("h5", "txt", "zip")
FACTORS = (1, 10)
SCENE, BURST = "scene", "burst"

SHORT_DEAD_TIME = "pixel.refractory.period_us=200"
"""For the burst: with the dead time as shipped, a small sensor makes fewer events than that."""

ABOUT = (
    "`adv2e convert`, as shipped, each run in a process of its own, compiled beforehand: most"
    " memory that the process ever held (VmHWM), interpreter and libraries included. Scene: a"
    " texture pans and turns, disks cross it. Burst: the whole field flickers, with noise, dead"
    " time 200 us. Input: `.npy`; zip holds the frames, too."
)


@dataclass(frozen=True)
class Size:
    """A sensor, what a conversion for it may take, and the burst it is tried with.

    `burst_fps` and `swing` are such that about 100 million events a second come out, see
    :class:`benchmarks.clips.Burst`.  Either clip has so many `frames`; a quarter, with --quick.
    """

    width: int
    height: int
    most_mib: float
    burst_fps: float
    swing: float
    frames: int

    @property
    def name(self) -> str:
        """Columns and rows, ``346x260``."""
        return f"{self.width}x{self.height}"


SIZES = (
    Size(346, 260, 300.0, 240.0, 4.4, 64),
    Size(1280, 720, 500.0, 30.0, 1.2, 8),
    Size(3840, 2160, 1536.0, 30.0, 0.32, 12),
)

LENGTHS = (12, 120, 1200)
"""Frames of clips that differ in nothing else."""

LENGTH_SIZES = ((240, 180), (346, 260), (1280, 720), (3840, 2160))

LENGTH_FPS = 30.0
LENGTH_CYCLE = 60
"""Frames of such a clip that differ; it goes through them to and fro."""

LENGTH_MOVING = 0.05
"""Share of its rows in which anything moves."""


@dataclass(frozen=True)
class Case:
    """A conversion to be measured: sensor, clip, frames made of each interval, format."""

    size: Size
    clip: str
    L: int
    format: str

    @property
    def name(self) -> str:
        """All four, in words."""
        return f"{self.size.name}: {self.clip}, L = {self.L}, {self.format}"


def clip_of(size: Size, kind: str, plan: Plan) -> tuple[Path, float]:
    """Return the file of a clip and its frames a second; make it if need be."""
    frames = size.frames // 4 if plan.quick else size.frames
    shape = {"width": size.width, "height": size.height, "frames": frames}
    if kind == SCENE:
        return stored(Clip(**shape, fps=30.0), plan.folder), 30.0
    return stored(Burst(**shape, fps=size.burst_fps, swing=size.swing), plan.folder), size.burst_fps


def job_of(case: Case, plan: Plan, scratch: Path) -> Job:
    """Return the job of a case, whose output goes to the folder `scratch`."""
    clip, fps = clip_of(case.size, case.clip, plan)
    arguments = [
        *converting(clip, fps, scratch / f"out.{case.format}", plan),
        "--overwrite", "--no-progress", "--set", f"sampling.L={case.L}",
    ]  # fmt: skip
    if case.clip == BURST:
        arguments += ["--set", SHORT_DEAD_TIME]
    options = {"arguments": arguments}
    return Job(name=case.name, clip=str(clip), fps=fps, options=options, action="convert")


def converting(clip: Path, fps: float, output: Path, plan: Plan) -> list[str]:
    """Return the arguments of ``adv2e`` that all conversions here have."""
    threads = ["--threads", str(plan.threads)] if plan.threads else []
    light = ["--set", "frames.encoding=linear"]
    return ["convert", str(clip), "--fps", f"{fps:g}", "-o", str(output), *light, *threads]


def cases(sizes: Sequence[str], formats: Sequence[str]) -> Iterator[Case]:
    """Yield the cases of these sizes and formats, none: of all."""
    for size in SIZES:
        for clip in (SCENE, BURST):
            for L in FACTORS:
                for format_ in FORMATS:
                    if size.name in (sizes or [size.name]) and format_ in (formats or FORMATS):
                        yield Case(size, clip, L, format_)


@click.command()
@of_a_plan(rounds=1, quick_rounds=1)
@click.option(
    "--size", "sizes", type=click.Choice([size.name for size in SIZES]), multiple=True,
    help="Only this sensor; repeatable.",
)  # fmt: skip
@click.option(
    "--format", "formats", type=click.Choice(FORMATS), multiple=True,
    help="Only this format; repeatable.",
)  # fmt: skip
@click.option("--lengths", is_flag=True, help="Clips of three lengths instead, to HDF5.")
@output_option
def main(
    plan: Plan, log: Log, sizes: tuple[str, ...], formats: tuple[str, ...], lengths: bool,
    output: Path | None,
) -> None:  # fmt: skip
    """Measure the memory of conversions."""
    with tempfile.TemporaryDirectory(prefix="adv2e-memory-") as scratch:
        if lengths:
            text, raw = measure_lengths(plan, Path(scratch), log)
        else:
            text, raw = measure(plan, list(cases(sizes, formats)), Path(scratch), log)
    write_report(text, output, raw)


def measure_lengths(plan: Plan, scratch: Path, log: Log) -> tuple[str, list[dict[str, Any]]]:
    """Convert clips that differ in length alone; return the report and the raw numbers."""
    jobs = []
    for width, height in LENGTH_SIZES:
        for frames in LENGTHS:
            name = f"{width}x{height}-{frames}"
            clip = long_clip(scratch / name, width, height, frames)
            arguments = [
                *converting(clip, LENGTH_FPS, scratch / f"{name}.h5", plan),
                "--overwrite", "--no-progress", "--set", "sampling.L=1",
            ]  # fmt: skip
            jobs.append(Job(name=name, options={"arguments": arguments}, action="convert"))
    found = run_rounds(jobs, plan.rounds, log, warm=jobs[:1])
    peaks = {one.job.name: one.last["peak_mib"] for one in found}
    rows = [
        [f"{width}x{height}", *(f"{peaks[f'{width}x{height}-{n}']:.0f}" for n in LENGTHS)]
        for width, height in LENGTH_SIZES
    ]
    head = ("most memory [MiB]", *(f"{frames:,} frames" for frames in LENGTHS))
    text = "\n\n".join([f"# Memory by length\n\n{about(found)}", table(head, rows)])
    return text, [asdict(one) for one in found]


def measure(
    plan: Plan, wanted: Sequence[Case], scratch: Path, log: Log
) -> tuple[str, list[dict[str, Any]]]:
    """Run all cases; return the report and the raw numbers."""
    by_name = {case.name: case for case in wanted}
    jobs = [job_of(case, plan, scratch) for case in wanted]
    found = run_rounds(jobs, plan.rounds, log, warm=jobs[:1])
    pairs = [(by_name[one.job.name], one) for one in found]
    text = "\n\n".join([f"# Memory\n\n{about(found)}", ABOUT, report(pairs)])
    return text, [asdict(one) for one in found]


def report(pairs: Sequence[tuple[Case, Measured]]) -> str:
    """Return the table, a row a case."""
    header = ("size, clip", "L", "to", "M events", "s", "peak MiB", "at most", "held")
    rows = []
    for case, one in pairs:
        peak = one.last["peak_mib"]
        rows.append([
            f"{case.size.name}, {case.clip}", str(case.L), case.format,
            number(one.last["events"] / 1e6), number(one.wall_s().median), f"{peak:.0f}",
            f"{case.size.most_mib:.0f}", "yes" if peak <= case.size.most_mib else "NO",
        ])  # fmt: skip
    return table(header, rows)


def long_clip(folder: Path, width: int, height: int, frames: int) -> Path:
    """Make a folder of so many images, which are links to a few, to and fro; return it."""
    folder.mkdir()
    cycle = min(LENGTH_CYCLE, frames)
    recipe = Clip(width=width, height=height, frames=cycle, fps=LENGTH_FPS, moving=LENGTH_MOVING)
    made = []
    for k, frame in enumerate(recipe.render()):
        made.append(folder / f"{k:08d}.png")
        if not cv2.imwrite(str(made[-1]), frame):
            raise OSError(f"{folder}: cannot write pictures there")
    to_and_fro = made + made[-2:0:-1]
    for k in range(len(made), frames):
        (folder / f"{k:08d}.png").hardlink_to(to_and_fro[k % len(to_and_fro)])
    return folder


if __name__ == "__main__":
    main()
