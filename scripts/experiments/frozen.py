#!/usr/bin/env python
"""Frozen networks: whether pretrained ones see in simulated events what they see in measured.

FireNet and FireNet+ reconstruct images from the measured events and from those that simulators make
of the recording's frames.  All is judged on the second half of the frame intervals, beside the
distance of the events, rates of still pixels and totals.  Nothing is fitted to that half.  One
Markdown table a recording, and with ``--match-totals`` a second one that takes out the difference
in thresholds::

    python scripts/experiments/frozen.py weights cradle slider_depth --match-totals -o frozen.md

WEIGHTS is a folder with ``firenet.pth`` and ``firenet_plus.pth``: the files ``model.pth`` in
``pretrained/FireNet`` and ``pretrained/FireNet+`` of github.com/ercanburak/EVREAL.  RECORDING: see
``direct.py``.  Needs PyTorch, and about a minute a recording.

FireNet, FireNet+
    Mean structural similarity (SSIM, 1 for equal images) of what the frozen network reconstructs
    from the simulated events with what it reconstructs from the measured ones, frame interval by
    frame interval of the second half, from a state of zeros.
distance
    ``relative_5_bins_smoothed`` of :mod:`adv2e.comparison.distances`; 1 is as far as no events.
still
    Events a second of a pixel whose frames keep still (:func:`real.recording.still_pixels`), of
    those below and above `DARK_DN`.
ON share, events
    Of all events, and their number over the measured one.

Beside them stand floors: the same between two seeds, between a half of the measured events and all
of them, and between the measured events and themselves with times that jitter by `JITTER_MS`.  The
last tells what this experiment cannot see: times.

A simulator is *behind* ideal in a measure where it is farther from the measured value than
``ideal`` in the same table by more than the margin of `MARGINS`.  Similarity and distance are as
they are; rates and events are judged by how far their logarithm is off, with `LEAST` events added
to counts of still pixels, so that no event at all has a logarithm; the ON share by its difference.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from networks.firenet import NETWORKS, Images, Network
from numpy.typing import NDArray
from real.measures import likeness, similarity
from real.model import SCORE, Bench
from real.recording import halves, read
from writing import as_written, output_option, table, write_report

from adv2e.comparison.distances import distances
from adv2e.comparison.floor import half_split
from adv2e.comparison.windows import Windows
from adv2e.errors import DataError
from adv2e.events import Events, cut, empty_events, sort_events
from experiments.recordings import Measured, trial_options
from experiments.simulators.clip import Simulator
from experiments.simulators.named import natures, simulator_options

REFERENCE = "ideal"
JITTER_MS = 2.0
"""Standard deviation of the times of the third floor [ms]."""
DARK_DN = 10.0
"""Still pixels are told of below and above this grey value [DN of 255]."""
LEAST = 3.0
MARGINS = {
    **dict.fromkeys(NETWORKS, 0.01),
    "distance": 0.02,
    "ON share": 0.01,
    "events": 0.05,
    **dict.fromkeys(("dark ON", "dark OFF", "bright ON", "bright OFF"), 0.2),
}
"""By how much a measure must be worse than the reference's to count."""


@dataclass(frozen=True)
class Still:
    """The still pixels of a recording, by name of the part of the picture, and time recorded."""

    parts: dict[str, NDArray[np.bool_]]
    duration_s: float

    @classmethod
    def of(cls, measured: Measured, windows: Windows) -> Still:
        """Return those of a recording; parts without still pixels are left out."""
        still, dark = measured.real.still, measured.clip.frames.mean(axis=0) < DARK_DN
        parts = {"dark": still & dark, "bright": still & ~dark}
        silent = sum(
            max(0, min(stop, windows.stop) - max(start, windows.start))
            for start, stop in measured.silences
        )
        used = {name: mask for name, mask in parts.items() if mask.any()}
        return cls(used, windows.duration_s - 1e-6 * silent)

    def counts(self, events: Events) -> dict[str, float]:
        """Return numbers of events by part and polarity."""
        found = {}
        for name, mask in self.parts.items():
            there = mask[events["y"], events["x"]]
            for sign, value in (("ON", 1), ("OFF", 0)):
                found[f"{name} {sign}"] = float(np.count_nonzero(there & (events["p"] == value)))
        return found

    def exposure(self, name: str) -> float:
        """Return how many pixel seconds a count is of."""
        return self.duration_s * float(np.count_nonzero(self.parts[name.split(maxsplit=1)[0]]))


