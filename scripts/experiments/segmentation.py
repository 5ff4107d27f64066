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
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from networks import torch_module
from networks.evsegnet import evsegnet
from networks.unet import unet
from numpy.typing import NDArray
from real.recording import read
from writing import as_written, one_line_errors, output_option, table, write_report

from adv2e.errors import DataError
from experiments import seeds as of_seeds
from experiments.labelled import (
    CLASSES,
    IGNORED,
    Folder,
    Sample,
    Samples,
    from_ess,
    of_shapes,
    rendered,
)  # fmt: skip
from experiments.seeds import anew, simulators_option
from experiments.simulators.clip import Simulator
from experiments.training import Training, Update

MEASURES = {"last accuracy": True, "last mIoU": True, "best accuracy": True, "best mIoU": True}
SMALL = "ideal,adv2e,v2e,vid2e"
TESTED = "dvs-voltmeter"
WINDOWS = 8
"""Pictures of each clip of ``small``."""
EPOCH = 50
"""Steps of ``small`` between tests."""
POWER = 0.9
"""Of the fall of the rate, as Ev-SegNet has it."""


def update_of(samples: Samples, batch: int, device: str, changed: bool) -> Update:
    """Return one step: pictures by chance, mirrored, and `changed` as Ev-SegNet does."""
    torch = torch_module()

    def update(net: Any, optimiser: Any, rng: np.random.Generator) -> float:
        chosen = rng.integers(len(samples), size=batch)
        pairs = [augmented(samples[int(k)], rng, changed) for k in chosen]
        pictures, labels = (
            torch.from_numpy(np.stack(one)).to(device) for one in zip(*pairs, strict=True)
        )
        optimiser.zero_grad()
        loss = loss_of(net(pictures), labels)
        loss.backward()
        optimiser.step()
        return float(loss.detach())

    return update


def loss_of(scores: Any, labels: Any) -> Any:
    """Return the mean cross entropy over pixels with a class."""
    functional = torch_module().nn.functional
    return functional.cross_entropy(scores, labels.long(), ignore_index=IGNORED)


def augmented(sample: Sample, rng: np.random.Generator, changed: bool) -> Sample:
    """Return a picture with its labels, mirrored in a half of all cases.

    With `changed` it is also made 0.5 to 2 times as large, shifted by a fifth at most, and turned
    by 10 degrees at most, by the nearest pixel; what comes from outside is 0, and of no class.
    """
    picture, label = sample
    if rng.random() < 0.5:
        picture, label = picture[..., ::-1], label[:, ::-1]
    if changed:
        rows, columns = label.shape
        scale, turn = rng.uniform(0.5, 2), np.deg2rad(rng.uniform(-10, 10))
        shift = rng.uniform(-0.2, 0.2, 2) * (rows, columns)
        y, x = np.indices(label.shape) - np.reshape([rows - 1, columns - 1], (2, 1, 1)) / 2
        y, x = y - shift[0], x - shift[1]
        from_y = (np.cos(turn) * y - np.sin(turn) * x) / scale + (rows - 1) / 2
        from_x = (np.sin(turn) * y + np.cos(turn) * x) / scale + (columns - 1) / 2
        at_y, at_x = (np.rint(one).astype(int) for one in (from_y, from_x))
        inside = (at_y >= 0) & (at_y < rows) & (at_x >= 0) & (at_x < columns)
        at_y, at_x = np.clip(at_y, 0, rows - 1), np.clip(at_x, 0, columns - 1)
        picture = np.where(inside, picture[:, at_y, at_x], np.float32(0))
        label = np.where(inside, label[at_y, at_x], np.uint8(IGNORED))
    return np.ascontiguousarray(picture), np.ascontiguousarray(label)


def confusion(net: Any, samples: Samples, classes: int, device: str) -> NDArray[np.int64]:
    """Return how many pixels of each class (rows) are said to be of each (columns)."""
    torch = torch_module()
    counts = np.zeros((classes, classes), np.int64)
    with torch.inference_mode():
        for number in range(len(samples)):
            picture, label = samples[number]
            said = net(torch.from_numpy(picture)[None].to(device))[0].argmax(0).cpu().numpy()
            known = label < classes
            pairs = classes * label[known].astype(np.int64) + said[known]
            counts += np.bincount(pairs, minlength=classes**2).reshape(classes, classes)
    return counts


def scores_of(counts: NDArray[np.int64]) -> dict[str, float]:
    """Return accuracy and mIoU."""
    hit = np.diag(counts)
    union = counts.sum(0) + counts.sum(1) - hit
    shares = hit / np.maximum(union, 1)
    return {"accuracy": float(hit.sum() / max(counts.sum(), 1)), "mIoU": float(shares.mean())}


def last_and_best(checks: Sequence[dict[str, float]]) -> dict[str, float]:
    """Return the measures of the last test and of the best one."""
    best = max(checks, key=lambda one: one["mIoU"])
    names = ("accuracy", "mIoU")
    return {
        f"{when} {name}": one[name]
        for when, one in (("last", checks[-1]), ("best", best))
        for name in names
    }


def _counted(name: str, default: int, text: str | None = None, least: int = 1) -> Any:
    return click.option(
        name, type=click.IntRange(min=least), default=default, show_default=True, help=text
    )


def _rate(text: str) -> Any:
    return click.option(
        "--rate", type=click.FloatRange(min=0, min_open=True), default=1e-3, show_default=True,
        help=text,
    )  # fmt: skip


@click.group(help=as_written(__doc__))
def main() -> None:
    pass


