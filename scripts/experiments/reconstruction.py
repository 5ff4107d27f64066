#!/usr/bin/env python
"""Images from events, by networks that are trained on the events of simulators.

::

    python scripts/experiments/reconstruction.py train runs/adv2e --gopro GOPRO_Large_all
    python scripts/experiments/reconstruction.py test DAVIS240C runs/adv2e -o results.md

``train``
    E2VID or FireNet (:mod:`networks.e2vid`, :mod:`networks.firenet`) from scratch, on events that
    one simulator makes of GOPRO_Large_all (240 frames a second, by way of
    seungjunnah.github.io/Datasets/gopro.html), or of textures that move
    (:mod:`experiments.scenes`).  Light is linear throughout.  Called again, it goes on.
``test``
    The images that trained networks make of measured events, against the frames.  DATA is a folder
    with the seven DAVIS240C sequences, folders or zips as they are published
    (rpg.ifi.uzh.ch/davis_data.html), of which the cuts of EVREAL are used; or any one recording
    with frames, which is used as a whole.

The loss is the mean absolute difference plus 1 less the mean structural similarity (SSIM); with
``--lpips`` LPIPS alone, as E2VID has it, by weights in a folder (:mod:`networks.image_loss`).  Its
second term, consistency over time along known flow, is left out.

Measures are means over all images: MSE and SSIM of images as they are made (clipped to black and
white), the same after both histograms are equalised, which takes out gain and offset, and LPIPS.
A picture of one grey, the mean of each frame, stands beside them: who is not better has learnt
nothing.  Published networks are added by ``--weights`` (:mod:`networks.firenet`).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
from networks.image_loss import Lpips
from writing import as_written, one_line_errors, output_option, table, write_report

from experiments import training
from experiments.images import (
    BUILD,
    LOSS,
    Batches,
    gopro_sequences,
    kept,
    made_of,
    measures_of,
    moving_textures,
    parts,
    picture,
    references,
    trained,
    update_of,
)
from experiments.training import Training, identity

_lpips_option = click.option(
    "--lpips", "features", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="Weights of LPIPS.",
)  # fmt: skip
_weights_option = click.option(
    "--weights", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="Weights of the published FireNet and FireNet+, which then stand beside.",
)  # fmt: skip


class _Size(click.ParamType):
    name = "WxH"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        width, _, height = str(value).partition("x")
        if not (width.isdecimal() and height.isdecimal()):
            self.fail(f"{value!r}: must be WxH, such as 240x180", param, ctx)
        return int(width), int(height)


@click.group(help=as_written(__doc__))
def main() -> None:
    pass


@main.command()
@click.argument("output", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--gopro", type=click.Path(exists=True, file_okay=False, path_type=Path), metavar="FOLDER",
    help="GOPRO_Large_all.",
)  # fmt: skip
@click.option("--textures", "clips", type=click.IntRange(min=1), help="So many clips of textures.")
@click.option("--network", type=click.Choice(list(BUILD)), default="e2vid", show_default=True)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@training.counted("--steps", 300_000)
@training.rate_option(1e-4)
@training.counted("--batch", 2, "Runs at a time.")
@training.counted("--length", 40, "Windows of a run.")
@training.counted("--truncate", 40, "Windows that a gradient spans; a step of Adam each.")
@click.option("--crop", type=_Size(), default="128x128", show_default=True)
@click.option("--size", type=_Size(), default="240x180", show_default=True, help="Of the sensor.")
@training.counted("--every", 8, "Frames from an image to the next.")
@training.counted("--frames", 481, "Of a piece of a sequence.")
@training.counted("--checkpoint", 500, "Steps between checkpoints.")
@click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True)
@_lpips_option
@training.simulators_option("adv2e")
@one_line_errors()
def train(
    output: Path, gopro: Path | None, clips: int | None, network: str, seed: int, steps: int,
    rate: float, batch: int, length: int, truncate: int, crop: tuple[int, int],
    size: tuple[int, int], every: int, frames: int, checkpoint: int, device: str,
    features: Path | None, names: str, sets: tuple[str, ...], v2e_sources: Path | None,
) -> None:  # fmt: skip
    """Train a network on the events of one simulator in the folder OUTPUT; called again, go on."""
    if (gopro is None) == (clips is None):
        raise click.UsageError("say --gopro FOLDER or --textures N, and not both")
    simulator = training.one_anew(names, sets, v2e_sources)
    sequences = (
        gopro_sequences(gopro, size, frames) if gopro
        else moving_textures(clips or 0, seed, size, frames)
    )  # fmt: skip
    settings = {
        **identity(simulator), "network": network,
        "data": "GOPRO" if gopro else "textures", "seed": seed, "rate": rate, "batch": batch,
        "length": length, "truncate": truncate, "crop": list(crop), "size": list(size),
        "every": every, "frames": frames, "loss": LOSS if features is None else "LPIPS",
    }  # fmt: skip
    pairs = list(kept(sequences, simulator, output / "sequences", settings))
    lpips = None if features is None else Lpips(features)
    step = update_of(Batches(pairs, batch, length, crop), truncate, device, lpips)
    settings["sequences"] = len(pairs)
    Training(BUILD[network], step, settings, checkpoint, device=device).run(output, steps)


@main.command()
@click.argument("data", type=click.Path(exists=True, path_type=Path))
@click.argument("runs", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@_lpips_option
@_weights_option
@click.option(
    "--pictures", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="Write the last frame of each part, and beside it what each run makes of it.",
)  # fmt: skip
@output_option
@one_line_errors()
def test(
    data: Path, runs: tuple[Path, ...], features: Path | None, weights: Path | None,
    pictures: Path | None, output: Path | None,
) -> None:  # fmt: skip
    """Test the networks that were trained in the folders RUNS on the measured events in DATA."""
    lpips = None if features is None else Lpips(features)
    nets = {str(run): trained(run) for run in runs}
    found: dict[str, Any] = {}
    for part in parts(data):
        images = {run: made_of(net, part) for run, net in nets.items()}
        found[part.name] = {
            run: measures_of(made, part.frames, lpips) for run, made in images.items()
        } | references(part, weights, lpips)
        click.echo(f"{part.name}: {len(part.spans)} images done", err=True)
        if pictures is not None:
            pictures.mkdir(parents=True, exist_ok=True)
            path = pictures / f"{part.name}.png"
            cv2.imwrite(str(path), picture(part, list(images.values())))
    write_report(_tables(found), output, found)


def _tables(found: dict[str, dict[str, dict[str, float]]]) -> str:
    """Return a table a recording."""
    texts = []
    for part, each in found.items():
        names = list(next(iter(each.values())))
        lines = [[run, *(f"{values[k]:.4f}" for k in names)] for run, values in each.items()]
        texts.append(f"## {part}\n\n{table(['network', *names], lines)}")
    return "\n\n".join(texts)


if __name__ == "__main__":
    main()
