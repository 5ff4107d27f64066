#!/usr/bin/env python
"""How two commits compare in speed, and whether they make the same events.

Takes the package of each commit out of git into a temporary folder (nothing in the repository
changes) and runs the same timings with both, in fresh processes and interleaved rounds::

    python scripts/dev/compare_commits.py HEAD~1 HEAD
    python scripts/dev/compare_commits.py main . --setting '346x260: *' --rounds 9

``.`` stands for the working tree as it is.  The compiled code of each is kept by a digest of its
sources, so each is compiled once.
"""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from benchmarks.measure import (
    REPOSITORY,
    Job,
    JobError,
    Log,
    Measured,
    Plan,
    about,
    of_a_plan,
    run_rounds,
)  # fmt: skip
from benchmarks.speed import OFF_NAME, chosen, setting_jobs
from writing import output_option, table, write_report

USUAL = (f"346x260: {OFF_NAME}", "346x260: all effects, shot 5 Hz")
"""Settings compared unless others are named."""


@click.command()
@click.argument("before")
@click.argument("after")
@click.option(
    "--setting", "globs", multiple=True, metavar="GLOB",
    help="Settings of benchmarks/speed.py by name; repeatable.  [default: noise off and all"
    " effects]",
)  # fmt: skip
@of_a_plan(rounds=7, quick_rounds=7)
@output_option
def main(
    before: str, after: str, globs: tuple[str, ...], plan: Plan, log: Log, output: Path | None
) -> None:
    """Compare commit BEFORE with commit AFTER."""
    with tempfile.TemporaryDirectory(prefix="adv2e-commits-") as scratch:
        packages = [
            checked_out(name, Path(scratch) / side)
            for name, side in ((before, "before"), (after, "after"))
        ]
        jobs = pairs_of_jobs(plan, globs or USUAL, packages)
        warm = [replace(job, package=str(p)) for job in plan.warm() for p in packages]
        found = run_rounds(jobs, plan.rounds, log, warm=warm)
    write_report(report(found, before, after), output)


def checked_out(commit: str, folder: Path, repository: Path = REPOSITORY) -> Path:
    """Return a folder with the package as of `commit`; ``.``: the working tree itself."""
    if commit == ".":
        return repository
    command = ["git", "-C", str(repository), "archive", "--format=tar", commit, "adv2e", "configs"]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines() or ["git archive failed"]
        raise JobError(f"{commit}: {lines[-1]}")
    with tarfile.open(fileobj=BytesIO(done.stdout)) as archive:
        if hasattr(tarfile, "data_filter"):
            archive.extractall(folder, filter="data")
        else:  # Python before 3.10.12; the archive is git's own
            archive.extractall(folder)
    return folder


def pairs_of_jobs(plan: Plan, globs: Sequence[str], packages: Sequence[Path]) -> list[Job]:
    """Return each chosen job once for each package, next to each other."""
    jobs = chosen(list(setting_jobs(plan)), globs, "--setting")
    return [replace(job, package=str(p)) for job in jobs for p in packages]


def report(found: Sequence[Measured], before: str, after: str) -> str:
    """Return the table: a row for each setting that both could run."""
    header = (
        "setting", f"{before}: s", f"{after}: s", "time, after / before", "CPU, after / before",
        "events",
    )  # fmt: skip
    rows = [_row(a, b) for a, b in pairs(found)]
    note = "Medians (least..most); ratios are paired by round: below 1, AFTER is faster."
    return "\n\n".join([about(found), note, table(header, rows)])


def pairs(found: Sequence[Measured]) -> list[tuple[Measured, Measured]]:
    """Return the measurements before and after of each setting that has both."""
    named: dict[str, list[Measured]] = {}
    for one in found:
        named.setdefault(one.job.name, []).append(one)
    return [(both[0], both[1]) for both in named.values() if len(both) == 2]


def _row(a: Measured, b: Measured) -> list[str]:
    same = a.last["digest"] == b.last["digest"]
    counts = f"{a.last['events']:,} / {b.last['events']:,}"
    times = a.wall_s(), b.wall_s(), b.ratio(a), b.ratio(a, "cpu_s")
    return [a.job.name, *map(str, times), "identical" if same else f"DIFFERENT: {counts}"]


if __name__ == "__main__":
    main()