@main.command()
@click.argument("ess", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("output", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@simulators_option("")
@one_line_errors()
def prepare(
    ess: Path, output: Path, seed: int, names: str, sets: tuple[str, ...],
    v2e_sources: Path | None,
) -> None:  # fmt: skip
    """Write DDD17 as Ev-SegNet has it: measured events, or those of one simulator."""
    simulators = anew(names, sets, v2e_sources)
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
@_counted("--epochs", 500)
@_counted("--batch", 8, least=2)
@_rate("Of Adam, at first; it falls to nothing.")
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


@dataclass(frozen=True)
class Small:
    """One training of ``small``."""

    simulator: Simulator
    seed: int
    output: Path
    tested: tuple[Sample, ...]
    about: str
    steps: int
    rate: float
    clips: int
    side: int

    @property
    def folder(self) -> Path:
        """Where it is kept."""
        return self.output / f"{self.simulator.name}-seed{self.seed}"

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its numbers."""
        return {**self._training, "steps": self.steps}

    @property
    def _training(self) -> dict[str, Any]:
        return {
            **of_seeds.about(self.simulator), "seed": self.seed,
            "network": "unet", "rate": self.rate, "batch": 4, "clips": self.clips,
            "side": self.side, "tested on": self.about, "pictures tested": len(self.tested),
        }  # fmt: skip

    def run(self) -> dict[str, Any]:
        """Train and test."""
        first = 1000 * self.seed
        samples = rendered(
            range(first, first + self.clips), self.simulator, (self.side, self.side), WINDOWS
        )

        def check(net: Any) -> dict[str, float]:
            return scores_of(confusion(net, self.tested, 2, "cpu"))

        made = Training(
            lambda: unet(2), update_of(samples, 4, "cpu", False), self._training, EPOCH, check,
            "mIoU",
        )  # fmt: skip
        net, curve = made.run(self.folder, self.steps)
        cv2.imwrite(str(self.folder / "last.png"), picture(net, self.tested[-1]))
        return {
            "measures": last_and_best(curve.checks),
            "loss": float(np.mean(curve.losses[-50:])),
            "seconds a step": curve.seconds / self.steps,
        }


def picture(net: Any, sample: Sample) -> NDArray[np.uint8]:
    """Return labels, what a network says, and the number of events, side by side."""
    torch = torch_module()
    with torch.inference_mode():
        said = net(torch.from_numpy(sample[0])[None])[0].argmax(0).numpy()
    counts = sample[0][:2].max(0) / 2 + 0.5
    return np.rint(255 * np.hstack([sample[1] == 1, said == 1, counts])).astype(np.uint8)


@main.command()
@click.argument("output", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER")
@click.option(
    "--measured", type=click.Path(exists=True, path_type=Path), metavar="RECORDING",
    help="shapes_6dof, or another recording of dark shapes on a bright wall.",
)  # fmt: skip
@click.option("--test-simulator", "tester", default=TESTED, show_default=True)
@_counted("--test-clips", 20, "Of the test on rendered shapes.")
@_counted("--seeds", 5)
@_counted("--steps", 400)
@_rate("Of Adam.")
@_counted("--clips", 40, "Of each seed, 0.4 s each.")
@_counted("--side", 64, "Of the clips, a multiple of 8 [pixels].")
@_counted("--jobs", 1, "Trainings at a time, on one thread each.")
@simulators_option(SMALL)
@click.option(
    "-o", "--report", "to", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.md",
    help="Write the report here too; numbers beside it.",
)  # fmt: skip
@one_line_errors()
def small(
    output: Path, measured: Path | None, tester: str, test_clips: int, seeds: int, steps: int,
    rate: float, clips: int, side: int, jobs: int, names: str, sets: tuple[str, ...],
    v2e_sources: Path | None, to: Path | None,
) -> None:  # fmt: skip
    """Train for each simulator and seed in FOLDER, and test; called again, go on."""
    if side % 8:
        raise click.UsageError(f"--side {side}: must be a multiple of 8")
    simulators = anew(names, sets, v2e_sources)
    if measured is None and tester in [one.name for one in simulators]:
        raise click.UsageError(f"--test-simulator {tester}: is one of those that are trained on")
    if measured is None:
        (other,) = anew(tester, (), v2e_sources)
        # seeds that no training has
        samples = rendered(range(10**6, 10**6 + test_clips), other, (side, side), WINDOWS)
        about = f"rendered shapes by {other.name} ({other.nature})"
    else:
        real = read(str(measured))
        samples, about = of_shapes(real), f"measured events of {real.name}"
    if not samples:
        raise DataError(f"{measured}: no frame with 50 ms of events before it")
    trainings = [
        Small(simulator, seed, output, tuple(samples), about, steps, rate, clips, side)
        for seed in range(seeds)
        for simulator in simulators
    ]
    of_seeds.all_done(trainings, jobs)
    _report(output, to)


@main.command()
@click.argument(
    "folder", type=click.Path(exists=True, file_okay=False, path_type=Path), metavar="FOLDER"
)
@output_option
@one_line_errors()
def report(folder: Path, output: Path | None) -> None:
    """Tell what came of the trainings of small in FOLDER, seed by seed, and what it carries."""
    _report(folder, output)


def _report(folder: Path, output: Path | None) -> None:
    found = of_seeds.measured(folder)
    one = found[0]["settings"]
    seconds = np.mean([each["seconds a step"] for each in found])
    about = (
        f"U-Net, {one['steps']} steps of {seconds:.2f} s on one thread, {one['clips']} clips of"
        f" {one['side']}x{one['side']} pixels a seed; tested on {one['pictures tested']} pictures:"
        f" {one['tested on']}. The best test of each training is chosen by the test data itself."
    )
    write_report(f"{about}\n\n{of_seeds.report(found, MEASURES)}", output, {"trainings": found})


if __name__ == "__main__":
    main()
