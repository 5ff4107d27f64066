#!/usr/bin/env python
"""Where the time goes that compiling the pixel takes: by pass of Numba, and by function.

Converts three small frames with a configuration, on a cache of compiled code that is empty, in this
process alone::

    python scripts/dev/compile_times.py
    python scripts/dev/compile_times.py --config davis346 -o davis346.md

A function's time is without that of the functions it calls, though LLVM optimises their code with
it once more.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from writing import one_line_errors, output_option, table, write_report

ROWS = 12
"""Rows of each table."""


@click.command(help=__doc__)
@click.option("--config", default="adv2e", show_default=True, help="Configuration.")
@output_option
@one_line_errors()
def main(config: str, output: Path | None) -> None:
    """Measure, and report."""
    with tempfile.TemporaryDirectory(prefix="adv2e-compile-") as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder  # before Numba is imported
        passes, functions = measured(config)
    total = sum(passes.values())
    parts = [
        f"# Compiling `{config}`",
        f"{total:.1f} s of processor time, {len(functions)} functions.",
        rows_of("pass", passes, total),
        rows_of("function", functions, total),
    ]
    write_report("\n\n".join(parts), output, {"passes": passes, "functions": functions})


def measured(config: str) -> tuple[Counter[str], Counter[str]]:
    """Return the processor time [s] of each pass, and of each function."""
    from numba.core import event  # noqa: PLC0415

    import adv2e  # noqa: PLC0415

    watch = Watch()
    # the listener's class is Numba's, which must not be imported before the cache is chosen
    listener = type("_Listener", (event.Listener,), {
        "on_start": lambda _, one: watch.begin(one), "on_end": lambda _, one: watch.end(one),
    })()  # fmt: skip
    if hasattr(os, "sched_setaffinity"):  # with a second core, a second process would compile, too
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    for kind in ("numba:compile", "numba:run_pass"):
        event.register(kind, listener)
    frames = [np.full((8, 8), grey, np.uint8) for grey in (60, 100, 140)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", adv2e.Adv2eWarning)  # how the frames are understood
        for _ in adv2e.simulate(frames, fps=100.0, config=config, threads=1):
            pass
    return watch.passes, watch.functions


class Watch:
    """Adds up the time of what begins and ends, less that of what does so within it."""

    def __init__(self) -> None:
        self.passes: Counter[str] = Counter()
        self.functions: Counter[str] = Counter()
        self._open: dict[str, list[list[float]]] = {"numba:compile": [], "numba:run_pass": []}

    def begin(self, one: object) -> None:
        """Take note of an event of Numba's that begins."""
        self._open[one.kind].append([time.thread_time(), 0.0])  # type: ignore[attr-defined]

    def end(self, one: object) -> None:
        """Add the time of one that ends."""
        kind, data = one.kind, one.data  # type: ignore[attr-defined]
        began, inner = self._open[kind].pop()
        spent = time.thread_time() - began
        if self._open[kind]:
            self._open[kind][-1][1] += spent
        if kind == "numba:run_pass":
            self.passes[data["name"].split()[0]] += spent - inner
        else:
            function = data["dispatcher"].py_func
            module = function.__module__.removeprefix("adv2e.kernel.")
            self.functions[f"{module}.{function.__name__}"] += spent - inner


def rows_of(what: str, spent: Counter[str], total: float) -> str:
    """Return the table of the largest."""
    rows = [
        [f"`{name}`", f"{s:.2f}", f"{100 * s / total:.0f}"] for name, s in spent.most_common(ROWS)
    ]
    return table((what, "s", "% of all"), rows)


if __name__ == "__main__":
    main()
