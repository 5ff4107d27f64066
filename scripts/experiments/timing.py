#!/usr/bin/env python
r"""A timing test that sees the filter: edges that move and stop suddenly, by brightness.

An edge between two grey levels passes each pixel at a known time.  A pixel with a filter fires
later, the later the dimmer the light, and goes on when the edge has stopped.  The test tells

- latencies: how long after the passage the first, second ... event of a pixel comes;
- the distance of these distributions to the truth's [us] (Wasserstein-1, what a shift comes to),
  beside that between two of the truth's own seeds;
- how many events come after the stop, and how they decay.

Truths, which share no code with adv2e (both are in ``tests/``):

- ``circuit``: the dense numerical solution of a pixel whose light is the exact one at all times;
  logarithm, first-order filter of 300 Hz at white and 21.8 Hz in the dark, thresholds of 0.2 ln
  that differ by 0.03, dead time of 0.5 ms: defaults of v2e, but for the knee of its logarithm;
- ``camera``: a camera by brute force with other corners, a second pole, noise, leak, a long dead
  time, hot and dead pixels, of which simulators know nothing.

Simulators see frames alone.  Those named ``..., told`` are adv2e's pixel with numbers of the truth.

Measured events: ``--real FOLDER`` takes a recording with frames and ``exposures.txt`` (name, start
and end [s] of each exposure), such as the Newton's cradle of E-MLB (github.com/KugaMaxx/cuke-emlb,
data/demo/samples/demo-01.aedat4) as a DAVIS240C folder, and ``--sweep`` where an edge blurs one.
Beside its events stand those of rendered edges of the same speed and light.

    python scripts/experiments/timing.py [--quick] [-o FILE.md]
    python scripts/experiments/timing.py --real cradle --sweep 2,16:45,153:159,ON -o FILE.md
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from writing import as_written, load_pyplot, one_line_errors, output_option, write_report

from adv2e.events import Events
from experiments.clip import Clip, Simulator
from experiments.edge_tables import TRUTH, Part, draw, row_of
from experiments.edges import PAIRS, Edges
from experiments.recordings import read
from experiments.simulators import named, simulator_options
from experiments.sweeps import Sweep, SweepType, exposures_of, report
from experiments.truth import AS_THE_CIRCUIT, Camera, Dense

TOLD = ("paper", "v2e")
"""Configurations that are told the logarithm of the circuit; ``adv2e`` and ``vid2e`` have it."""

FLOW = ("sampling.interpolation=flow",)

Tell = Callable[[str], None]


def told(names: Sequence[str], sets: Sequence[str], how: str = "told") -> Iterator[Simulator]:
    """Yield configurations with more settings, and a name that says so."""
    for one in named(names, sets=sets):
        yield replace(one, name=f"{one.name}, {how}")


def part_of(
    title: str, about: str, edges: Edges, clip: Clip, truths: list[Events],
    simulators: Sequence[Simulator], tell: Tell,
) -> Part:  # fmt: skip
    """Simulate a clip and hold the events against the truth's."""
    passages = edges.passages()
    rows = []
    for one in simulators:
        streams = [one.events(clip, seed) for seed in range(len(truths))]
        rows.append(row_of(one.name, one.nature, streams, passages))
        tell(f"{title}: {one.name} done")
    return Part(title, about, edges.bands, row_of(TRUTH, "", truths, passages), rows)


def circuit_parts(
    edges: Edges, rates: Sequence[float], seeds: int, simulators: Sequence[Simulator], tell: Tell
) -> Iterator[Part]:
    """Yield a part for each frame rate, beside the dense solution of the circuit."""
    dense = Dense(edges)
    truths = []
    for seed in range(seeds):
        truths.append(dense.events(seed))
        tell(f"circuit: truth, seed {seed} done")
    every = [*simulators, *told(TOLD, AS_THE_CIRCUIT), *told(["adv2e"], FLOW, "flow")]
    for rate in rates:
        about = (
            f"Frames of exact light, {rate:g} a second. The truth is the dense solution of the"
            f" circuit. Told: its logarithm in place of a knee."
        )
        yield part_of(
            f"circuit, {rate:g} frames/s", about, edges, edges.clip(rate), truths, every, tell
        )


