"""Measurements in fresh processes, in interleaved rounds, so that a busy minute hits all alike.

Processes run :mod:`benchmarks.worker`.  Here are jobs, their rounds, what they ran on, and the
options that all benchmarks have.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial, wraps
from pathlib import Path
from typing import Any

import click
from writing import one_line_errors, threads_option

from adv2e.background import default_threads
from adv2e.errors import Adv2eError
from benchmarks.clips import Clip, default_folder, stored
from benchmarks.worker import children_cpu_s

SCRIPTS = Path(__file__).resolve().parents[1]
REPOSITORY = SCRIPTS.parent

THRESHOLD = 0.2
CUTOFF_HZ = 300.0
KNEE_DN = 20.0
IDEAL = (
    "frames.encoding=linear",
    "sampling.L=1",
    f"pixel.log_response.linear_below={KNEE_DN:g}",  # frames have 8 bits
    f"pixel.thresholds={{on: {THRESHOLD:g}, off: {THRESHOLD:g}, mismatch: 0}}",
    f"pixel.low_pass={{cutoff_hz: {CUTOFF_HZ:g}, dark_cutoff_hz: 21.8}}",
    "pixel.refractory=null",
    "pixel.leak=null",
    "pixel.shot_noise=null",
    "pixel.initial_reference=settled",
)
"""The pixel of every setting, without noise; the settings add to it."""

SHOT = "pixel.shot_noise.rate_hz=5"
MISMATCH, LEAK = "pixel.thresholds.mismatch=0.03", "pixel.leak={rate_hz: 0.1, jitter: 0}"
DEAD_TIME = "pixel.refractory.period_us=500"
ALL = (MISMATCH, LEAK, DEAD_TIME, SHOT)
EVERYTHING = (
    *ALL,
    "pixel.initial_reference=random",
    "pixel.leak={rate_hz: 0.1, photo_rate_hz: 0.1, jitter: 0.1}",
    "pixel.photoreceptor_noise.rms=0.03",
    "pixel.source_follower.cutoff_hz=1000",
    "pixel.hot_pixels={fraction: 0.01, rate_hz: 10}",
)
"""All effects there are."""


def peer_arguments(effects: bool, steps: str) -> dict[str, Any]:
    """Return arguments of EventCV, set as nearly alike as they can be; `steps`: off, 10, ..."""
    given = {"pos_thres": THRESHOLD, "neg_thres": THRESHOLD, "cutoff_hz": CUTOFF_HZ}
    names = ("sigma_thres", "leak_rate_hz", "shot_noise_rate_hz", "refractory_us")
    values = (0.03, 0.1, 5.0, 500) if effects else (0.0, 0.0, 0.0, 0)
    return {**given, **dict(zip(names, values, strict=True)), "upsample": steps}


class JobError(Adv2eError):
    """A measurement failed; the message is one line."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One thing to measure.

    `action` is a function of :mod:`benchmarks.worker`, or ``module:function``, which also takes
    `options`.  Of the frames in the file `clip`, the first `frames` of every `stride`-th are taken;
    `fps` is the rate of the file's frames [Hz].  `python` is the interpreter, `package` the folder
    that holds the package ``adv2e``; `threads` of the tool are all cores by default.
    """

    name: str
    action: str = "simulate"
    options: dict[str, Any] = field(default_factory=dict)
    tool: str = "adv2e"
    clip: str = ""
    frames: int = 1 << 30
    stride: int = 1
    fps: float = 240.0
    python: str = sys.executable
    package: str = str(REPOSITORY)
    threads: int | None = None


@dataclass(frozen=True)
class Round:
    """Report of one process, and how busy the machine was with other things."""

    report: dict[str, Any]
    process_s: float
    others_cpus: float | None


@dataclass(eq=False)
class Measured:
    """All rounds of a job."""

    job: Job
    rounds: list[Round] = field(default_factory=list)

    @property
    def last(self) -> dict[str, Any]:
        """Report of the last process: counts and versions, which do not change."""
        return self.rounds[-1].report

    def wall_s(self) -> Spread:
        """Return the wall times [s]."""
        return Spread.of(r.report["wall_s"] for r in self.rounds)

    def cpu_s(self) -> Spread:
        """Return the processor times [s]."""
        return Spread.of(r.report["cpu_s"] for r in self.rounds)

    def ratio(self, other: Measured, part: str = "wall_s") -> Spread:
        """Return the ratio of times to those of `other`, paired by round."""
        pairs = zip(self.rounds, other.rounds, strict=True)
        return Spread.of(a.report[part] / b.report[part] for a, b in pairs)

    def peak_text(self) -> str:
        """Return the peak memory [MiB], the least of the rounds: others may have compiled."""
        peaks = [r.report["peak_mib"] for r in self.rounds if r.report.get("peak_mib")]
        return f"{min(peaks):.0f}" if peaks else "-"


@dataclass(frozen=True)
class Spread:
    """Median, least and most."""

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, values: Iterable[float]) -> Spread:
        """Return the spread of `values`."""
        found = sorted(values)
        return cls(statistics.median(found), found[0], found[-1])

    def inverse(self, scale: float = 1.0) -> Spread:
        """Return the spread of scale over the values."""
        return Spread(scale / self.median, scale / self.most, scale / self.least)

    def times(self, scale: float) -> Spread:
        """Return the spread of the values times `scale`, which is positive."""
        return Spread(self.median * scale, self.least * scale, self.most * scale)

    def __str__(self) -> str:
        if self.least == self.most:
            return number(self.median)
        return f"{number(self.median)} ({number(self.least)}..{number(self.most)})"


def number(value: float) -> str:
    """Return `value` with three digits or all of its whole ones."""
    if isinstance(value, int) or value == 0 or abs(value) >= 100:
        return f"{value:,.0f}"
    digits = 2 if abs(value) < 10 else 1
    return f"{value:.{digits}f}" if abs(value) >= 0.1 else f"{value:.2g}"


# --- rounds --------------------------------------------------------------------------------------


@dataclass
class Log:
    """Says what is going on, and keeps what failed."""

    tell: Callable[[str], None]
    failures: list[str] = field(default_factory=list)


def run_rounds(
    jobs: Sequence[Job], rounds: int, log: Log, *, warm: Sequence[Job] = ()
) -> list[Measured]:
    """Run every job once a round, each in a process of its own; the order turns with each round.

    A job that fails is left out, and noted in the log.  Those to `warm` up are run before,
    uncounted: what they compile is then in the cache, and the compiler's memory is not counted.
    """
    found = [Measured(job) for job in jobs]
    for job in warm:
        log.tell(f"warming up: {job.name}")
        run_job(job)
    for turn in range(rounds):
        shift = turn * len(found) // rounds
        for measured in found[shift:] + found[:shift]:
            try:
                measured.rounds.append(run_job(measured.job))
            except JobError as error:
                log.tell(f"failed: {error}")
                log.failures.append(str(error))
                found.remove(measured)
                continue
            wall = measured.last["wall_s"]
            log.tell(f"round {turn + 1} of {rounds}: {measured.job.name}: {wall:.3f} s")
    return found


_WORKER = (
    "import sys, runpy; sys.path[:] = filter(None, sys.path);"
    " runpy.run_module('benchmarks.worker', run_name='__main__')"
)
"""``python -m`` would look for packages in the working folder first, which may hold adv2e."""


def run_job(job: Job) -> Round:
    """Run `job` once, in a fresh process."""
    command = [job.python, "-c", _WORKER, json.dumps(asdict(job))]
    paths = [job.package, str(SCRIPTS)] if job.tool == "adv2e" else [str(SCRIPTS)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    if job.threads:
        names = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
        environment |= dict.fromkeys(names, str(job.threads))
    busy, own, began = _busy_s(), children_cpu_s(), time.perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    took = time.perf_counter() - began
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        raise JobError(f"{job.name}: {lines[-1]}")
    others = None
    if busy is not None:
        others = max(0.0, ((_busy_s() or busy) - busy - (children_cpu_s() - own)) / took)
    return Round(json.loads(done.stdout.splitlines()[-1]), took, others)


def _busy_s() -> float | None:
    """Return the processor time of everything on this machine [s]; None: not known."""
    try:
        first = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    except OSError:
        return None
    user, nice, system, _idle, _wait, irq, softirq = (int(n) for n in first[1:8])
    return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")


# --- what they ran on ----------------------------------------------------------------------------


def machine_line() -> str:
    """Return processor, cores, memory and system."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        named = (one.partition(":")[2].strip() for one in lines if one.startswith("model name"))
        processor = next(named, platform.machine())
        gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / (1 << 30)
        memory = f", {gib:.0f} GiB"
    except (AttributeError, OSError, ValueError):
        processor, memory = platform.processor() or platform.machine(), ""
    return (
        f"{processor}, {default_threads()} cores{memory}, {platform.system()}"
        f" {platform.machine()}, Python {platform.python_version()}"
    )


