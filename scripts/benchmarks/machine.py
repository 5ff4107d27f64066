"""What the benchmarks ran on, in a line."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from pathlib import Path

from adv2e.background import default_threads
from benchmarks.processes import Measured, number


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())


def memory_gib() -> float | None:
    """Return the size of the memory [GiB]; None: not known."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / (1 << 30)
    except (AttributeError, OSError, ValueError):
        return None


def machine_line() -> str:
    """Return processor, cores, memory and system."""
    memory = memory_gib()
    parts = [processor(), f"{default_threads()} cores", f"{memory:.0f} GiB" if memory else ""]
    parts += [f"{platform.system()} {platform.machine()}", f"Python {platform.python_version()}"]
    return ", ".join(part for part in parts if part)


def versions_line(measured: Iterable[Measured]) -> str:
    """Return the versions of all that ran, each once."""
    found: dict[str, str] = {}
    for one in measured:
        for name, version in one.last.get("versions", {}).items():
            if name != "from":
                found.setdefault(f"{name} {version}", "")
    return ", ".join(sorted(found, key=str.lower))


def busy_line(measured: Iterable[Measured]) -> str:
    """Return how busy the machine was with other things meanwhile."""
    others = [r.others_cpus for one in measured for r in one.rounds if r.others_cpus is not None]
    if not others:
        return "What else ran on the machine is not known."
    mean, most = sum(others) / len(others), max(others)
    warning = " The machine was not idle: do not quote." if mean > 0.1 else ""
    return f"Other programs took {number(mean)} cores in the mean, {number(most)} at most.{warning}"


def about(measured: Sequence[Measured]) -> str:
    """Return what ran on what, and how busy it was."""
    lines = (machine_line(), versions_line(measured), busy_line(measured))
    return " ".join(f"{line.rstrip('.')}." for line in lines if line)