@dataclass(frozen=True)
class Row:
    """One simulator, or the measured events, by name of the measure.

    Attributes
    ----------
    label : str
    values : mapping
        None where there is nothing to tell.
    floors : mapping
        Between seeds.
    images : mapping of network to images
    """

    label: str
    values: dict[str, float | None]
    floors: dict[str, float | None]
    images: dict[str, Images]

    def error(self, measured: Row, name: str, exposure: float = 1.0) -> float | None:
        """Return how far a measure is from the measured value, larger for farther."""
        value, goal = self.values.get(name), measured.values.get(name)
        if value is None:
            return None
        if name in NETWORKS:
            return 1.0 - value
        if name == "distance" or goal is None:
            return value
        if name == "ON share":
            return abs(value - goal)
        if name == "events":
            return abs(float(np.log(max(value, 1e-9))))
        return abs(float(np.log((value * exposure + LEAST) / (goal * exposure + LEAST))))


class Judge:
    """Judges streams against the second half of a recording.

    Parameters
    ----------
    measured : Measured
    networks : sequence of Network
    """

    def __init__(self, measured: Measured, networks: Sequence[Network]) -> None:
        self.measured, self.real, self.networks = measured, measured.real, networks
        self.first, self.test = halves(self.real.windows)
        self.still = Still.of(measured, self.test)
        self.events = cut(self.real.events, self.test.start, self.test.stop)
        self.images = self.reconstructed(self.events)

    def reconstructed(self, events: Events) -> dict[str, Images]:
        """Return what the networks make of a stream, an image a frame interval."""
        parts = [cut(events, *window) for window in self.test.used]
        return {one.name: one.images(parts, self.real.size) for one in self.networks}

    def simulated(self, simulator: Simulator, label: str, seeds: int) -> Row:
        """Return how near a simulator is, means over seeds."""
        streams = self.measured.made(simulator, self.test, range(seeds))
        judged = Bench(self.real, None).against(streams, self.test)
        images = [self.reconstructed(one) for one in streams]
        values = _means([self._of_stream(*one) for one in zip(streams, images, strict=True)])
        values["distance"] = judged.values[SCORE]
        floors = {name: alike(images[0][name], images[-1][name]) for name in self.images}
        return Row(label, values, {**floors, "distance": judged.floor[SCORE]}, images[0])

    def of_the_camera(self) -> Row:
        """Return the measured events as a row."""
        return Row("measured", self._of_stream(self.events, self.images), {}, self.images)

    @cached_property
    def half(self) -> Row:
        """Return a half of the measured events, by the toss of a coin, against all of them."""
        chosen = np.random.default_rng(0).random(len(self.events)) < 0.5
        images = self.reconstructed(self.events[chosen])
        values: dict[str, float | None] = self._alike(images)
        values["distance"] = half_split(self.events, self.test, *self.real.size)[SCORE]
        return Row("half of the measured events", values, {}, images)

    @cached_property
    def jittered(self) -> Row:
        """Return the measured events with times that jitter, against themselves."""
        events = self.events.copy()
        apart = np.random.default_rng(0).normal(0.0, 1e3 * JITTER_MS, len(events))
        last = self.test.stop - 1
        events["t"] = np.clip(np.rint(events["t"] + apart), self.test.start, last)
        events = sort_events(events)
        images = self.reconstructed(events)
        found = distances(self.events, events, self.test, *self.real.size).values[SCORE]
        values = {**self._alike(images), "distance": found}
        return Row(f"measured, times jittered by {JITTER_MS:g} ms", values, {}, images)

    @cached_property
    def nothing(self) -> Row:
        """Return what no events at all come to."""
        images = self.reconstructed(empty_events())
        return Row("no events at all", {**self._alike(images), "distance": 1.0}, {}, images)

    def loaded(self) -> Iterator[str]:
        """Yield how a network's images of the measured events resemble the frames.

        Raises
        ------
        DataError
            Not more than the frames mirrored: the weights are not read as they are meant.
        """
        stops = [stop for _, stop in self.test.used]
        times = self.real.times_us[self.real.used]
        frames = self.measured.clip.frames[np.isin(times, stops)]
        for name, images in self.images.items():
            pairs = list(zip(images, frames, strict=True))
            like = float(np.mean([likeness(*pair) for pair in pairs]))
            chance = float(np.mean([likeness(a, b[:, ::-1]) for a, b in pairs]))
            if like <= chance:
                raise DataError(
                    f"{self.real.name}: images of {name} resemble the frames ({like:.2f}) no more"
                    f" than mirrored ones ({chance:.2f}): are these its weights?"
                )
            yield f"{name} {like:.2f} (mirrored {chance:.2f})"

    def _of_stream(self, events: Events, images: dict[str, Images]) -> dict[str, float | None]:
        counts = self.still.counts(events)
        return {
            **self._alike(images),
            **{name: count / self.still.exposure(name) for name, count in counts.items()},
            "ON share": float(np.mean(events["p"])) if len(events) else None,
            "events": len(events) / len(self.events),
        }

    def _alike(self, images: dict[str, Images]) -> dict[str, float | None]:
        return {name: alike(images[name], self.images[name]) for name in self.images}

    def behind(self, row: Row, reference: Row, measured: Row) -> list[str]:
        """Return the measures in which a row is farther than the reference beyond the margin."""
        names = []
        for name, margin in MARGINS.items():
            exposure = self.still.exposure(name) if name in self._still_names() else 1.0
            mine, other = (one.error(measured, name, exposure) for one in (row, reference))
            if mine is not None and other is not None and mine > other + margin:
                names.append(name)
        return names

    def _still_names(self) -> list[str]:
        return [f"{part} {sign}" for part in self.still.parts for sign in ("ON", "OFF")]


