"""The clips that a training is made of, and their events, which are simulated once and kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Sensor
from adv2e.errors import DataError
from adv2e.light.sensor import fitting_of
from adv2e.sources import open_source
from experiments.images import textures
from experiments.images.sequences import Pair
from experiments.recordings import decoder_of
from experiments.simulators.clip import Clip, Simulator
from experiments.trainings.training import written

Sequences = Iterator[tuple[str, Callable[[], Iterator[Clip]]]]
"""Names, and what makes the clips of each when they are needed."""


def gopro_sequences(folder: Path, size: tuple[int, int], frames: int) -> Sequences:
    """Yield the sequences of ``GOPRO_Large_all``, in pieces of so many frames."""
    for sequence in gopro_folders(folder):
        yield sequence.name, partial(gopro_clips, sequence, size, frames)


def moving_textures(count: int, seed: int, size: tuple[int, int], frames: int) -> Sequences:
    """Yield clips of textures, others for each seed."""
    for number in range(1000 * seed, 1000 * seed + count):
        yield f"texture-{number:06d}", lambda k=number: iter([textures.moving(k, frames, size)])


def gopro_folders(folder: Path) -> list[Path]:
    """Return the sequences of ``GOPRO_Large_all`` that are for training.

    Raises
    ------
    DataError
        There is none.
    """
    inside = folder / "train"
    place = inside if inside.is_dir() else folder
    found = sorted(one for one in place.iterdir() if one.is_dir() and one.name.startswith("GOPR"))
    if not found:
        raise DataError(f"{folder}: no GOPR... in it or in its train/; give GOPRO_Large_all")
    return found


def gopro_clips(folder: Path, size: tuple[int, int], frames: int) -> Iterator[Clip]:
    """Yield pieces of a sequence of GOPRO, of so many frames each, on a sensor of a size.

    A rest of less than a piece is left out.
    """
    source = open_source(folder)
    decoder = decoder_of(source)
    sensor = Sensor(width=size[0], height=size[1], fit="crop")
    fitting = fitting_of(source.width, source.height, sensor, str(folder))

    def light(image: NDArray[Any], label: str) -> NDArray[np.float32]:
        seen = decoder.decode(image)
        return seen if fitting is None else fitting.light(seen, label)

    coming = ((one.t_ns, light(one.image, one.label)) for one in source.frames())
    while len(piece := list(islice(coming, frames))) == frames:
        times, images = zip(*piece, strict=True)
        yield Clip(np.stack(images), np.array(times, np.int64))


def kept(
    sequences: Sequences,
    simulator: Simulator,
    folder: Path,
    settings: dict[str, Any],
) -> Iterator[Pair]:
    """Yield events and images of all clips, which are simulated where they were not before."""
    folder.mkdir(parents=True, exist_ok=True)
    told = folder / "settings.json"
    about = {
        name: settings[name]
        for name in ("simulator", "nature", "digest", "data", "seed", "size", "every", "frames")
    }
    if told.exists() and (held := json.loads(told.read_text("utf-8"))) != about:
        raise DataError(f"{told}: events were made with {held}, not {about}; take another folder")
    written(told, lambda path: path.write_text(json.dumps(about) + "\n", "utf-8"))
    for name, clips in sequences:
        whole = folder / f"{name}.done"
        if not whole.exists():
            count = 0
            for count, clip in enumerate(clips(), 1):
                pair = Pair.simulated(clip, simulator, settings["seed"], settings["every"])
                written(folder / f"{name}-{count:03d}.npz", pair.save)
            whole.touch()
            click.echo(f"{name}: {count} pieces simulated", err=True)
        for path in sorted(folder.glob(f"{name}-*.npz")):
            yield Pair.load(path)
