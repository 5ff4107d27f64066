#!/usr/bin/env python
"""How long the first ``adv2e convert`` on a machine takes, with each configuration, and the next.

The first compiles the pixel, and keeps the code in a cache.  Here that cache is a new folder in
each round, so that nothing of yours is touched, and the clip is so short that all else takes no
time.  All configurations share the cache, the default first: what a later one still compiles is
what the earlier ones do without.  Then each converts once more::

    python scripts/benchmarks/first_use.py
    python scripts/benchmarks/first_use.py --config davis346 --config ideal -o first_use.md

Those whose numbers are drawn (``train-...``) convert by ``adv2e batch``, as they are meant to.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import output_option, table, write_report

from adv2e.config import load_family, shipped
from benchmarks.clips import Clip, as_srgb, encoded
from benchmarks.measure import Job, Log, Measured, Plan, about, number, of_a_plan, run_job


@click.command(help=__doc__)
@click.option(
    "--config", "configs", multiple=True, metavar="NAME",
    help="Only this configuration; repeatable.  [default: all shipped ones, the default first]",
)  # fmt: skip
@output_option
@of_a_plan(rounds=3, quick_rounds=1)
def main(plan: Plan, log: Log, configs: tuple[str, ...], output: Path | None) -> None:
    """Measure, and report."""
    clip = Clip(width=64, height=48, frames=8, fps=30.0)
    video = encoded(as_srgb(clip, plan.folder), clip.fps)
    names = configs or sorted(shipped(), key=lambda name: (name != "adv2e", name))
    found = {
        (name, use): Measured(Job(name=f"{name}: {use}"))
        for use in ("first", "second")
        for name in names
    }
    for round_ in range(plan.rounds):
        with tempfile.TemporaryDirectory(prefix="adv2e-first-") as folder:
            (Path(folder) / "clips").mkdir()
            copy = shutil.copy(video, Path(folder) / "clips" / "clip.mp4")
            for (name, use), one in found.items():
                one.rounds.append(run_job(job_of(name, use, Path(copy), plan.threads)))
                log.tell(f"round {round_ + 1}: {one.job.name}: {one.last['wall_s']:.1f} s")
    rows = []
    for name in names:
        first, second = found[name, "first"], found[name, "second"]
        rows.append([
            name, str(first.wall_s()), number(first.cpu_s().median), str(second.wall_s()),
            number(second.cpu_s().median), first.peak_text(), second.peak_text(),
        ])  # fmt: skip
    head = (
        "configuration", "first: wall s", "CPU s", "second: wall s", "CPU s", "first: peak MiB",
        "second: peak MiB",
    )  # fmt: skip
    measured = list(found.values())
    note = "First uses in this order, all on one cache that was empty; then second ones."
    text = f"# First use\n\n{about(measured)}\n\n{note}\n\n{table(head, rows)}"
    write_report(text, output, [asdict(one) for one in measured])


def job_of(config: str, use: str, video: Path, threads: int | None) -> Job:
    """Return the conversion of the only video in a folder, with output and cache beside that."""
    folder = video.parents[1]
    target = str(folder / f"{Path(config).stem}-{use}")
    if load_family(config).forms:  # drawn for each sequence
        words = ["batch", str(video.parent), target]
    else:
        target += ".h5"
        words = ["convert", str(video), "-o", target]
    command = [sys.executable, "-m", "adv2e", *words, "-c", config, "-q"]
    if threads:
        command += ["--threads", str(threads)]
    environment = {"NUMBA_CACHE_DIR": str(folder / "cache")}
    options = {"command": command, "target": target, "environment": environment}
    return Job(name=f"{config}: {use}", action="run_command", options=options)


if __name__ == "__main__":
    main()
