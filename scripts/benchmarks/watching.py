"""What the memory benchmark runs, and what it sees of a running conversion."""

from __future__ import annotations

import io
import math
import os
import re
import subprocess
import time
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.measuring import measured, peak_mib
from benchmarks.processes import JobError


def convert(spec: dict[str, Any]) -> dict[str, Any]:
    """Run ``adv2e convert`` in this process; return its cost, peak memory and events.

    Raises
    ------
    RuntimeError
        It failed; it has said why on standard error.
    """
    from adv2e.cli import main  # noqa: PLC0415 - in the process that is measured

    printed = io.StringIO()

    def run() -> Any:
        try:
            with redirect_stdout(printed):
                main(spec["options"]["arguments"])
        except SystemExit as end:
            return end.code
        return 0

    status, cost = measured(run)
    if status:
        raise RuntimeError(f"exit status {status}")
    return {**cost.as_dict(), "peak_mib": peak_mib(), "events": count_in(printed.getvalue())}


def count_in(summary: str) -> int:
    """Return the number of events that the summary of a conversion tells.

    Raises
    ------
    RuntimeError
        It tells none.
    """
    found = re.search(r": ([\d,]+) events ", summary)
    if found is None:
        raise RuntimeError(f"no number of events in {summary!r}")
    return int(found[1].replace(",", ""))


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
