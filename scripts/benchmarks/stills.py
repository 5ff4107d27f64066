#!/usr/bin/env python
"""How many still pictures a core turns into events in an hour.

Makes pictures of 500x375 in folders of classes, and moves a sensor of 240x180 before each in three
saccades, by one ``adv2e batch`` whose one process does all of them::

    python scripts/benchmarks/stills.py -o out/stills.md
    python scripts/benchmarks/stills.py --stills 20 -c davis346

Prints a table; ``-o FILE.md`` also writes it, with the raw numbers in ``FILE.json``.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from writing import one_line_errors, output_option, table, write_report

from adv2e.batches.manifest import read_records
from adv2e.errors import DataError

TARGET = 10_000
"""Pictures an hour and core that are asked for."""

ABOUT = (
    "Pictures of 500x375, blurred noise that fills all of each; sensor of 240x180, three saccades"
    " of 0.1 s. One process, one thread. The time of a picture is the median from the end of one"
    " to the end of the next; that of all includes the start of the program."
)


def make_stills(folder: Path, count: int) -> None:
    """Write pictures of ten classes, none like another."""
    for number in range(count):
        noise = np.random.default_rng(number).integers(0, 256, (375, 500), np.uint8)
        picture = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 4), None, 0, 255, cv2.NORM_MINMAX)
        path = folder / f"class{number % 10}" / f"{number:06}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), picture)


def measured(stills: Path, dest: Path, config: str, more: tuple[str, ...]) -> dict[str, Any]:
    """Return what a batch took; DataError if a picture failed."""
    from datetime import datetime  # noqa: PLC0415

    options = ["--motion", "saccade", "--size", "240x180", "--jobs", "1", "--threads", "1"]
    command = [sys.executable, "-m", "adv2e", "batch", str(stills), str(dest), "-q", "-c", config]
    began = time.perf_counter()
    done = subprocess.run(
        [*command, *options, *more], check=False, capture_output=True, encoding="utf-8"
    )
    took = time.perf_counter() - began
    if done.returncode:
        raise DataError(f"{config}: {done.stderr.strip()}")
    records = read_records(dest).values()
    ends = sorted(datetime.fromisoformat(one["at"]).timestamp() for one in records)
    each = statistics.median(b - a for a, b in pairwise(ends))
    events = statistics.fmean(one["events"] for one in records)
    return {"stills": len(ends), "each_s": each, "all_s": took, "events": events}


@click.command(help=__doc__, context_settings={"max_content_width": 100})
@click.option("--stills", "count", type=click.IntRange(min=3), default=100, show_default=True)
@click.option("-c", "configs", multiple=True, default=("adv2e", "v2e", "davis346"))
@click.option("--export", "export", help="Also --export this, such as nmnist or spikingjelly.")
@output_option
@one_line_errors()
def main(count: int, configs: tuple[str, ...], export: str | None, output: Path | None) -> None:
    more = ("--export", export) if export else ()
    with tempfile.TemporaryDirectory() as scratch:
        make_stills(Path(scratch, "stills"), count)
        found = {
            # the first call of a configuration may compile
            config: [measured(Path(scratch, "stills"), Path(scratch, f"{config}-{k}"), config, more)
                     for k in range(2)][1]
            for config in configs
        }  # fmt: skip
    rows = [
        [f"`{config}`", f"{one['each_s']:.3f}", f"{3600 / one['each_s']:,.0f}",
         f"{one['all_s']:.1f}", f"{one['events']:,.0f}"]
        for config, one in found.items()
    ]  # fmt: skip
    head = ("configuration", "s a picture", "pictures an hour", f"s for {count}", "events of one")
    asked = f"Asked for: {TARGET:,} pictures an hour and core."
    write_report("\n\n".join([ABOUT, table(head, rows), asked]), output, found)


if __name__ == "__main__":
    main()