def about(measured: Sequence[Measured]) -> str:
    """Return what ran on what, and how busy the machine was with other things meanwhile."""
    versions = {
        f"{name} {version}"
        for one in measured
        for name, version in one.last.get("versions", {}).items()
        if name != "from"
    }
    lines = [machine_line(), ", ".join(sorted(versions, key=str.lower))]
    others = [r.others_cpus for one in measured for r in one.rounds if r.others_cpus is not None]
    if others:
        mean, most = sum(others) / len(others), max(others)
        lines.append(
            f"Other programs took {number(mean)} cores in the mean, {number(most)} at most"
        )
        if mean > 0.1:
            lines.append("The machine was not idle: do not quote")
    return " ".join(f"{line}." for line in lines if line)


# --- options -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plan:
    """How jobs are made: folder of the clips, length, threads, rounds."""

    folder: Path
    quick: bool
    threads: int | None
    rounds: int = 1

    def job(
        self, name: str, clip: Clip, sets: Sequence[str], config: str | None = None, **more: Any
    ) -> Job:
        """Return the job of a clip and of what is added to `config`; default: the ideal pixel."""
        files, base = ([config], ()) if config else ([], IDEAL)
        light = f"frames.encoding={clip.encoding}"
        options = {"files": files, "sets": [*base, light, *sets]}
        path = str(stored(clip, self.folder))
        return Job(
            name=name, clip=path, fps=clip.fps, options=options, threads=self.threads, **more
        )

    def warm(self) -> list[Job]:
        """Return short jobs that compile all there is."""
        clip = Clip(width=64, height=48, frames=8)
        pixels = {"every effect": EVERYTHING, "the exact circuit": ALL}
        return [self.job(name, clip, sets) for name, sets in pixels.items()]


