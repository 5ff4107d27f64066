#!/usr/bin/env python
"""Semantic segmentation of events, by networks that are trained on the events of simulators.

::

    python scripts/experiments/segmentation.py prepare ddd17_ess real
    python scripts/experiments/segmentation.py prepare ddd17_ess adv2e --simulators adv2e
    python scripts/experiments/segmentation.py train runs/adv2e adv2e --test real
    python scripts/experiments/segmentation.py small runs -o small.md
    python scripts/experiments/segmentation.py report runs -o small.md

``prepare``
    DDD17 with the labels of Ev-SegNet, measured or simulated, from the layout in which ESS gives it
    (github.com/uzh-rpg/ess, "DDD17"), into the layout of Ev-SegNet.
``train``
    Ev-SegNet (:mod:`networks.evsegnet`) on a folder in that layout (its authors' data set:
    github.com/Shathe/Ev-SegNet; or what prepare wrote), tested on the split ``test`` of it or of
    another one after each epoch.  Called again, it goes on.
``small``
    A small U-Net (:mod:`networks.unet`) for each simulator and seed, on rendered shapes, each on
    one thread.  It is tested on ``--measured shapes_6dof`` (a folder or zip of DAVIS240C,
    rpg.ifi.uzh.ch/davis_data.html, whose dark shapes are told by their frames).  Without it, on
    rendered shapes through a simulator that none is trained on (``--test-simulator``), which says
    how well a network goes over to other events, and nothing of a camera.  ``report`` makes its
    tables again.

The loss is cross entropy over the pixels with a class.  Accuracy is over all of them together; mIoU
is the mean over classes of intersection over union, 0 for a class that neither is nor is said, as
Ev-SegNet has it.  Both are given for the last epoch and for the best.  The best one is chosen by
the test data itself, as the authors do, and so looks better than it is: go by the last.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from networks.evsegnet import evsegnet
from writing import as_written, one_line_errors, output_option, table, write_report

from adv2e.errors import DataError
from experiments import training
from experiments.labels import (
    CLASSES,
    MEASURES,
    WINDOWS,
    Folder,
    Small,
    confusion,
    from_ess,
    last_and_best,
    of_one_class,
    of_shapes,
    rendered,
    scores_of,
    update_of,
)
from experiments.recordings import read
from experiments.training import Training, all_done, all_measured, keep_references, kept_references

TESTED = "dvs-voltmeter"
POWER = 0.9
"""Of the fall of the rate, as Ev-SegNet has it."""


@click.group(help=as_written(__doc__))
def main() -> None:
    pass


@main.command()
@click.argument("ess", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("output", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@training.simulators_option("")
@one_line_errors()
def prepare(
    ess: Path, output: Path, seed: int, names: str, sets: tuple[str, ...],
    v2e_sources: Path | None,
) -> None:  # fmt: skip
    """Write DDD17 as Ev-SegNet has it: measured events, or those of one simulator."""
    simulators = training.anew(names, sets, v2e_sources)
    if len(simulators) > 1:
        raise click.UsageError(f"--simulators {names}: prepare takes one, or none for measured")
    counts = from_ess(ess, output, simulators[0] if simulators else None, seed)
    click.echo(", ".join(f"{split}: {count} pictures" for split, count in counts.items()))


@main.command()
@click.argument("run", type=click.Path(file_okay=False, path_type=Path))
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--test", "other", type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Data set whose split test is used.  [default: DATA]",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@training.counted("--epochs", 500)
@training.counted("--batch", 8, least=2)
@training.rate_option(1e-3, "Of Adam, at first; it falls to nothing.")
@click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True)
@output_option
@one_line_errors()
def train(
    run: Path, data: Path, other: Path | None, seed: int, epochs: int, batch: int, rate: float,
    device: str, output: Path | None,
) -> None:  # fmt: skip
    """Train Ev-SegNet in the folder RUN on the data set DATA; called again, go on."""
    size = (352, 224)
    training, tested = Folder.of(data, "train", size), Folder.of(other or data, "test", size)
    each = -(-len(training) // batch)
    settings = {
        "network": "evsegnet", "seed": seed, "rate": rate, "batch": batch, "epochs": epochs,
        "data": data.resolve().name, "test": (other or data).resolve().name,
        "pictures": len(training), "tested": len(tested),
    }  # fmt: skip

    def check(net: Any) -> dict[str, float]:
        return scores_of(confusion(net, tested, len(CLASSES), device))

    def slowing(step: int) -> float:
        return (1 - step // each / epochs) ** POWER

    made = Training(
        lambda: evsegnet(len(CLASSES)), update_of(training, batch, device, True), settings, each,
        check, "mIoU", device, slowing,
    )  # fmt: skip
    _, curve = made.run(run, epochs * each)
    found = last_and_best(curve.checks)
    lines = [[when, *(f"{found[f'{when} {name}']:.4f}" for name in ("accuracy", "mIoU"))]
             for when in ("last", "best")]  # fmt: skip
    text = table(["epoch", "accuracy", "mIoU"], lines)
    write_report(text, output, {"settings": settings, "measures": found})


@main.command()
@click.argument("output", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER")
@click.option(
    "--measured", type=click.Path(exists=True, path_type=Path), metavar="RECORDING",
    help="shapes_6dof, or another recording of dark shapes on a bright wall.",
)  # fmt: skip
@click.option("--test-simulator", "tester", default=TESTED, show_default=True)
@training.counted("--test-clips", 20, "Of the test on rendered shapes.")
@training.counted("--seeds", 5)
@training.counted("--steps", 1600)
@training.rate_option(1e-3)
@training.counted("--clips", 40, "Of each seed, 0.4 s each.")
@training.counted("--side", 64, "Of the clips, a multiple of 8 [pixels].")
@training.counted("--jobs", 1, "Trainings at a time, on one thread each.")
@training.simulators_option(training.SMALL)
@training.report_option
@one_line_errors()
def small(
    output: Path, measured: Path | None, tester: str, test_clips: int, seeds: int, steps: int,
    rate: float, clips: int, side: int, jobs: int, names: str, sets: tuple[str, ...],
    v2e_sources: Path | None, to: Path | None,
) -> None:  # fmt: skip
    """Train for each simulator and seed in FOLDER, and test; called again, go on."""
    if side % 8:
        raise click.UsageError(f"--side {side}: must be a multiple of 8")
    simulators = training.anew(names, sets, v2e_sources)
    if measured is None:
        if tester in [one.name for one in simulators]:
            raise click.UsageError(
                f"--test-simulator {tester}: is one of those that are trained on"
            )
        (other,) = training.anew(tester, (), v2e_sources)
        # seeds that no training has
        samples = rendered(range(10**6, 10**6 + test_clips), other, (side, side), WINDOWS)
        about = f"rendered shapes by {other.name} ({other.nature})"
    else:
        real = read(str(measured))
        samples, about = of_shapes(real), f"measured events of {real.name}"
    if not samples:
        raise DataError(f"{measured}: no frame with 50 ms of events before it")
    trainings = [
        Small(simulator, seed, tuple(samples), about, steps, rate, clips, side)
        for seed in range(seeds)
        for simulator in simulators
    ]
    keep_references(output, {"one class for all pixels": of_one_class(samples, 2)})
    all_done(trainings, output, jobs)
    _report(output, to)


def _report(folder: Path, output: Path | None) -> None:
    found = all_measured(folder)
    one = found[0]["settings"]
    seconds = np.median([each["seconds a step"] for each in found])
    about = (
        f"U-Net, {one['steps']} steps of {seconds:.2f} s on one thread, {one['clips']} clips of"
        f" {one['side']}x{one['side']} pixels a seed; tested on {one['pictures tested']} pictures:"
        f" {one['tested on']}. The best test of each training is chosen by the test data itself."
    )
    kept = kept_references(folder)
    text = f"{about}\n\n{training.report(found, MEASURES, kept)}"
    write_report(text, output, {"trainings": found, "beside": kept})


main.add_command(training.report_command(_report))

if __name__ == "__main__":
    main()
