#!/usr/bin/env python
"""How near simulated recordings of known pictures are to measured ones, by configuration.

DATA is a folder of recordings with a picture each: ``60001.bin`` and ``60001.png``, as N-MNIST has
them.  Of each configuration, the thresholds and the view of the pictures are fitted to every second
recording, in one way for all; the table is of the others::

    python scripts/studies/film.py DATA -c found/model.yaml -o film.md
    python scripts/studies/film.py DATA -c ideal -c v2e --events .npz

Beside the table lies a picture: events of three recordings, measured and as each configuration
makes them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from numpy.typing import NDArray
from writing import one_line_errors, output_option, table, threads_option, write_report

from adv2e import load_config
from adv2e.background import default_threads
from adv2e.config.model import Sensor
from adv2e.diagnosis.configurations import of_known_light
from adv2e.diagnosis.film.diagnose import halves_of
from adv2e.diagnosis.film.nearness import DISTANCES, distances
from adv2e.diagnosis.film.recordings import FilmRecordings, Pair, read_recordings, split
from adv2e.diagnosis.film.registration import first_view
from adv2e.diagnosis.film.selection import FilmSearch
from adv2e.diagnosis.fitting.fitter import threshold_nuisance
from adv2e.events import Events
from adv2e.geometry import Size, parse_size

_CONFIGS = ("ideal", "adv2e", "paper", "v2e", "vid2e", "davis240c")
_DRAWS = range(100, 104)
_PICTURED, _LARGER = 3, 6
_SHORT = ("totals", "spread", "1 - corr", "course", "gaps", "1 - maps", "c2st")


def pairs_of(folder: Path, suffix: str) -> list[Pair]:
    """Return the recordings of a folder that have a picture, with it."""
    found = [(path, path.with_suffix(".png")) for path in sorted(folder.glob(f"*{suffix}"))]
    return [pair for pair in found if pair[1].is_file()]


class Halves:
    """Recordings to fit to, and those to judge by, all on one clock."""

    def __init__(self, recordings: FilmRecordings, threads: int) -> None:
        self.threads, self.films = threads, recordings.films
        self.fitters = halves_of(recordings, threads)

    def judged(self, name: str) -> tuple[list[dict[str, float]], list[list[Events]], str]:
        """Return distances of a configuration, its simulations, and its fitted thresholds."""
        config = of_known_light(load_config([name], ["pixel.initial_reference=random"]))
        fitter, judge = self.fitters
        search = FilmSearch(
            fitter, judge, threshold_nuisance(config), self.threads, click.echo, click.echo
        )
        step = search.start(first_view(fitter.films, fitter.measured), config)
        streams = judge.streams(step.place.view, step.place.config, _DRAWS)
        made = [split(one, len(judge.films.pictures)) for one in streams]
        levels = step.place.config.pixel.thresholds
        found = [self.apart(self.measured, one) for one in made]
        return found, made, f"{levels.on:.2f}, {levels.off:.2f}"

    @property
    def measured(self) -> list[Events]:
        """Events of the recordings that judge, as aligned last."""
        judge = self.fitters[1]
        return split(judge.measured, len(judge.films.pictures))

    def apart(self, one: Sequence[Events], other: Sequence[Events]) -> dict[str, float]:
        """Return the distances of two sets of recordings of the same pictures."""
        return distances(one, other, self.films.size, self.films.span_us)


def drawn(rows: Sequence[Sequence[Events]], size: Size) -> NDArray[np.uint8]:
    """Return events of the first recordings of each row, ON red and OFF blue."""
    picture = []
    for row in rows:
        parts = []
        for events in row[:_PICTURED]:
            counts = np.zeros((2, size.height, size.width))
            np.add.at(counts, (events["p"].astype(int), events["y"], events["x"]), 1.0)
            off, on = np.minimum(counts / 12.0, 1.0)
            bgr = np.stack([1.0 - on, 1.0 - np.maximum(on, off), 1.0 - off], axis=-1)
            large = cv2.resize(bgr, None, fx=_LARGER, fy=_LARGER, interpolation=cv2.INTER_NEAREST)
            parts.append(np.pad(large, ((4, 4), (4, 4), (0, 0)), constant_values=0.6))
        picture.append(np.concatenate(parts, axis=1))
    return np.rint(255.0 * np.concatenate(picture)).astype(np.uint8)


@click.command(help=__doc__)
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("-c", "--config", "configs", multiple=True, help=f"[default: {' '.join(_CONFIGS)}]")
@click.option("--size", default="34x34", show_default=True, help="Of the sensor.")
@click.option("--events", "suffix", default=".bin", show_default=True, help="Suffix of recordings.")
@threads_option
@output_option
@one_line_errors()
def main(
    data: Path,
    configs: tuple[str, ...],
    size: str,
    suffix: str,
    threads: int | None,
    output: Path | None,
) -> None:
    width, height = parse_size(size)
    sensor = Sensor(width=width, height=height)
    recordings = read_recordings(pairs_of(data, suffix), sensor)
    halves = Halves(recordings, threads or default_threads())
    rows, numbers, pictured = [], {}, []
    for name in configs or _CONFIGS:
        found, made, levels = halves.judged(name)
        means = {key: float(np.mean([one[key] for one in found])) for key in DISTANCES}
        floor = halves.apart(*made[:2])
        numbers[name] = {"distances": means, "floor": floor, "thresholds": levels}
        rows.append([Path(name).stem, levels, *(f"{means[key]:.3f}" for key in DISTANCES)])
        rows.append(["its floor", "", *(f"{floor[key]:.3f}" for key in DISTANCES)])
        pictured.append(made[0])
    text = table(["configuration", "thresholds", *_SHORT], rows)
    about = "\n".join(f"- {short}: {name}" for short, name in zip(_SHORT, DISTANCES, strict=True))
    write_report(f"{text}\n\n{about}", output, numbers)
    if output is not None:
        picture = drawn([halves.measured, *pictured], recordings.films.size)
        cv2.imwrite(str(output.with_suffix(".png")), picture)


if __name__ == "__main__":
    main()
