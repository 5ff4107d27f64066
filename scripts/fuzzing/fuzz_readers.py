#!/usr/bin/env python
"""Damage small files of every kind, read them, and tell what does not end in one right line.

Each is a good file with some bits, bytes, numbers or parts of it changed, read by ``adv2e info``,
``convert``, ``render``, ``compare``, ``config check`` or ``characterise`` in a process of its own::

    python scripts/fuzzing/fuzz_readers.py --count 4000
    python scripts/fuzzing/fuzz_readers.py --seconds 600 --seed 7 -o found
    python scripts/fuzzing/fuzz_readers.py --only hdf5 --first 1234 --count 1 -o found

Told are internal errors, signals, more than 1 GiB, more than 10 s of computing, lines that
libraries print, and errors that are not one line.  The same seed and number give the same file.
Exit status 1 if anything was found; with ``-o`` what was read lies there, by number.  Linux only.
"""

from __future__ import annotations

import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np

from fuzzing.running import Limits, Outcome, run
from fuzzing.seeds import Seed, all_seeds, named


def prepare() -> None:
    """Import and compile whatever readers need, so that the copies of this process need not."""
    import importlib  # noqa: PLC0415

    import cv2  # noqa: PLC0415

    cv2.setNumThreads(1)
    for name in (
        *("cli.info", "cli.convert", "cli.render", "cli.compare", "cli.config", "cli.characterise"),
        *("inspection.inspect", "inspection.report", "rendering", "comparison.compare"),
        *("comparison.report", "diagnosis.tables.characterise"),
        *(
            f"formats.{name}"
            for name in (
                "monash.reader",
                "npz",
                "hdf5",
                "dsec",
                "ddd",
                "v2e",
                "mvsec",
                "m3ed",
                "prophesee",
                "text.reader",
            )
        ),
        *("formats.davis240c.reader", "conversion.pipeline", "conversion.simulation"),
        *(f"sources.{name}" for name in ("video.source", "images.source", "npy", "davis240c")),
    ):
        importlib.import_module(f"adv2e.{name}")
    from adv2e import load_config, simulate  # noqa: PLC0415

    frames = [np.full((4, 5), light, np.float32) for light in (0.1, 0.4)]
    list(simulate(frames, [0.0, 0.1], load_config(["ideal"]), threads=1))


def one(
    seeds: list[Seed], seed: int, number: int, limits: Limits, keep: Path | None
) -> tuple[str, Outcome]:
    """Make and read one file; return what was done, and how it ended."""
    draw = random.Random(f"{seed}/{number}")
    chosen = draw.choice(seeds)
    command = draw.choice(chosen.commands)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name)
        chosen.write(folder, draw)
        arguments = [part.replace("{}", name) for part in command]
        outcome = run([*arguments, *_QUIET.get(command[0], ())], folder, limits)
        if outcome.wrong and keep is not None:
            shutil.copytree(folder, keep / f"{number}", dirs_exist_ok=True)
    return f"{chosen.name}: {' '.join(command)}", outcome


_QUIET = {"convert": ("-q", "--threads", "1"), "render": ("-q",)}


@click.command()
@click.option("--count", type=click.IntRange(min=1), help="Files.  [default: 1000]")
@click.option(
    "--seconds", type=click.FloatRange(min=0), help="Go on for so long, in place of that."
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--first", type=int, default=0, show_default=True, help="Number of the first file.")
@click.option("--only", default="", help="Kinds with this in their name.")
@click.option("--mib", type=int, default=1024, show_default=True, help="Memory beyond the start.")
@click.option(
    "--cpu", "cpu_s", type=float, default=10.0, show_default=True, help="Seconds of each."
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder for what was found.")
def main(
    count: int | None, seconds: float | None, seed: int, first: int, only: str, mib: int,
    cpu_s: float, output: Path | None,
) -> None:  # fmt: skip
    """Read damaged files of every kind and tell what ends badly."""
    prepare()
    with tempfile.TemporaryDirectory() as scratch:
        seeds = named(all_seeds(Path(scratch)), only)
    if not seeds:
        raise click.UsageError(f"--only {only}: no such kind")
    limits = Limits(cpu_s=cpu_s, wall_s=6 * cpu_s, mib=mib)
    last = first + (count or (sys.maxsize if seconds else 1000))
    until = time.monotonic() + (seconds or float("inf"))
    found: Counter[str] = Counter()
    ended: Counter[str] = Counter()
    number = first
    while number < last and time.monotonic() < until:
        what, outcome = one(seeds, seed, number, limits, output)
        ended["read" if outcome.status == 0 else "refused"] += not outcome.wrong
        if outcome.wrong:
            found[outcome.wrong] += 1
            lines = outcome.said.strip().splitlines()
            click.echo(f"{number} {what}: {outcome.wrong}: {lines[-1] if lines else ''}"[:500])
        number += 1
    told = ", ".join(f"{n} {wrong}" for wrong, n in found.most_common()) or "nothing wrong"
    click.echo(
        f"{number - first} files: {ended['read']} read, {ended['refused']} refused in one line;"
        f" {told}"
    )
    raise SystemExit(bool(found))


if __name__ == "__main__":
    main()
