"""Measurements in fresh processes, in interleaved rounds, so that a busy minute hits all alike."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from adv2e.errors import Adv2eError
from benchmarks.measuring import children_cpu_s

SCRIPTS = Path(__file__).resolve().parents[1]
REPOSITORY = SCRIPTS.parent

SIMULATE = "benchmarks.worker:simulate"
"""The action that most jobs run."""


class JobError(Adv2eError):
    """A measurement failed; the message is one line."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One thing to measure.

    Attributes
    ----------
    name : str
        What tables call it.
    tool : str
        Module of :mod:`benchmarks.tools`.
    options : dict
        What that module's ``simulator`` takes.
    clip : str
        ``.npy`` file of the frames.
    frames, stride, fps : int, int, float
        The first `frames` of every `stride`-th; rate of the file's frames [Hz].
    python : str
        Interpreter.
    package : str, optional
        Folder that holds the package ``adv2e`` to use; default: this repository.
    threads : int, optional
        Threads of the tool; default: all cores.
    probe : dict, optional
        ``pixels`` (flat indices) whose events are stored at ``path`` (``.npz``).
    digest : bool
        Say which events came out, as a digest.
    action : str
        Function of the job's dict that does it, ``module:name``.
    """

    name: str
    tool: str = "adv2e"
    options: dict[str, Any] = field(default_factory=dict)
    clip: str = ""
    frames: int = 1 << 30
    stride: int = 1
    fps: float = 240.0
    python: str = sys.executable
    package: str = str(REPOSITORY)
    threads: int | None = None
    probe: dict[str, Any] | None = None
    digest: bool = False
    action: str = SIMULATE


@dataclass(frozen=True)
class Round:
    """What one process reported, and how busy the machine was with other things."""

    report: dict[str, Any]
    process_s: float
    others_cpus: float | None

    @property
    def wall_s(self) -> float:
        """Wall time of what was measured [s]."""
        return float(self.report["wall_s"])

    @property
    def cpu_s(self) -> float:
        """Processor time of what was measured [s]."""
        return float(self.report["cpu_s"])


@dataclass(eq=False)
class Measured:
    """All rounds of a job."""

    job: Job
    rounds: list[Round] = field(default_factory=list)

    @property
    def last(self) -> dict[str, Any]:
        """What the last process reported: counts and versions, which do not change."""
        return self.rounds[-1].report

    def wall_s(self) -> Spread:
        """Return the wall times [s]."""
        return Spread.of(r.wall_s for r in self.rounds)

    def cpu_s(self) -> Spread:
        """Return the processor times [s]."""
        return Spread.of(r.cpu_s for r in self.rounds)

    def ratio(self, other: Measured, part: str = "wall_s") -> Spread:
        """Return the ratio of times to those of `other`, paired by round."""
        pairs = zip(self.rounds, other.rounds, strict=True)
        return Spread.of(getattr(a, part) / getattr(b, part) for a, b in pairs)

    def as_dict(self) -> dict[str, Any]:
        """Return everything, for JSON; of a probe only the path."""
        job = asdict(self.job)
        if self.job.probe:
            job["probe"] = {**self.job.probe, "pixels": len(self.job.probe["pixels"])}
        return {"job": job, "rounds": [asdict(r) for r in self.rounds]}


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


@dataclass
class Log:
    """Says what is going on, and keeps what failed."""

    tell: Callable[[str], None]
    failures: list[str] = field(default_factory=list)


def run_rounds(
    jobs: Sequence[Job], rounds: int, log: Log, *, warm: Sequence[Job] = ()
) -> list[Measured]:
    """Run every job once a round, each in a process of its own; the order turns with each round.

    A job that fails is left out, and noted in the log.

    Parameters
    ----------
    jobs : sequence of Job
    rounds : int
    log : Log
    warm : sequence of Job
        Run before, uncounted: what they compile is then in the cache, and the compiler's memory is
        not counted.

    Raises
    ------
    JobError
        Warming up failed.
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
            wall = measured.rounds[-1].wall_s
            log.tell(f"round {turn + 1} of {rounds}: {measured.job.name}: {wall:.3f} s")
    return found


_WORKER = (
    "import sys, runpy; sys.path[:] = filter(None, sys.path);"
    " runpy.run_module('benchmarks.worker', run_name='__main__')"
)
"""``python -m`` would look for packages in the working folder first, which may hold adv2e."""


def run_job(job: Job) -> Round:
    """Run `job` once, in a fresh process.

    Raises
    ------
    JobError
        It failed; the message is the last line that it wrote.
    """
    command = [job.python, "-c", _WORKER, json.dumps(asdict(job))]
    busy, own, began = _busy_s(), children_cpu_s(), time.perf_counter()
    done = subprocess.run(
        command, env=_environment(job), capture_output=True, text=True, check=False
    )
    took = time.perf_counter() - began
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        raise JobError(f"{job.name}: {lines[-1]}")
    others = None
    if busy is not None:
        others = max(0.0, ((_busy_s() or busy) - busy - (children_cpu_s() - own)) / took)
    return Round(json.loads(done.stdout.splitlines()[-1]), took, others)


def _environment(job: Job) -> dict[str, str]:
    paths = [str(SCRIPTS)]
    if job.tool == "adv2e":
        paths.insert(0, job.package)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    if job.threads:
        for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
            environment[name] = str(job.threads)
    return environment


def _busy_s() -> float | None:
    """Return the processor time of everything on this machine [s]; None: not known."""
    try:
        first = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    except OSError:
        return None
    user, nice, system, _idle, _wait, irq, softirq = (int(n) for n in first[1:8])
    return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")
