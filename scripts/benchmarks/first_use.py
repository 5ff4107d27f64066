#!/usr/bin/env python
"""How long the first ``adv2e convert`` on a machine takes, and the next one.

The first compiles the pixel, and keeps the code in a cache.  Here that cache is a new folder each
time, so that nothing of yours is touched, and the clip is so short that all else takes no time::

    python scripts/benchmarks/first_use.py
    python scripts/benchmarks/first_use.py --config davis346 -o first_use.md
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import output_option, table, write_report

from benchmarks.clips import Clip, as_srgb, encoded, stored
from benchmarks.measure import Job, Log, Measured, Plan, about, number, of_a_plan, run_job


@click.command(help=__doc__)
@click.option("--config", default="adv2e", show_default=True, help="Configuration.")
@output_option
@of_a_plan(rounds=3, quick_rounds=1)
def main(plan: Plan, log: Log, config: str, output: Path | None) -> None:
    """Measure, and report."""
    clip = Clip(width=64, height=48, frames=8, fps=30.0)
    video = str(encoded(as_srgb(stored(clip, plan.folder)), clip.fps))
    names = ("first, empty cache", "second")
    found = {name: Measured(Job(name=name)) for name in names}
    for number_ in range(plan.rounds):
        with tempfile.TemporaryDirectory(prefix="adv2e-first-") as folder:
            target = str(Path(folder) / "out.h5")
            command = [sys.executable, "-m", "adv2e", "convert", video, "-o", target, "-c", config]
            command += ["--overwrite", "-q"]
            command += ["--threads", str(plan.threads)] if plan.threads else []
            for name, one in found.items():
                options = {
                    "command": command, "target": target,
                    "environment": {"NUMBA_CACHE_DIR": str(Path(folder) / "cache")},
                }  # fmt: skip
                job = Job(name=name, action="run_command", options=options)
                one.rounds.append(run_job(job))
                log.tell(f"round {number_ + 1}: {name}: {one.last['wall_s']:.1f} s")
    rows = [
        [name, str(one.wall_s()), number(one.cpu_s().median), one.peak_text()]
        for name, one in found.items()
    ]
    head = (f"`adv2e convert -c {config}`", "wall s", "CPU s", "peak MiB")
    measured = list(found.values())
    text = f"# First use\n\n{about(measured)}\n\n{table(head, rows)}"
    write_report(text, output, [asdict(one) for one in measured])


if __name__ == "__main__":
    main()
