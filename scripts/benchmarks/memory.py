#!/usr/bin/env python
"""How much memory a conversion takes, against what it may take whatever the clip.

Makes its own clips, a scene in motion and a burst of about 100 million events a second, and runs
``adv2e convert`` on each in a process of its own::

    python scripts/benchmarks/memory.py --quick
    python scripts/benchmarks/memory.py --size 1280x720 --format h5
    python scripts/benchmarks/memory.py --long 600

``--long SECONDS`` converts that many seconds of 1280x720 at 30 frames a second instead, mostly
still, and compares the last tenth with the first (Linux only).  ``--lengths`` converts clips of the
same kind, of 12, 120 and 1,200 frames, of four sizes.  Writes Markdown to standard output
and with ``-o FILE.md`` also to that file, with the raw numbers in ``FILE.json``.
"""

from __future__ import annotations

import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
from writing import output_option, table, write_report

from benchmarks.clips import Burst, Clip, stored
from benchmarks.measure import (
    Job,
    JobError,
    Log,
    Measured,
    Plan,
    about,
    machine_line,
    number,
    of_a_plan,
    run_rounds,
)  # fmt: skip
from benchmarks.worker import count_in

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

    Attributes
    ----------
    width, height : int
    most_mib : float
        Most memory [MiB].
    burst_fps, swing : float
        Chosen so that about 100 million events a second come out, see
        :class:`benchmarks.clips.Burst`.
    frames : int
        Of either clip; a quarter, with --quick.
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

LONG_SIZE = SIZES[1]
LONG_FPS = 30.0
LONG_CYCLE = 60
"""Frames of the long clip that differ; it goes through them to and fro."""

LONG_MOVING = 0.05
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
@click.option(
    "--long", "long_s", type=click.FloatRange(min=10), metavar="SECONDS",
    help="One long clip instead, to the first format named.",
)  # fmt: skip
@click.option("--lengths", is_flag=True, help="Clips of three lengths instead, to HDF5.")
@output_option
def main(
    plan: Plan, log: Log, sizes: tuple[str, ...], formats: tuple[str, ...], long_s: float | None,
    lengths: bool, output: Path | None,
) -> None:  # fmt: skip
    """Measure the memory of conversions."""
    with tempfile.TemporaryDirectory(prefix="adv2e-memory-") as scratch:
        if lengths:
            text, raw = measure_lengths(plan, Path(scratch), log)
        elif long_s is None:
            text, raw = measure(plan, list(cases(sizes, formats)), Path(scratch), log)
        else:
            text, raw = measure_long(plan, long_s, (formats or FORMATS)[0], Path(scratch))
    write_report(text, output, raw)


