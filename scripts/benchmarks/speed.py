#!/usr/bin/env python
"""How fast adv2e is, how exact, and how other tools do on the same frames.

Makes its own clips, and runs every measurement in a process of its own, in interleaved rounds::

    python scripts/benchmarks/speed.py --quick
    python scripts/benchmarks/speed.py --peer-python other/bin/python -o out/benchmark.md

Writes Markdown to standard output and with ``-o FILE.md`` also to that file, with the raw numbers
in ``FILE.json`` and the figure of accuracy against cost in ``FILE.png``.  ``--peer-python`` names a
Python in which ``eventcv``, ``evlib`` (with PyTorch) or what v2e needs is installed; what is not
there is left out, and said so.
"""

from __future__ import annotations

import fnmatch
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import load_pyplot, output_option, write_report

from benchmarks.end_to_end import end_to_end, end_to_end_report
from benchmarks.figures import draw_frontier
from benchmarks.frontier import Point, frontier
from benchmarks.machine import about, machine_line
from benchmarks.options import of_a_plan
from benchmarks.processes import Job, JobError, Log, Measured, run_rounds
from benchmarks.report import frontier_table, speed_tables
from benchmarks.settings import Peers, Plan

PROBES = {"eventcv": "import eventcv", "evlib": "import evlib, torch"}
"""What must work in the peers' Python for a tool to take part."""


@dataclass
class Results:
    """What was measured, part by part."""

    speed: list[Measured] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)
    files: list[Measured] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def measured(self) -> list[Measured]:
        """Return every measurement."""
        return [*self.speed, *(point.measured for point in self.points), *self.files]

    def markdown(self) -> str:
        """Return the whole report."""
        every = self.measured()
        parts = ["# Benchmark", about(every), *self.notes]
        if self.speed:
            parts += ["## Speed", speed_tables(self.speed)]
        if self.points:
            parts += ["## Accuracy against cost", frontier_table(self.points)]
        if self.files:
            parts += ["## File to file", end_to_end_report(self.files)]
        return "\n\n".join(parts)

    def raw(self) -> dict[str, Any]:
        """Return all numbers, for JSON."""
        return {
            "machine": machine_line(),
            "speed": [one.as_dict() for one in self.speed],
            "frontier": [{**p.as_dict(), **p.measured.as_dict()} for p in self.points],
            "files": [one.as_dict() for one in self.files],
            "notes": self.notes,
        }


@click.command()
@of_a_plan(rounds=3, quick_rounds=1)
@click.option("--only", default="*", metavar="GLOB", help="Only settings of such names (speed).")
@click.option("--speed/--no-speed", default=True, show_default=True)
@click.option("--frontier/--no-frontier", "accuracy", default=True, show_default=True)
@click.option("--end-to-end/--no-end-to-end", "files", help="Also MP4 to files.  [default: no]")
@click.option(
    "--peer-python",
    type=click.Path(exists=True, dir_okay=False),
    help="Python with other tools.  [default: this one]",
)
@click.option(
    "--v2e",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder with the sources of v2e, for the peers' Python.",
)
@output_option
def main(
    plan: Plan,
    log: Log,
    only: str,
    speed: bool,
    accuracy: bool,
    files: bool,
    peer_python: str | None,
    v2e: Path | None,
    output: Path | None,
) -> None:
    """Measure the speed of adv2e and of other tools, and what exactness costs."""
    if accuracy and output:
        load_pyplot()  # before the work, so that a missing package costs no time
    results = Results()
    peers = find_peers(peer_python or sys.executable, v2e, results.notes)
    if speed:
        jobs = chosen_jobs(plan, peers, only)
        results.speed = run_rounds(jobs, plan.rounds, log, warm=plan.warm())
    with tempfile.TemporaryDirectory(prefix="adv2e-benchmark-") as scratch:
        if accuracy:
            results.points = frontier(plan, peers, Path(scratch), log)
        if files:
            results.files = end_to_end(plan, peers, Path(scratch), results.notes, log)
    results.notes += [f"Failed: {failure}." for failure in log.failures]
    write_report(results.markdown(), output, results.raw())
    if output and results.points:
        draw_frontier(results.points, output.with_suffix(".png"))


def find_peers(python: str, v2e: Path | None, notes: list[str]) -> Peers:
    """Return which tools work in the peers' Python; note those that do not."""
    probes = {
        **PROBES,
        "v2e": f"import sys; sys.path.insert(0, {str(v2e)!r}); import v2ecore.emulator",
    }
    if v2e is None:
        del probes["v2e"]
    found = []
    for name, probe in probes.items():
        done = subprocess.run([python, "-c", probe], capture_output=True, text=True, check=False)
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["it does not start"])[-1]
            notes.append(f"{name} took no part: {reason}.")
        else:
            found.append(name)
    return Peers(python, tuple(found), v2e if "v2e" in found else None)


def chosen_jobs(plan: Plan, peers: Peers, only: str) -> list[Job]:
    """Return the jobs whose names fit; those of a clip stay together, its first one first.

    Raises
    ------
    JobError
        None does.
    """
    jobs = [*plan.jobs(), *plan.peer_jobs(peers)]
    clips = {job.name.partition(": ")[0]: None for job in jobs}
    ordered = [job for clip in clips for job in jobs if job.name.startswith(f"{clip}: ")]
    chosen = [job for job in ordered if fnmatch.fnmatch(job.name, only)]
    if not chosen:
        raise JobError(f"--only {only}: no setting has such a name; names are 'clip: setting'")
    return chosen


if __name__ == "__main__":
    main()
