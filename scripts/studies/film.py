#!/usr/bin/env python
"""How near simulators come to measured recordings of known pictures.

DATA is a folder of recordings with a picture each: ``60001.bin`` and ``60001.png``, as N-MNIST has
them.  How the camera saw the pictures is fitted once, to every second recording, and is the same
for all simulators (``--view``: the configuration with which it is fitted).  Then the thresholds of
each are fitted such that its totals of ON and OFF on these recordings are right.  The table is of
the other recordings::

    python scripts/studies/film.py DATA -o film.md
    python scripts/studies/film.py DATA --simulators ideal,atis,eventcv --train MORE -o film.md

``--train`` is a folder of more recordings of the same kind, whose pictures nobody needs.  With it
and ``labels.txt`` in both folders (a file and its class on each line), the table has the share of
recordings whose class the nearest neighbours among the measured ones tell, and a second table
compares the simulated recordings with those in numbers that need no picture; for it, each motion
of the camera is shifted and stretched in time as their mean course says.

Beside the table lies a picture: events of three recordings, measured and by each simulator.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from experiments.clip import Clip, Simulator
from experiments.recordings import matched
from experiments.simulators import Pixel, natures, simulator_options
from numpy.typing import NDArray
from writing import output_option, table, write_report

from adv2e import load_config, read_events
from adv2e.background import default_threads
from adv2e.config.model import Sensor
from adv2e.diagnosis.configurations import of_known_light
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.film.diagnose import halves_of
from adv2e.diagnosis.film.fitting import FilmFitter
from adv2e.diagnosis.film.nearness import DISTANCES, distances, gaps
from adv2e.diagnosis.film.recordings import FilmRecordings, Pair, read_recordings, split
from adv2e.diagnosis.film.registration import first_view
from adv2e.diagnosis.film.selection import FilmSearch
from adv2e.diagnosis.film.view import Films, View
from adv2e.diagnosis.fitting.fitter import TOLERANCE, threshold_nuisance
from adv2e.events import Events, by_time
from adv2e.geometry import Size, parse_size

_PICTURED, _LARGER = 3, 6
_SHORT = ("totals", "spread", "1 - corr", "course", "gaps", "1 - maps", "c2st")
_NEIGHBOURS = 5
_COURSE_US = 5_000.0
_STRETCHES, _SHIFTS_US = np.linspace(0.9, 1.1, 21), np.arange(-10_000.0, 10_001.0, 500.0)

Recordings = Sequence[Events]


def pairs_of(folder: Path, suffix: str) -> list[Pair]:
    """Return the recordings of a folder that have a picture, with it."""
    found = [(path, path.with_suffix(".png")) for path in sorted(folder.glob(f"*{suffix}"))]
    return [pair for pair in found if pair[1].is_file()]


def classes_of(folder: Path) -> dict[str, str]:
    """Return the class of each file that ``labels.txt`` of a folder names."""
    path = folder / "labels.txt"
    rows = [line.split() for line in path.read_text("utf-8").splitlines()] if path.is_file() else []
    return {Path(row[0]).stem: row[-1] for row in rows if len(row) > 1 and row[0] != "#"}


@dataclass(frozen=True)
class Half:
    """Recordings, their films as a camera sees them, and events that simulators make of these."""

    fitter: FilmFitter
    view: View

    @property
    def films(self) -> Films:
        """Films of the recordings."""
        return self.fitter.films

    @property
    def measured(self) -> Recordings:
        """Events of each recording, on the clock of the path."""
        return split(self.fitter.measured, len(self.films.pictures))

    def stream(self, simulator: Simulator, seed: int) -> Stream:
        """Return the events that a simulator makes, all recordings side by side."""
        light = self.films.light(self.view)
        events = simulator.events(Clip(light, self.films.times_ns), seed)
        return self.fitter.recorded(Stream.of(events, light.shape[2], light.shape[1]))

    def made(self, simulator: Simulator, seed: int) -> Recordings:
        """Return the events that a simulator makes of each film."""
        return split(self.stream(simulator, seed), len(self.films.pictures))

    def totals(self, simulator: Simulator) -> tuple[int, int]:
        """Return the numbers of ON and OFF events that a simulator makes."""
        return _totals(self.stream(simulator, 0))


def _totals(stream: Stream) -> tuple[int, int]:
    ons = int(np.count_nonzero(stream.on))
    return ons, len(stream) - ons


def halves(recordings: FilmRecordings, view_by: str, threads: int) -> tuple[Half, Half]:
    """Return recordings to fit to, and those to judge by, with the view that was fitted."""
    config = of_known_light(load_config([view_by], ["pixel.initial_reference=random"]))
    fitter, judge = halves_of(recordings, threads)
    search = FilmSearch(fitter, judge, threshold_nuisance(config), threads, _say, _say)
    place = search.start(first_view(fitter.films, fitter.measured), config).place
    return Half(fitter, place.view), Half(judge, place.view)


_say = partial(click.echo, err=True)


class Neighbours:
    """Classes told by the nearest of measured recordings, by their maps of ON and of OFF events."""

    def __init__(self, recordings: Recordings, classes: Sequence[str], size: Size) -> None:
        self._size, self._classes = size, np.array(classes)
        self._known = np.array([self._seen(one) for one in recordings])

    def _seen(self, events: Events) -> NDArray[np.float64]:
        maps = np.zeros((2, self._size.height, self._size.width))
        np.add.at(maps, (events["p"].astype(int), events["y"], events["x"]), 1.0)
        return np.asarray(maps.ravel() / max(float(np.linalg.norm(maps)), 1e-9))

    def right(self, recordings: Recordings, classes: Sequence[str]) -> float:
        """Return the share of recordings whose class they tell."""
        found = []
        for events, true in zip(recordings, classes, strict=True):
            nearest = np.argsort(-(self._known @ self._seen(events)), kind="stable")[:_NEIGHBOURS]
            names, often = np.unique(self._classes[nearest], return_counts=True)
            found.append(names[np.argmax(often)] == true)
        return float(np.mean(found))


def course(recordings: Recordings, span_us: tuple[float, float]) -> NDArray[np.float64]:
    """Return the shares of all events in short times."""
    bins = np.arange(span_us[0], span_us[1] + _COURSE_US, _COURSE_US)
    counts = np.sum([np.histogram(one["t"], bins)[0] for one in recordings], axis=0)
    return np.asarray(counts / max(counts.sum(), 1))


def without_pictures(
    measured: Recordings, simulated: Recordings, rests_us: Sequence[float], size: Size
) -> dict[str, float]:
    """Return distances of recordings of unlike pictures, after each motion has moved in time."""
    span = 0.0, float(max(one["t"][-1] for one in measured if len(one)))
    edges = np.array([-np.inf, *rests_us, np.inf])
    wanted = course(measured, span)
    moved = [one.copy() for one in simulated]
    bins = np.arange(span[0], span[1] + _COURSE_US, _COURSE_US)
    for k, (low, high) in enumerate(pairwise(edges)):
        own = [(one["t"] > low) & (one["t"] <= high) for one in simulated]
        inside = (bins[:-1] > low) & (bins[1:] <= high)
        t = np.concatenate([one["t"][at] for one, at in zip(simulated, own, strict=True)])
        about = float(np.mean(t))
        best = np.inf, 0.0, 1.0
        for stretch in _STRETCHES:
            for shift in _SHIFTS_US:
                there = np.histogram(about + (t - about) * stretch + shift, bins)[0][inside]
                share = there / max(there.sum(), 1) * wanted[inside].sum()
                apart = float(np.abs(share - wanted[inside]).sum())
                best = min(best, (apart, float(shift), float(stretch)))
        _, shift, stretch = best
        _say(f"motion {k + 1}: {shift / 1000:+.1f} ms, {stretch:.2f} times as long")
        for one, at in zip(moved, own, strict=True):
            one["t"][at] = np.rint(about + (one["t"][at] - about) * stretch + shift)

    def shares(recordings: Recordings) -> NDArray[np.float64]:
        counts = np.sum([gaps(by_time(one), size) for one in recordings], axis=0)
        return np.asarray(counts / max(counts.sum(), 1))

    number, made = (np.array([len(one) for one in side], float) for side in (measured, simulated))
    return {
        "events a recording, simulated / measured": float(made.mean() / number.mean()),
        "spread of ln of events over recordings, simulated": float(np.log(made).std()),
        "the same, measured": float(np.log(number).std()),
        "share of ON, simulated": float(np.concatenate([one["p"] for one in simulated]).mean()),
        "the same, measured ": float(np.concatenate([one["p"] for one in measured]).mean()),
        "course": float(np.abs(course(moved, span) - wanted).sum()),
        "gaps": float(np.abs(shares(moved) - shares(measured)).sum()),
    }


def drawn(rows: Sequence[Recordings], size: Size) -> NDArray[np.uint8]:
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


def _of_means(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: float(np.mean([one[key] for one in rows])) for key in rows[0]}


@click.command(help=__doc__)
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--view", "view_by", default="ideal", show_default=True, metavar="CONFIG",
              help="Configuration with which the view of the pictures is fitted.")  # fmt: skip
@click.option("--train", type=click.Path(exists=True, file_okay=False, path_type=Path),
              help="Folder of more recordings, with labels.txt.")  # fmt: skip
@click.option("--size", default="34x34", show_default=True, help="Of the sensor.")
@click.option("--suffix", default=".bin", show_default=True, help="Suffix of recordings.")
@click.option("--seeds", default=4, show_default=True, type=click.IntRange(2))
@simulator_options
@output_option
def main(
    data: Path, view_by: str, train: Path | None, size: str, suffix: str, seeds: int,
    simulators: list[Simulator], output: Path | None,
) -> None:  # fmt: skip
    area = parse_size(size)
    pairs = pairs_of(data, suffix)
    recordings = read_recordings(pairs, Sensor(width=area.width, height=area.height))
    fit, judge = halves(recordings, view_by, default_threads())
    names = [Path(path).stem for path, _ in pairs][1::2]
    goal = _totals(fit.fitter.measured)
    others, neighbours = _others(train, suffix, area)
    classes = classes_of(data)
    true = [classes[name] for name in names] if neighbours and classes else None
    short = [*_SHORT, "classes"] if true and neighbours else [*_SHORT]
    rows, more, pictured = [], [], [judge.measured]
    numbers: dict[str, Any] = {}
    for simulator in simulators:
        ready = simulator.from_random_references() if isinstance(simulator, Pixel) else simulator
        ready, miss = matched(ready, goal, fit.totals)
        made = [judge.made(ready, seed) for seed in range(100, 100 + seeds)]
        found = [_apart(judge, judge.measured, one) for one in made]
        means, floor = _of_means(found), _apart(judge, *made[:2])
        told = [f"{means[key]:.3f}" for key in DISTANCES]
        numbers[simulator.name] = {"distances": means, "floor": floor, "thresholds": ready.levels}
        if true and neighbours:
            share = float(np.mean([neighbours.right(one, true) for one in made]))
            numbers[simulator.name]["classes"] = share
            told.append(f"{share:.2f}")
        levels = "" if ready.levels is None else "{:.3f}, {:.3f}".format(*ready.levels)
        rows.append([simulator.name, levels + " (!)" * (miss > TOLERANCE), *told])
        pictured.append(made[0])
        _say(f"{simulator.name}: {' '.join(told)}")
        if others:
            apart = [without_pictures(others, one, judge.fitter.rests_us, area) for one in made]
            numbers[simulator.name]["without pictures"] = _of_means(apart)
            values = (f"{value:.3f}" for value in _of_means(apart).values())
            more.append([simulator.name, *values])
    floor_row = [f"{floor[key]:.3f}" for key in DISTANCES]
    if true and neighbours:
        floor_row.append(f"{neighbours.right(judge.measured, true):.2f}")
    rows.append(["two seeds of the last; classes: measured events", "", *floor_row])
    about = "\n".join(f"- {key}: {name}" for key, name in zip(_SHORT, DISTANCES, strict=True))
    parts = [natures(simulators), table(["simulator", "thresholds", *short], rows), about]
    if more:
        head = ["simulator", *numbers[simulators[0].name]["without pictures"]]
        parts += [
            f"{len(others)} other recordings, whose pictures are not known",
            table(head, more),
        ]
    write_report("\n\n".join(parts), output, numbers)
    if output is not None:
        cv2.imwrite(str(output.with_suffix(".png")), drawn(pictured, area))


def _others(folder: Path | None, suffix: str, size: Size) -> tuple[Recordings, Neighbours | None]:
    if folder is None:
        return [], None
    paths = sorted(folder.glob(f"*{suffix}"))
    found = [read_events(path, size=tuple(size)).events for path in paths]
    classes = classes_of(folder)
    if not all(path.stem in classes for path in paths):
        return found, None
    return found, Neighbours(found, [classes[path.stem] for path in paths], size)


def _apart(half: Half, one: Recordings, other: Recordings) -> dict[str, float]:
    return distances(one, other, half.films.size, half.films.span_us)


if __name__ == "__main__":
    main()