def measure_lengths(plan: Plan, scratch: Path, log: Log) -> tuple[str, list[dict[str, Any]]]:
    """Convert clips that differ in length alone; return the report and the raw numbers."""
    jobs = []
    for width, height in LENGTH_SIZES:
        for frames in LENGTHS:
            name = f"{width}x{height}-{frames}"
            clip = long_clip(scratch / name, width, height, frames)
            arguments = [
                *converting(clip, LONG_FPS, scratch / f"{name}.h5", plan),
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


# --- one long clip --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Moment:
    """A look at a running conversion.

    Attributes
    ----------
    seconds : float
        Time since its start.
    frames : int
        Frames taken.
    rss_mib : float
        Memory.
    cpu_s : float
        Processor time of all its threads.
    """

    seconds: float
    frames: int
    rss_mib: float
    cpu_s: float = math.nan


def watched(command: Sequence[str]) -> tuple[list[Moment], str]:
    """Run a conversion that shows its progress; return what was seen of it, and what it printed.

    Linux only: memory is read from /proc.

    Raises
    ------
    JobError
        It failed; the message is the last line that it wrote.
    """
    began = time.perf_counter()
    moments: list[Moment] = []
    told = ""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        while text := process.stderr.read1(4096).decode(errors="replace"):
            told = (told + text)[-4096:]
            taken = frames_taken(told)
            if taken is not None and not (moments and moments[-1].frames == taken):
                seconds = time.perf_counter() - began
                moments.append(Moment(seconds, taken, *_look(process.pid)))
        printed = process.stdout.read().decode()
    if process.returncode:
        lines = told.strip().splitlines() or [f"exit status {process.returncode}"]
        raise JobError(lines[-1])
    return moments, printed


def frames_taken(progress: str) -> int | None:
    """Return the number of frames that a progress bar told last, ``12/34 [``; None: none yet."""
    found = re.findall(r"(\d+)/\d+ \[", progress)
    return int(found[-1]) if found else None


def _look(pid: int) -> tuple[float, float]:
    """Return memory [MiB] and processor time [s] of a process; NaN when it has just ended."""
    status = Path(f"/proc/{pid}/status").read_text()
    # behind the name, which may hold anything: state, ten others, time as user and as system
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    found = re.search(r"VmRSS:\s+(\d+)", status)
    if found is None:
        return math.nan, math.nan
    ticks = int(fields[11]) + int(fields[12])
    return int(found[1]) / 1024, ticks / os.sysconf("SC_CLK_TCK")


def measure_long(
    plan: Plan, seconds: float, format_: str, scratch: Path
) -> tuple[str, dict[str, Any]]:
    """Convert a long clip; return the report and the raw numbers."""
    frames = round(seconds * LONG_FPS)
    clip = long_clip(scratch / "long", LONG_SIZE.width, LONG_SIZE.height, frames)
    arguments = converting(clip, LONG_FPS, scratch / f"long.{format_}", plan)
    command = [sys.executable, "-m", "adv2e", *arguments, "--progress", "--set", "sampling.L=1"]
    # the compiler's memory is no part of a conversion's
    watched([*command, "--stop", "0.2"])
    moments, printed = watched([*command, "--overwrite"])
    what = (
        f"{seconds:g} s of {LONG_SIZE.name} at {LONG_FPS:g} frames a second, {frames:,} frames, of"
        f" which {100 * LONG_MOVING:g} % of the rows move, to {format_}, L = 1:"
        f" {count_in(printed) / 1e6:,.1f} million events."
    )
    text = "\n\n".join(["# A long clip", f"{machine_line()}.", what, long_table(moments, frames)])
    return text, {"frames": frames, "moments": [asdict(moment) for moment in moments]}


def long_clip(folder: Path, width: int, height: int, frames: int) -> Path:
    """Make a folder of so many images, which are links to a few, to and fro; return it."""
    folder.mkdir()
    cycle = min(LONG_CYCLE, frames)
    recipe = Clip(width=width, height=height, frames=cycle, fps=LONG_FPS, moving=LONG_MOVING)
    made = []
    for k, frame in enumerate(recipe.render()):
        made.append(folder / f"{k:08d}.png")
        if not cv2.imwrite(str(made[-1]), frame):
            raise OSError(f"{folder}: cannot write pictures there")
    to_and_fro = made + made[-2:0:-1]
    for k in range(len(made), frames):
        (folder / f"{k:08d}.png").hardlink_to(to_and_fro[k % len(to_and_fro)])
    return folder


def long_table(moments: Sequence[Moment], frames: int) -> str:
    """Return time and processor time a frame, and memory, tenth by tenth.

    Raises
    ------
    JobError
        Too little was seen of the run.
    """
    rows = []
    for tenth in range(10):
        low, high = frames * tenth // 10, frames * (tenth + 1) // 10
        inside = [moment for moment in moments if low < moment.frames <= high]
        if len(inside) < 3:
            raise JobError(f"too few looks at tenth {tenth + 1} of the run: make it longer")
        first, last = inside[0], inside[-1]
        count = last.frames - first.frames
        each = (last.seconds - first.seconds) / count
        work = (last.cpu_s - first.cpu_s) / count
        memory = [moment.rss_mib for moment in inside]
        rows.append([
            str(tenth + 1), number(1e3 * each), number(1e3 * work),
            f"{statistics.median(memory):.0f}", f"{max(memory):.0f}",
        ])  # fmt: skip
    return table(
        ("tenth", "ms a frame", "CPU ms a frame", "memory, median [MiB]", "most [MiB]"), rows
    )


if __name__ == "__main__":
    main()
