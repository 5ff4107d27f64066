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
``direct.py``.  Needs PyTorch, and some minutes a recording.

FireNet, FireNet+
    Mean structural similarity (SSIM, 1 for equal images) of what the frozen network reconstructs
    from the simulated events with what it reconstructs from the measured ones, frame interval by
    frame interval of the second half, from a state of zeros.
distance
    ``relative_5_bins_smoothed`` of :mod:`adv2e.comparison.distances`; 1 is as far as no events.
still
    Events a second of a pixel whose frames keep still (``still_pixels`` of
    :mod:`experiments.recordings`), of those below and above 10 DN.
ON share, events
    Of all events, and their number over the measured one.

Beside them stand floors: the same between two seeds, between a half of the measured events and all
of them, and between the measured events and themselves with times that jitter by 2 ms.  The last
tells what this experiment cannot see: times.

A simulator is *behind* ideal in a measure where it is farther from the measured value than
``ideal`` in the same table by more than a margin (``MARGINS`` of :mod:`experiments.judge`).
Similarity and distance are as they are; rates and events are judged by how far their logarithm is
off, with 3 events added to counts of still pixels, so that no event at all has a logarithm; the ON
share by its difference.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from networks.firenet import NETWORKS, Network
from numpy.typing import NDArray
from writing import as_written, output_option, table, write_report

from experiments.clip import Simulator
from experiments.judge import Judge, Row
from experiments.recordings import read, trial_options
from experiments.simulators import natures, simulator_options

REFERENCE = "ideal"


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
        judge = Judge(read(path), networks)
        like = ", ".join(judge.loaded())
        tables = {"thresholds as shipped": {one.name: one for one in simulators}}
        if matching:
            tables["totals matched before"] = judge.real.all_matched(simulators, judge.first)
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