def camera_part(
    edges: Edges, rate: float, seeds: int, simulators: Sequence[Simulator], tell: Tell
) -> Part:
    """Return the part of the camera by brute force."""
    camera = Camera(edges, rate)
    truths = [camera.events(seed) for seed in range(seeds)]
    tell("camera: truth done")
    every = [*simulators]
    for sets, how in ((camera.told(), "told"), ([*camera.told(), *FLOW], "told, flow")):
        every += told(["adv2e"], sets, how)
    about = (
        f"Frames of {rate:g} a second. Simulators know nothing of this camera; told: all of its"
        " pixel."
    )
    return part_of(f"camera, {rate:g} frames/s", about, edges, camera.clip(), truths, every, tell)


def write_frames(edges: Edges, rate: float, folder: Path) -> None:
    """Write the rendered frames, 16 bits in linear light, and their times [s] in ``images.txt``."""
    clip = edges.clip(rate)
    (folder / "images").mkdir(parents=True)
    lines = []
    for k, (t_ns, light) in enumerate(zip(clip.times_ns.tolist(), clip.frames, strict=True)):
        name = f"images/frame_{k:08d}.png"
        cv2.imwrite(str(folder / name), np.rint(light * (65535 / 255)).astype(np.uint16))
        lines.append(f"{t_ns // 10**9}.{t_ns % 10**9:09d} {name}\n")
    (folder / "images.txt").write_text("".join(lines), "ascii")


@click.command(help=as_written(__doc__))
@click.option("--quick", is_flag=True, help="Two levels of light, few lines, one frame rate.")
@click.option("--rates", default="240,960", show_default=True, help="Frames a second, rendered.")
@click.option(
    "--camera-rate", type=click.FloatRange(min=50), default=240.0, show_default=True,
    help="Frames a second of the camera by brute force.",
)  # fmt: skip
@click.option("--seeds", type=click.IntRange(min=2), default=3, show_default=True)
@click.option("--lines", type=click.IntRange(min=1), default=12, show_default=True,
              help="Rows of pixels for each edge.")  # fmt: skip
@click.option(
    "--real", "recording", type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER", help="A recording with frames and exposures.txt.",
)  # fmt: skip
@click.option(
    "--sweep", "sweeps", type=SweepType(), multiple=True, metavar="FRAME,X0:X1,Y0:Y1,ON|OFF",
    help="Where an edge of a dark thing blurs a frame before a bright wall. Repeatable.",
)  # fmt: skip
@click.option(
    "--frames", "folder", type=click.Path(exists=False, path_type=Path), metavar="FOLDER",
    help="Only write the rendered frames, of the first rate, for tools that --events brings in.",
)  # fmt: skip
@simulator_options
@output_option
@one_line_errors()
def main(
    quick: bool, rates: str, camera_rate: float, seeds: int, lines: int,
    recording: Path | None, sweeps: tuple[Sweep, ...], folder: Path | None,
    simulators: list[Simulator], output: Path | None,
) -> None:  # fmt: skip
    edges = Edges(lines=lines)
    each = [float(rate) for rate in rates.split(",")]
    if quick:
        edges, each = Edges(pairs=(PAIRS[0], PAIRS[-1]), lines=4), each[:1]
    if folder is not None:
        write_frames(edges, each[0], folder)
        return
    measured = None
    if recording is not None:
        if not sweeps:
            raise click.UsageError("--real needs a --sweep, the edges to look at")
        real = read(str(recording))
        exposed = exposures_of(recording, len(real.times_us))
        measured = report(real, exposed, sweeps, [*simulators, *named(["davis346"])])
    if output is not None:
        load_pyplot()  # before all the work
    tell = partial(click.echo, err=True)
    parts = [
        *circuit_parts(edges, each, seeds, simulators, tell),
        camera_part(edges, camera_rate, seeds, simulators, tell),
    ]
    natures = {row.name: row.nature for part in parts for row in part.rows}
    lines_of = [f"- {name}: {nature}" for name, nature in natures.items()]
    text = "\n\n".join([part.tables() for part in parts] + ["\n".join(lines_of)])
    numbers: dict[str, Any] = {part.title: part.numbers() for part in parts}
    if measured is not None:
        text, numbers["measured"] = f"{text}\n\n{measured[0]}", measured[1]
    write_report(text, output, numbers)
    if output is not None:
        draw(parts, output.with_suffix(".png"))


if __name__ == "__main__":
    main()
