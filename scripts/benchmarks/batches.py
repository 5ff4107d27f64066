#!/usr/bin/env python
"""How long a batch of short clips takes: beside the pixel alone, and beside shell loops.

Makes 200 clips of 346x260 at 30 frames a second, one second each, and converts them in four ways:
by the pixel alone, frames in memory to events in memory; by ``adv2e batch``; by a shell loop of
``adv2e convert``; and by a shell loop of EventCV with 10 sub-steps, if that is installed::

    python scripts/benchmarks/batches.py -o out/batches.md
    python scripts/benchmarks/batches.py --quick        # 20 clips

Prints a table; ``-o FILE.md`` also writes it, with the raw numbers in ``FILE.json``.
"""

from __future__ import annotations

import importlib.util
import json
import shlex
import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import output_option, table, write_report

from adv2e.background import default_threads
from benchmarks.clips import Clip, as_srgb, encoded
from benchmarks.measure import (
    ALL,
    IDEAL,
    THRESHOLD,
    Job,
    Log,
    Measured,
    Plan,
    about,
    number,
    of_a_plan,
    peer_arguments,
    run_rounds,
)  # fmt: skip

CLIPS, QUICK_CLIPS = 200, 20
FRAMES, FPS = 31, 30.0
LEVELS = f"pixel.thresholds={{on: {THRESHOLD:g}, off: {THRESHOLD:g}}}"
SETS = {
    "all effects": (LEVELS, *ALL),
    "noise off": (LEVELS, *(one for one in IDEAL if one.startswith("pixel.") and "=null" in one)),
}
ABOUT = (
    f"Clips of 346x260, {FRAMES} frames at {FPS:g} a second, as MP4 (mp4v). Thresholds 0.2 and the"
    " same effects in both tools; all effects: with shot noise of 5 Hz. Whole processes, from start"
    " to end, compiled beforehand; of the pixel, the time after warming up. Median (least..most);"
    " ratios are paired by round."
)


def make_clips(folder: Path, count: int, moving: float) -> Path:
    """Return a folder of so many videos, none like the other; make it if need be."""
    made = folder / f"batch-{count}-{moving:g}"
    made.mkdir(parents=True, exist_ok=True)
    for seed in range(count):
        target = made / f"{seed:03}.mp4"
        if target.exists():
            continue
        clip = Clip(width=346, height=260, frames=FRAMES, fps=FPS, seed=seed, moving=moving)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            video = encoded(as_srgb(clip, Path(scratch)), FPS)
            shutil.move(video, target)
    return made


def ways(clips: Path, scratch: Path, threads: int, pixel: str) -> list[Job]:
    """Return the ways to convert the same clips, the pixel alone first; `pixel`: one of SETS."""
    program = [sys.executable, "-m", "adv2e"]
    sets = [word for one in SETS[pixel] for word in ("--set", one)]
    paths = sorted(str(path) for path in clips.glob("*.mp4"))

    def job(name: str, folder: str, script: str) -> Job:
        options = {"script": script, "target": str(scratch / folder)}
        return Job(name=name, action="shell", options=options, threads=threads)

    def loop(command: Sequence[str], folder: str, after: Sequence[str]) -> str:
        out = shlex.quote(str(scratch / folder)) + '/"$(basename "$f" .mp4)".h5'
        option = "-o " if "convert" in command else ""
        call = f'{shlex.join(command)} "$f" {option}{out} {shlex.join(after)}'
        return f"for f in {shlex.quote(str(clips))}/*.mp4; do {call}; done"

    alone = {"clips": paths, "sets": list(SETS[pixel])}
    batch = [*program, "batch", str(clips), str(scratch / "batch"), *sets, "-q"]
    convert = loop([*program, "convert"], "loop", [*sets, "-q", "--threads", str(threads)])
    found = [
        Job(name="the pixel alone", action="simulate_clips", options=alone, threads=threads),
        job("`adv2e batch`", "batch", shlex.join(batch)),
        job("shell loop of `adv2e convert`", "loop", convert),
    ]
    if importlib.util.find_spec("eventcv") is not None:
        given = json.dumps(peer_arguments(pixel == "all effects", "10"))
        peer = loop([sys.executable, "-m", "benchmarks.worker"], "peer", [given])
        found.append(job("shell loop of EventCV, 10 sub-steps", "peer", peer))
    return found


def report(found: Sequence[Measured], count: int) -> str:
    """Return the table."""
    size = count * FRAMES * 346 * 260 / 1e6
    pixel = found[0]
    rows = [
        [one.job.name, str(one.wall_s()), number(one.cpu_s().median),
         str(one.wall_s().inverse(size)), str(pixel.ratio(one))]
        for one in found
    ]  # fmt: skip
    head = (f"{count} clips", "wall s", "CPU s", "Mpx-frames/s", "rate of the pixel alone")
    return "\n\n".join([ABOUT, table(head, rows)])


@click.command(help=__doc__, context_settings={"max_content_width": 100})
@click.option(
    "--moving", type=click.FloatRange(0, 1), default=1.0, show_default=True,
    help="Share of the rows of each clip in which anything moves.",
)  # fmt: skip
@click.option(
    "--pixel", type=click.Choice([*SETS]), default=next(iter(SETS)), show_default=True,
    help="What the pixels have.",
)  # fmt: skip
@output_option
@of_a_plan(rounds=3, quick_rounds=2)
def main(plan: Plan, log: Log, moving: float, pixel: str, output: Path | None) -> None:
    """Measure, and report."""
    count = QUICK_CLIPS if plan.quick else CLIPS
    clips = make_clips(plan.folder, count, moving)
    with tempfile.TemporaryDirectory(prefix="adv2e-batches-") as folder:
        made = ways(clips, Path(folder), plan.threads or default_threads(), pixel)
        first = {**made[0].options, "clips": made[0].options["clips"][:1]}
        found = run_rounds(made, plan.rounds, log, warm=[replace(made[0], options=first)])
    part = f"{pixel.capitalize()}; something moves in {100 * moving:g} % of the rows."
    text = f"{report(found, count)}\n\n{part} {about(found)}"
    write_report(text, output, {"measured": [asdict(one) for one in found]})


if __name__ == "__main__":
    main()
