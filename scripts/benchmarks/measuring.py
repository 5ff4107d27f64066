"""Time, processor time and memory of a piece of work in this process (standard library only)."""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

try:
    resource: Any = importlib.import_module("resource")
except ImportError:  # Windows
    resource = None

Value = TypeVar("Value")


@dataclass(frozen=True)
class Cost:
    """What a piece of work took: wall time [s], processor time of all threads [s]."""

    wall_s: float
    cpu_s: float

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON."""
        return asdict(self)


def measured(work: Callable[[], Value]) -> tuple[Value, Cost]:
    """Return what `work` returns, and what it took."""
    wall, cpu = time.perf_counter(), time.process_time()
    value = work()
    return value, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def peak_mib() -> float | None:
    """Return the most memory this process has held [MiB]; None: not known."""
    try:
        # not ru_maxrss: Linux lets it begin with what the parent held when it started this process
        status = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) / 1024
    except (OSError, StopIteration):
        return _as_mib(resource.RUSAGE_SELF) if resource else None


def children_peak_mib() -> float | None:
    """Return the most memory that any child process held [MiB]; None: not known.

    No less than what this process held when it started the child, see :func:`peak_mib`.
    """
    return _as_mib(resource.RUSAGE_CHILDREN) if resource else None


def _as_mib(who: int) -> float:
    peak = resource.getrusage(who).ru_maxrss
    return float(peak) / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def children_cpu_s() -> float:
    """Return the processor time of all child processes that have ended [s]."""
    if resource is None:
        return 0.0
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return float(usage.ru_utime + usage.ru_stime)