def of_a_plan(rounds: int, quick_rounds: int) -> Callable[[Callable[..., None]], Any]:
    """Return a decorator that adds the options of a :class:`Plan`.

    The command is given `plan` and a `log`; what failed is told at its end.
    """
    usual_rounds = rounds

    def decorate(command: Callable[..., None]) -> Any:
        @click.option("--quick", is_flag=True, help="Short clips, fewer rounds; rough.")
        @click.option(
            "--rounds", type=click.IntRange(min=1), metavar="N",
            help=f"[default: {rounds}, with --quick {quick_rounds}]",
        )  # fmt: skip
        @threads_option
        @click.option(
            "--clips", "folder", type=click.Path(file_okay=False, path_type=Path),
            help="Folder that keeps the clips.  [default: adv2e-benchmarks in the user's cache]",
        )  # fmt: skip
        @wraps(command)
        def made(
            quick: bool, rounds: int | None, threads: int | None, folder: Path | None, **rest: Any
        ) -> None:
            log = Log(partial(click.echo, err=True))
            count = rounds or (quick_rounds if quick else usual_rounds)
            plan = Plan(folder or default_folder(), quick, threads, count)
            with one_line_errors():
                command(plan=plan, log=log, **rest)
            if log.failures:
                raise click.ClickException("; ".join(log.failures))

        return made

    return decorate
