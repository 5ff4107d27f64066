#!/usr/bin/env python
"""How far off statistics are for what is made up between frames, and what the diagnosis expects.

The camera of the tests takes frames at 2000 a second; a diagnosis would have every 4th to 64th.
How far simulations from these are from those of all frames is the error; what it expects comes from
simulations with every second of its own frames left out.  For each scene, all in deviations of
chance, compressed as in the diagnosis, root mean square over its statistics::

    python scripts/studies/interpolation_error.py
    python scripts/studies/interpolation_error.py --seeds 1 --every 16 --seconds 0.4
"""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from numpy.typing import NDArray
from writing import table

from adv2e.config import Config, load_config
from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.data.evidence import Evidence, read_evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.metric import compressed
from adv2e.diagnosis.statistics.summary import BOTH, SummaryStatistics
from adv2e.diagnosis.statistics.uncertainty import (
    PILOT_SEEDS,
    FrameError,
    Pilot,
    between_frames,
    every,
)
from studies.verdicts.camera import camera
from studies.verdicts.cases import SCENES
from studies.verdicts.options import Names, sampling

Array = NDArray[np.float64]

FPS = 2000.0
SIZE = (48, 36)
DRAWS = 48
"""Simulations that an error is the mean of."""

KINDS = ("linear", "flow")


@dataclass(frozen=True)
class Row:
    """Of one scene at one rate: the error, what is left of it, what was expected to be left.

    In deviations of chance, root mean square over the statistics.
    """

    kind: str
    fps: float
    error: float
    left: float
    doubt: float


def rows_of(
    scene: str, seed: int, seconds: float, steps: Sequence[int], threads: int
) -> Iterator[Row]:
    """Yield the rows of one scene."""
    with tempfile.TemporaryDirectory(prefix="adv2e-study-") as folder:
        path = Path(folder) / "recording.zip"
        made = camera.SCENES[scene](SIZE, seed=seed)
        camera.Camera(made, size=SIZE, duration_s=seconds, fps=FPS, seed=seed).record(path)
        evidence = read_evidence(path)
        declared = load_config([path.with_name("recording.declared.yaml")])
        configs = {
            kind: with_keys(
                declared, {f"sampling.{key}": value for key, value in sampling(kind).items()}
            )
            for kind in KINDS
        }
    all_frames = streams(evidence, configs["linear"], threads)
    for step in steps:
        for kind, config in configs.items():
            fewer = every(evidence, step)
            yield row_of(kind, FPS / step, fewer, config, all_frames, threads)


def streams(evidence: Evidence, config: Config, threads: int) -> dict[int, Stream]:
    """Return simulations by their seeds."""
    seeds = range(1, DRAWS + 1)
    with closing(Simulator(evidence, threads)) as simulator:
        made = simulator.map(lambda seed: simulator.stream(config, seed), seeds)
    return dict(zip(seeds, made, strict=True))


def row_of(
    kind: str,
    fps: float,
    evidence: Evidence,
    config: Config,
    all_frames: dict[int, Stream],
    threads: int,
) -> Row:
    """Return what frames at one rate make of the statistics."""
    scene = Scene.of_evidence(evidence, config)
    drawn = streams(evidence, config, threads)
    pilot = {seed: drawn[seed] for seed in list(drawn)[: len(PILOT_SEEDS)]}
    statistics = SummaryStatistics(scene, list(pilot.values()))
    expected = between_frames(
        Pilot(evidence, config, statistics, pilot, lambda fewer: Simulator(fewer, threads))
    )
    if expected is None:
        raise click.UsageError(f"too few frames in so short a scene at {fps:.4g} a second")

    def measured(made: dict[int, Stream]) -> Any:
        return statistics.sample(made.values())[:, BOTH]

    return compared(kind, fps, measured(drawn), measured(all_frames), expected, statistics.least)


def compared(
    kind: str, fps: float, few: Array, many: Array, expected: FrameError, least: Array
) -> Row:
    """Return the row of simulations with few frames and with many, (seeds, statistics)."""
    deviation = np.maximum(few.std(axis=0, ddof=1), least)
    apart = (few - many) / deviation
    chance = apart.var(axis=0, ddof=1) / len(apart)
    error = compressed(apart.mean(axis=0))
    left = compressed(apart.mean(axis=0) - expected.bias[BOTH] / deviation)
    doubt = compressed(expected.sd[BOTH] / deviation)
    return Row(kind, fps, rms(error, chance), rms(left, chance), rms(doubt))


def rms(values: Array, chance: Array | float = 0.0) -> float:
    """Return the root mean square, less what chance makes of it."""
    return float(np.sqrt(max(np.mean(values**2 - np.minimum(chance, values**2)), 0.0)))


def rates_table(rows: Sequence[Row]) -> str:
    """Return a row for each rate: medians over the scenes, and the range of what was expected."""
    groups: dict[tuple[str, float], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row.kind, row.fps].append(row)
    cells = []
    for (kind, fps), group in sorted(groups.items(), key=lambda one: (one[0][0], -one[0][1])):
        medians = [
            f"{np.median([getattr(row, name) for row in group]):.2f}"
            for name in ("error", "left", "doubt")
        ]
        ratios = [row.left / row.doubt for row in group]
        told = f"{np.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
        cells.append([kind, f"{fps:.4g}", *medians, told])
    header = ("between frames", "frames a second", "error", "left", "expected", "left / expected")
    return table(header, cells)


@click.command()
@click.option("--scenes", type=Names(SCENES), default=",".join(SCENES), show_default=True)
@click.option("--seeds", type=click.IntRange(min=1), default=4, show_default=True)
@click.option("--seconds", type=click.FloatRange(min=0.1), default=0.8, show_default=True)
@click.option(
    "--every", "steps", type=click.IntRange(min=2), multiple=True, default=(4, 8, 16, 32, 64),
    show_default=True, help="Frames of which one is taken. Repeatable.",
)  # fmt: skip
@click.option("--threads", type=click.IntRange(min=1), default=1, show_default=True)
def main(
    scenes: tuple[str, ...], seeds: int, seconds: float, steps: tuple[int, ...], threads: int
) -> None:
    """Print errors and what is expected of them, by rate of the frames."""
    rows: list[Row] = []
    for seed in range(1, seeds + 1):
        for number, name in enumerate(scenes):
            click.echo(f"scene {name}, seed {seed}", err=True)
            rows += rows_of(name, 100 * seed + number, seconds, steps, threads)
    click.echo(f"{seeds * len(scenes)} scenes, {SIZE[0]}x{SIZE[1]} px, {seconds:g} s\n")
    click.echo(rates_table(rows))


if __name__ == "__main__":
    main()