def alike(images: Images, others: Images) -> float:
    """Return the mean similarity of images one by one."""
    return float(np.mean([similarity(*pair) for pair in zip(images, others, strict=True)]))


def _means(found: Sequence[dict[str, float | None]]) -> dict[str, float | None]:
    means = {}
    for name in found[0]:
        values = [one[name] for one in found]
        there = [value for value in values if value is not None]
        means[name] = float(np.mean(there)) if there else None
    return means


@click.command(help=as_written(__doc__))
@click.argument("weights", type=click.Path(path_type=Path))
@click.option(
    "--pictures",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write the last images: a row a network; measured, half of it, simulators in order.",
)
@trial_options
@simulator_options
@output_option
def main(
    weights: Path,
    recordings: tuple[str, ...],
    simulators: list[Simulator],
    seeds: int,
    matching: bool,
    pictures: Path | None,
    output: Path | None,
) -> None:
    networks = [Network(name, weights) for name in NETWORKS]
    parts, numbers = [natures(simulators)], {}
    for path in recordings:
        judge = Judge(Measured(read(path)), networks)
        like = ", ".join(judge.loaded())
        tables = {"thresholds as shipped": {one.name: one for one in simulators}}
        if matching:
            tables["totals matched before"] = judge.measured.all_matched(simulators, judge.first)
        for title, each in tables.items():
            heading = f"{judge.real.name}: {title}"
            rows = [judge.simulated(one, label, seeds) for label, one in each.items()]
            text, found = section(judge, rows)
            about = f"Images of the measured events correlate with the frames: {like}."
            parts.append(f"## {heading}\n\n{about}\n\n{text}")
            numbers[heading] = found
            click.echo(f"{heading} done", err=True)
            if pictures is not None:
                pictures.mkdir(parents=True, exist_ok=True)
                name = heading.replace(":", "").replace(" ", "-")
                image = picture([judge.of_the_camera(), judge.half, *rows])
                cv2.imwrite(str(pictures / f"{name}.png"), image)
    write_report("\n\n".join(parts), output, numbers)


def section(judge: Judge, rows: Sequence[Row]) -> tuple[str, dict[str, Any]]:
    """Return the table of rows and of what to go by, and its numbers."""
    measured = judge.of_the_camera()
    reference = next((one for one in rows if one.label.split(",")[0] == REFERENCE), None)
    lines, numbers = [], {}
    for row in [*rows, measured, judge.half, judge.jittered, judge.nothing]:
        behind = ""
        if reference is not None and row in rows and row is not reference:
            behind = ", ".join(judge.behind(row, reference, measured)) or "none"
        lines.append([row.label, *cells(row), behind])
        numbers[row.label] = {**row.values, "floors": row.floors, "behind": behind}
    head = ["simulator", "events", "ON share", *NETWORKS, "distance"]
    head += [f"still, {name}, ON / OFF [Hz]" for name in ("dark", "bright")]
    return table([*head, f"behind {REFERENCE} in"], lines), numbers


def cells(row: Row) -> list[str]:
    """Return a row's numbers, between seeds in brackets."""

    def cell(name: str, digits: int = 2) -> str:
        value = row.values.get(name)
        return "" if value is None else f"{value:.{digits}f}"

    def floored(name: str, digits: int) -> str:
        floor = row.floors.get(name)
        return cell(name, digits) + ("" if floor is None else f" ({floor:.{digits}f})")

    networks = [floored(name, 3) for name in NETWORKS]
    still = [
        " / ".join(cell(f"{part} {sign}", 3) for sign in ("ON", "OFF"))
        if f"{part} ON" in row.values
        else ""
        for part in ("dark", "bright")
    ]
    return [cell("events"), cell("ON share"), *networks, floored("distance", 2), *still]


def picture(rows: Sequence[Row]) -> NDArray[np.uint8]:
    """Return the last image of each network (rows) of each stream (columns)."""
    lines = [np.hstack([one.images[name][-1] for one in rows]) for name in rows[0].images]
    return np.asarray(255.0 * np.vstack(lines), np.uint8)


if __name__ == "__main__":
    main()
