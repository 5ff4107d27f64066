#!/usr/bin/env python
"""What this machine can do: memory, exponentials, sorting, event text, HDF5.

Puts the figures of the benchmarks in proportion: how far the pixel is from what memory and
arithmetic allow, and the writers from what formatting and compression allow::

    python scripts/benchmarks/limits.py [--quick] [--threads N]

Each figure is the best and the median of many short runs in this process.
"""

from __future__ import annotations

import math
import statistics
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import h5py
import numba
import numpy as np
from numpy.typing import NDArray
from writing import table

from adv2e.background import default_threads
from adv2e.events import Events, make_events, sort_events
from adv2e.formats.text.writer import text_blocks
from adv2e.formats.writing import open_sink
from benchmarks.machine import machine_line
from benchmarks.processes import number

_compiled: Any = numba.njit(nogil=True, error_model="numpy", fastmath={"contract"})

_DEGREE = 6
_C = np.polynomial.Chebyshev.interpolate(np.exp, _DEGREE, domain=[-1, 0]).convert(
    kind=np.polynomial.Polynomial
)


@_compiled
def triad(a: Any, b: Any, c: Any, scale: Any) -> None:
    """Write b + scale c to a."""
    for i in range(a.shape[0]):
        a[i] = b[i] + scale * c[i]


@_compiled
def exp_library(x: Any, y: Any) -> None:
    """Write exp(x) to y."""
    for i in range(x.shape[0]):
        y[i] = math.exp(x[i])


def _polynomial(coefficients: tuple[Any, ...]) -> Any:
    c0, c1, c2, c3, c4, c5, c6 = coefficients

    @_compiled
    def polynomial(x: Any, y: Any) -> None:
        for i in range(x.shape[0]):
            z = x[i]
            y[i] = c0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * (c5 + z * c6)))))

    return polynomial


exp_polynomial32, exp_polynomial64 = (
    _polynomial(tuple(kind(c) for c in _C.coef)) for kind in (np.float32, float)
)
"""Write exp(x) to y for x in [-1, 0]: a polynomial of degree 6, in the precision of its numbers."""


@dataclass(frozen=True)
class Limit:
    """A figure: what, with how many threads, how much a second (best and median), its unit."""

    what: str
    threads: int
    best: float
    median: float
    unit: str
    note: str = ""


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    megabytes: int
    events: int
    repeats: int
    threads: int


@click.command()
@click.option("--quick", is_flag=True, help="Smaller and fewer runs: a few seconds.")
@click.option("--threads", type=click.IntRange(min=1), help="[default: all cores]")
def main(quick: bool, threads: int | None) -> None:
    """Print what this machine can do, as a table."""
    threads = threads or default_threads()
    effort = Effort(64, 300_000, 3, threads) if quick else Effort(256, 2_000_000, 15, threads)
    click.echo(f"{machine_line()}, numba {numba.__version__}, numpy {np.__version__}\n")
    click.echo(report([*memory(effort), *exponentials(effort), *events_written(effort)]))


def report(limits: list[Limit]) -> str:
    """Return the table."""
    header = ("what", "threads", "best", "median", "unit", "note")
    rows = [
        [one.what, str(one.threads), number(one.best), number(one.median), one.unit, one.note]
        for one in limits
    ]
    return table(header, rows)


