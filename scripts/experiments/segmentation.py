#!/usr/bin/env python
"""Semantic segmentation of events, by networks that are trained on the events of simulators.

::

    python scripts/experiments/segmentation.py prepare ddd17_ess real
    python scripts/experiments/segmentation.py prepare ddd17_ess adv2e --simulators adv2e
    python scripts/experiments/segmentation.py train runs/adv2e adv2e --test real
    python scripts/experiments/segmentation.py shapes adv2e --simulators adv2e
    python scripts/experiments/segmentation.py train runs/adv2e adv2e --network unet --epochs 20

``prepare``
    DDD17 with the labels of Ev-SegNet, measured or simulated, from the layout in which ESS gives it
    (github.com/uzh-rpg/ess, "DDD17"), into the layout of Ev-SegNet.
``train``
    Ev-SegNet (:mod:`networks.evsegnet`) on a folder in that layout (its authors' data set:
    github.com/Shathe/Ev-SegNet; or what prepare wrote), tested on the split ``test`` of it or of
    another one after each epoch.  Called again, it goes on.
``shapes``
    Rendered dark shapes on a wall that moves, in the same layout, by one simulator, for a small
    U-Net (:mod:`networks.unet`): what two cores can train.  A test on the shapes of another
    simulator says how well a network goes over to other events, and nothing of a camera.

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
from networks.evsegnet import evsegnet
from networks.unet import unet
from writing import as_written, one_line_errors, output_option, table, write_report

from experiments import training
from experiments.labels import (
    CLASSES,
    Folder,
    confusion,
    from_ess,
    last_and_best,
    of_one_class,
    scores_of,
    update_of,
    write_shapes,
)
from experiments.training import Training

NETWORKS = {"evsegnet": (evsegnet, len(CLASSES), (352, 224)), "unet": (unet, 2, None)}
"""Builder of each network, its classes, and columns and rows to which pictures are brought."""
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
    simulator = training.one_anew(names, sets, v2e_sources) if names else None
    counts = from_ess(ess, output, simulator, seed)
    click.echo(", ".join(f"{split}: {count} pictures" for split, count in counts.items()))


@main.command()
@click.argument("output", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@training.counted("--clips", 40, "To train on, 0.4 s each; half as many are to test on.", least=2)
@training.counted("--side", 64, "Of the pictures, a multiple of 8 [pixels].", least=8)
@training.simulators_option("adv2e")
@one_line_errors()
def shapes(
    output: Path, seed: int, clips: int, side: int, names: str, sets: tuple[str, ...],
    v2e_sources: Path | None,
) -> None:  # fmt: skip
    """Write rendered shapes as Ev-SegNet has its data, with the events of one simulator."""
    if side % 8:
        raise click.UsageError(f"--side {side}: must be a multiple of 8")
    write_shapes(output, training.one_anew(names, sets, v2e_sources), clips, seed, side)


@main.command()
@click.argument("run", type=click.Path(file_okay=False, path_type=Path))
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--test", "other", type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Data set whose split test is used.  [default: DATA]",
)  # fmt: skip
@click.option("--network", type=click.Choice(list(NETWORKS)), default="evsegnet", show_default=True)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@training.counted("--epochs", 500)
@training.counted("--batch", 8, least=2)
@training.rate_option(1e-3, "Of Adam, at first; it falls to nothing.")
@click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True)
@output_option
@one_line_errors()
def train(
    run: Path, data: Path, other: Path | None, network: str, seed: int, epochs: int, batch: int,
    rate: float, device: str, output: Path | None,
) -> None:  # fmt: skip
    """Train a network in the folder RUN on the data set DATA; called again, go on."""
    build, classes, size = NETWORKS[network]
    training, tested = Folder.of(data, "train", size), Folder.of(other or data, "test", size)
    each = -(-len(training) // batch)
    settings = {
        "network": network, "seed": seed, "rate": rate, "batch": batch, "epochs": epochs,
        "data": data.resolve().name, "test": (other or data).resolve().name,
        "pictures": len(training), "tested": len(tested),
    }  # fmt: skip

    def check(net: Any) -> dict[str, float]:
        return scores_of(confusion(net, tested, classes, device))

    def slowing(step: int) -> float:
        return (1 - step // each / epochs) ** POWER

    made = Training(
        lambda: build(classes), update_of(training, batch, device, network == "evsegnet"), settings,
        each, check, "mIoU", device, slowing,
    )  # fmt: skip
    _, curve = made.run(run, epochs * each)
    found = last_and_best(curve.checks) | {"one class": of_one_class(tested, classes)}
    lines = [[when, *(f"{scores[name]:.4f}" for name in ("accuracy", "mIoU"))]
             for when, scores in found.items()]  # fmt: skip
    text = table(["epoch", "accuracy", "mIoU"], lines)
    write_report(text, output, {"settings": settings, "measures": found})


if __name__ == "__main__":
    main()
