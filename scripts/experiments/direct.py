#!/usr/bin/env python
"""Direct comparison: how far the events of simulators are from measured ones.

The frames of a recording go into each simulator at their own times.  What comes out is compared
with the recording's events over its frame intervals, as in Table 1 of the paper, which does not say
how its distance is defined: it is given in each of the ways it can be read, beside relative ones.
Each comes with its floor.  One Markdown table a recording::

    python scripts/experiments/direct.py slider_depth.zip cradle -o direct.md
    python scripts/experiments/direct.py urban --events v2ce=v2ce.npz@start --match-totals

RECORDING is a folder or zip in the layout of the DAVIS240C data set (urban.zip, slider_depth.zip
and others, "Text (zip)" at rpg.ifi.uzh.ch/davis_data.html), or a folder with images.txt and
events.npz.  Where a camera recorded nothing for a while, simulated events are left out.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from writing import as_written, output_option, table, write_report

from adv2e.comparison.compare import Floor, half_split
from adv2e.comparison.distances import MEASURES, distances
from adv2e.comparison.windows import Windows
from adv2e.diagnosis.fitting.fitter import TOLERANCE
from adv2e.events import Events, empty_events
from adv2e.sources.times.rates import seconds
from experiments import side_by_side
from experiments.clip import Simulator
from experiments.recordings import SCORE, Judged, Recording, all_but_one, halves, read
from experiments.simulators import Pixel, interpolated, natures, simulator_options

HEADER = (
    "Configurations named after a tool are that tool's parameters in the pixel of adv2e, not the"
    " tool.\n\n"
    "Pairs are simulated / measured; events and ON share are those of the intervals compared."
    " Distances are value (floor), the floor being the distance between seeds of the same"
    " configuration. †: its seeds give the same events; its floor is between random references to"
    " start from."
    " still: events a second of a pixel whose grey value, and that of its neighbours, keeps still."
    " Half split: distance between two halves of the measured events, split by chance. As far as"
    " events are a Poisson process, their true rate would come about as near."
)
COLUMNS = {
    "bins_shared_window": "shared window",
    "bins_own_span": "own window",
    "bins_z_scored": "z-scored",
    "relative_5_bins": "5 bins",
    "relative_5_bins_smoothed": "smoothed 5",
    "relative_1_bin_smoothed": "smoothed 1",
    "error": "over time",
}
"""Measures and what the table calls them."""


@click.command(help=as_written(__doc__))
@click.option(
    "--page", "pages", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="Write a page a table there: measured and simulated events frame by frame.",
)  # fmt: skip
@click.option(
    "--match-totals", "matching", is_flag=True,
    help="Add a table: thresholds set so that the totals of the first half of the frame intervals"
    " match, judged on the second.",
)  # fmt: skip
@click.option(
    "--leave-one-out", "leaving", is_flag=True,
    help="Add a table for each frame interval: thresholds set so that the totals of all others"
    " match, judged on it. For recordings of a few frames.",
)  # fmt: skip
@click.option(
    "--interpolation", "interpolations", multiple=True, metavar="NAME",
    help="linear, flow or a network's ONNX file: each configuration of adv2e has a row with it."
    " Repeatable. Without: as configured.",
)  # fmt: skip
@click.option(
    "--seeds", type=click.IntRange(min=2), default=2, show_default=True,
    help="Simulations of each; values are their means, floors the means over their pairs.",
)  # fmt: skip
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True)
@simulator_options
@output_option
def main(
    recordings: tuple[str, ...], simulators: list[Simulator], seeds: int, matching: bool,
    leaving: bool, interpolations: tuple[str, ...], pages: Path | None, output: Path | None,
) -> None:  # fmt: skip
    if interpolations:
        simulators = interpolated(simulators, interpolations)
    parts = [HEADER, natures(simulators)]
    numbers: dict[str, Any] = {"simulators": {one.name: one.nature for one in simulators}}
    for path in recordings:
        measured = read(path)
        for problem in measured.problems:
            _say(f"{path}: {problem}")
        shipped = {one.name: one for one in simulators}
        trials = [Trial(measured, shipped, measured.windows, "thresholds as shipped")]
        if matching:
            trials.append(with_matched_totals(measured, simulators))
        if leaving:
            trials += with_one_left_out(measured, simulators)
        for trial in trials:
            rows = trial.judged(seeds)
            parts.append(trial.section(rows))
            numbers[trial.heading] = {label: row.numbers() for label, row in rows.items()}
            if pages is not None:
                name = f"{measured.name} {trial.title}".replace(" ", "-")
                side_by_side.write(pages / f"{name}.html", trial.page(rows))
    write_report("\n\n".join([*parts, definitions()]), output, numbers)


def _say(text: str) -> None:
    click.echo(text, err=True)


@dataclass(frozen=True)
class Row:
    """A simulator on a recording: means over seeds, events of its first, whether all are equal."""

    judged: Judged
    events: Events
    repeats: bool

    def numbers(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        made = self.judged.made
        told = {"events": made.events, "on_share": made.on_share, "still_hz": made.still_hz}
        return {"distances": self.judged.values, "floors": self.judged.floor, **told}


def with_matched_totals(measured: Recording, simulators: Sequence[Simulator]) -> Trial:
    """Return the trial of simulators whose totals match on the first half, on the second."""
    first, second = halves(measured.windows)
    return _matched(
        measured, simulators, first, second, "totals matched before", f"from {_span(first)}"
    )


def with_one_left_out(measured: Recording, simulators: Sequence[Simulator]) -> Iterator[Trial]:
    """Yield trials of simulators whose totals match on all frame intervals but one, on that."""
    for others, one in all_but_one(measured.windows):
        title, where = f"totals matched outside {_span(one)}", "in the other frame intervals"
        yield _matched(measured, simulators, others, one, title, where)


def _matched(
    measured: Recording, simulators: Sequence[Simulator], fit: Windows, judge: Windows, title: str,
    where: str,
) -> Trial:  # fmt: skip
    found = measured.all_matched(simulators, fit)
    about = (
        "Thresholds, each in the unit of its simulator, are such that the totals of ON and of OFF"
        f" events match {where}; (!): they do not, to {TOLERANCE:.0%}."
    )
    return Trial(measured, found, judge, title, about)


def _span(windows: Windows) -> str:
    return f"{seconds(windows.start * 1000)} to {seconds(windows.stop * 1000)} s"


class Trial:
    """Simulators, by label, on some of the frame intervals of a recording."""

    def __init__(
        self, real: Recording, simulators: Mapping[str, Simulator], windows: Windows, title: str,
        about: str = "",
    ) -> None:  # fmt: skip
        self.real, self.windows, self.title, self.about = real, windows, title, about
        self.simulators = simulators
        self.heading = f"{real.name}: {title}"

    def judged(self, seeds: int) -> dict[str, Row]:
        """Return a row a simulator, by label."""
        found = {}
        for label, simulator in self.simulators.items():
            row = self.judge(simulator, seeds)
            found[label + " †" * row.repeats] = row
            made = f"{row.judged.made.events:,.0f} events, {_span(self.windows)}"
            _say(f"{self.real.name}: {label}: {made}")
        return found

    def judge(self, simulator: Simulator, seeds: int) -> Row:
        """Return how far a simulator is, means over seeds."""
        streams = self.real.made(simulator, self.windows, range(seeds))
        found = self.real.against(streams, self.windows)
        repeats = all(np.array_equal(streams[0], one) for one in streams[1:])
        if repeats:
            floor: Floor = dict.fromkeys(found.floor)
            if isinstance(simulator, Pixel):
                other = simulator.from_random_references()
                others = self.real.made(other, self.windows, range(seeds))
                floor = self.real.against(others, self.windows).floor
            found = replace(found, floor=floor)
        return Row(found, streams[0], repeats)

    def section(self, rows: Mapping[str, Row]) -> str:
        """Return heading, what is compared, and the table of the rows and of what to go by."""
        real, windows = self.real, self.windows
        compared = (
            f"{real.size[0]}x{real.size[1]} pixels, {np.count_nonzero(real.still):,} of them still;"
            f" {len(windows.used)} of {windows.total} frame intervals, {_span(windows)}."
        )
        if real.silences:
            silent = sum(stop - start for start, stop in real.silences)
            compared += (
                f" The camera recorded nothing for {silent / 1e6:.2f} s, which are left out."
            )
        judged = {label: row.judged for label, row in rows.items()}
        marks = {
            "half split (Poisson)": half_split(real.events, windows, *real.size),
            "no events at all": distances(real.events, empty_events(), windows, *real.size).values,
        }
        text = markdown(judged, marks)
        return f"## {self.heading}\n\n{f'{compared} {self.about}'.strip()}\n\n{text}"

    def page(self, rows: Mapping[str, Row]) -> str:
        """Return measured and simulated events frame by frame, as HTML."""
        real, used = self.real, self.windows.used
        wanted = {start for start, _ in used}
        frames = {
            int(t_us): np.clip(light, 0, 255).astype(np.uint8)
            for t_us, light in zip(real.times_us, real.clip.frames, strict=True)
            if t_us in wanted
        }
        measured = real.seen(real.events, self.windows)
        columns = [side_by_side.Column("measured", "the camera", measured)]
        for (label, row), simulator in zip(rows.items(), self.simulators.values(), strict=True):
            scores = distances(measured, row.events, self.windows, *real.size).per_window[SCORE]
            columns.append(side_by_side.Column(label, simulator.nature, row.events, scores))
        about = f"Numbers with two digits: {COLUMNS[SCORE]}, {MEASURES[SCORE].definition}."
        return side_by_side.page(self.heading, frames, used, real.size, columns, about)


def definitions() -> str:
    """Return what each distance is, as a list."""
    lines = [f"- {COLUMNS[name]}: {about.definition}." for name, about in MEASURES.items()]
    return "\n".join(["## Distances", "", *lines])


def markdown(judged: Mapping[str, Judged], marks: Mapping[str, Floor]) -> str:
    """Return the table of simulators, and of the marks to go by."""
    names = ["simulator", "events", "ON share", *COLUMNS.values(), "still"]
    rows = [[label, *_cells(one)] for label, one in judged.items()]
    for label, found in marks.items():
        rows.append([label, "", "", *(number(found[name]) for name in COLUMNS), ""])
    return table(names, rows)


def _cells(judged: Judged) -> list[str]:
    made, measured = judged.made, judged.measured
    ratio = made.events / measured.events if measured.events else None
    return [
        f"{made.events:,.0f} / {measured.events:,.0f} ({number(ratio)})",
        f"{number(made.on_share)} / {number(measured.on_share)}",
        *(f"{number(judged.values[name])} ({number(judged.floor[name])})" for name in COLUMNS),
        f"{number(made.still_hz)} / {number(measured.still_hz)}",
    ]


def number(value: float | None) -> str:
    """Return a number with as many digits as count, or a dash for None."""
    if value is None:
        return "-"
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"


if __name__ == "__main__":
    main()