def timed(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Return the least and the median time of `work` [s], after one run that does not count."""
    work()
    found = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found), statistics.median(found)


def rate(
    what: str, amount: float, unit: str, effort: Effort, tasks: Sequence[Callable[[], object]],
    note: str = "",
) -> Limit:  # fmt: skip
    """Return how much a second is done when each of `tasks`, in a thread of its own, runs."""
    if len(tasks) == 1:
        best, median = timed(tasks[0], effort.repeats)
    else:
        with ThreadPoolExecutor(len(tasks)) as pool:
            best, median = timed(
                lambda: [f.result() for f in [pool.submit(task) for task in tasks]], effort.repeats
            )
    return Limit(what, len(tasks), amount / best, amount / median, unit, note)


def _counts(effort: Effort) -> list[int]:
    return sorted({1, effort.threads})


def _split(arrays: list[NDArray[Any]], parts: int) -> list[list[NDArray[Any]]]:
    return [list(part) for part in zip(*(np.array_split(a, parts) for a in arrays), strict=True)]


def memory(effort: Effort) -> Iterator[Limit]:
    """Yield bandwidths [GB/s], counting each byte read and each written once."""
    size = effort.megabytes << 18  # float32 numbers
    a, b, c = (np.full(size, k, np.float32) for k in range(3))
    copied = 2e-9 * a.nbytes
    yield rate("copy by NumPy, from memory", copied, "GB/s", effort, [lambda: np.copyto(a, b)])
    scale = np.float32(3)
    for threads in _counts(effort):
        tasks = [partial(triad, *part, scale) for part in _split([a, b, c], threads)]
        moved = 3e-9 * a.nbytes
        yield rate("triad a = b + s c, from memory", moved, "GB/s", effort, tasks)
    small = [np.full(1 << 15, k, np.float32) for k in range(3)]  # 384 KiB in all
    often = 200

    def in_cache() -> None:
        for _ in range(often):
            triad(*small, scale)

    moved = 3e-9 * small[0].nbytes * often
    yield rate("the same in the second-level cache", moved, "GB/s", effort, [in_cache])


def exponentials(effort: Effort) -> Iterator[Limit]:
    """Yield how many exponentials of numbers in [-1, 0] are had [G/s], in cache."""
    often = 100
    kinds = {
        "exp of the library": (exp_library, exp_library),
        "polynomial of degree 6": (exp_polynomial32, exp_polynomial64),
    }
    for what, functions in kinds.items():
        for function, kind in zip(functions, (np.float32, np.float64), strict=True):
            x = np.linspace(-1, 0, 1 << 13).astype(kind)
            y = np.empty_like(x)
            function(x, y)
            worst = float(np.max(np.abs(y / np.exp(x.astype(np.float64)) - 1)))

            def work(function: Any = function, x: Any = x) -> None:
                out = np.empty_like(x)
                for _ in range(often):
                    function(x, out)

            for threads in _counts(effort):
                amount = 1e-9 * x.size * often * threads
                name = f"{what}, {np.dtype(kind).name}"
                note = f"relative error up to {worst:.1e}"
                yield rate(name, amount, "G/s", effort, [work] * threads, note)


def sample_events(count: int) -> Events:
    """Return sorted events of a 346x260 camera, some 2 million a second."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, max(1, count // 2), count))
    x, y, p = (rng.integers(0, top, count) for top in (346, 260, 2))
    return sort_events(make_events(t, x, y, p))


def events_written(effort: Effort) -> Iterator[Limit]:
    """Yield how fast events are sorted, turned to text and written [M events/s]."""
    events = sample_events(effort.events)
    millions = events.size / 1e6
    keys = events["t"] * (1 << 20) + events["y"].astype(np.int64) * 1024 + events["x"]
    shuffled = np.random.default_rng(1).permutation(keys)
    yield rate(
        "sort of 64-bit keys by NumPy", millions, "Mev/s", effort, [lambda: np.sort(shuffled)]
    )
    text = f"{_as_text(events) / events.size:.1f} bytes an event"
    yield rate(
        "event text, in memory", millions, "Mev/s", effort, [partial(_as_text, events)], text
    )
    columns = [np.ascontiguousarray(events[name]) for name in ("t", "x", "y", "p")]
    raw = columns[0].astype(np.float64).tobytes()
    yield rate("zlib level 1 of float64 times", len(raw) / 1e6, "MB/s", effort,
               [lambda: zlib.compress(raw, 1)])  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="adv2e-limits-") as folder:
        for name, options in _HDF5.items():
            path = Path(folder) / "h5py.h5"
            task = partial(_write_h5, path, columns, options)
            limit = rate(f"HDF5 by h5py, {name}", millions, "Mev/s", effort, [task])
            yield replace(limit, note=_bytes_an_event(path, events))
        for suffix in (".txt", ".h5"):
            path = Path(folder) / f"adv2e{suffix}"
            put = partial(_write_adv2e, path, events, effort.threads)
            limit = rate(f"adv2e's {suffix} file", millions, "Mev/s", effort, [put])
            note = _bytes_an_event(path, events)
            yield replace(limit, threads=effort.threads, note=note)


def _as_text(events: Events) -> int:
    return sum(len(block) for block in text_blocks(events))


_HDF5: dict[str, dict[str, Any]] = {
    "no compression": {},
    "shuffle, deflate 1": {"compression": "gzip", "compression_opts": 1, "shuffle": True},
    "shuffle, deflate 4": {"compression": "gzip", "compression_opts": 4, "shuffle": True},
}


def _bytes_an_event(path: Path, events: Events) -> str:
    return f"{path.stat().st_size / events.size:.1f} bytes an event"


def _write_h5(path: Path, columns: list[NDArray[Any]], options: dict[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, column in zip("txyp", columns, strict=True):
            file.create_dataset(name, data=column, chunks=(min(1 << 16, column.size),), **options)


def _write_adv2e(path: Path, events: Events, threads: int) -> None:
    with open_sink(
        path, width=346, height=260, metadata={}, overwrite=True, threads=threads
    ) as sink:
        sink.write_events(events)


if __name__ == "__main__":
    main()
