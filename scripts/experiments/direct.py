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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from real.model import SCORE, Bench, Judged
from real.recording import Real, halves, read
from real.table import COLUMNS, definitions, markdown, marks, preamble
from writing import as_written, output_option, write_report

from adv2e.comparison.distances import MEASURES, distances
from adv2e.comparison.floor import Floor
from adv2e.comparison.windows import Windows
from adv2e.diagnosis.fitting.nuisances import TOLERANCE
from adv2e.events import Events
from adv2e.sources.times.instants import seconds
from experiments import side_by_side
from experiments.recordings import Measured, trial_options
from experiments.simulators.clip import Simulator
from experiments.simulators.named import natures, simulator_options
from experiments.simulators.pixel import Pixel


@click.command(help=as_written(__doc__))
@click.option(
    "--page",
    "pages",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write a page a table there: measured and simulated events frame by frame.",
)
@trial_options
@simulator_options
@output_option
def main(
    recordings: tuple[str, ...],
    simulators: list[Simulator],
    seeds: int,
    matching: bool,
    pages: Path | None,
    output: Path | None,
) -> None:
    parts = [preamble(), natures(simulators)]
    numbers: dict[str, Any] = {"simulators": {one.name: one.nature for one in simulators}}
    for path in recordings:
        measured = Measured(read(path))
        for problem in measured.real.problems:
            _say(f"{path}: {problem}")
        shipped = {one.name: one for one in simulators}
        trials = [Trial(measured, shipped, measured.real.windows, "thresholds as shipped")]
        if matching:
            trials.append(with_matched_totals(measured, simulators))
        for trial in trials:
            rows = trial.judged(seeds)
            parts.append(trial.section(rows))
            numbers[trial.heading] = {label: row.numbers() for label, row in rows.items()}
            if pages is not None:
                name = f"{measured.real.name} {trial.title}".replace(" ", "-")
                side_by_side.write(pages / f"{name}.html", trial.page(rows))
    write_report("\n\n".join([*parts, definitions()]), output, numbers)


def _say(text: str) -> None:
    click.echo(text, err=True)


@dataclass(frozen=True)
class Row:
    """A simulator on a recording.

    Attributes
    ----------
    judged : Judged
        Means over seeds.
    events : Events
        Of its first seed.
    repeats : bool
        All seeds give the same events.
    """

    judged: Judged
    events: Events
    repeats: bool

    def numbers(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        made = self.judged.made
        told = {"events": made.events, "on_share": made.on_share, "still_hz": made.still_hz}
        return {"distances": self.judged.values, "floors": self.judged.floor, **told}


def with_matched_totals(measured: Measured, simulators: Sequence[Simulator]) -> Trial:
    """Return the trial of simulators whose totals match on the first half, on the second."""
    first, second = halves(measured.real.windows)
    found = measured.all_matched(simulators, first)
    about = (
        "Thresholds, each in the unit of its simulator, are such that the totals of ON and of OFF"
        f" events match from {_span(first)}; (!): they do not, to {TOLERANCE:.0%}."
    )
    return Trial(measured, found, second, "totals matched before", about)


def _span(windows: Windows) -> str:
    return f"{seconds(windows.start * 1000)} to {seconds(windows.stop * 1000)} s"


class Trial:
    """Simulators on some of the frame intervals of a recording.

    Parameters
    ----------
    measured : Measured
    simulators : mapping of str to Simulator
        By label.
    windows : Windows
    title, about : str
    """

    def __init__(
        self,
        measured: Measured,
        simulators: Mapping[str, Simulator],
        windows: Windows,
        title: str,
        about: str = "",
    ) -> None:
        self.measured, self.windows, self.title, self.about = measured, windows, title, about
        self.simulators = simulators
        self.heading = f"{measured.real.name}: {title}"

    @property
    def real(self) -> Real:
        """The recording."""
        return self.measured.real

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
        against = Bench(self.real, None).against
        streams = self.measured.made(simulator, self.windows, range(seeds))
        found = against(streams, self.windows)
        repeats = all(np.array_equal(streams[0], one) for one in streams[1:])
        if repeats:
            floor: Floor = dict.fromkeys(found.floor)
            if isinstance(simulator, Pixel):
                other = simulator.from_random_references()
                others = self.measured.made(other, self.windows, range(seeds))
                floor = against(others, self.windows).floor
            found = replace(found, floor=floor)
        return Row(found, streams[0], repeats)

    def section(self, rows: Mapping[str, Row]) -> str:
        """Return heading, what is compared, and the table of the rows and of what to go by."""
        real, windows = self.real, self.windows
        compared = (
            f"{real.size[0]}x{real.size[1]} pixels, {np.count_nonzero(real.still):,} of them still;"
            f" {len(windows.used)} of {windows.total} frame intervals, {_span(windows)}."
        )
        if self.measured.silences:
            silent = sum(stop - start for start, stop in self.measured.silences)
            compared += (
                f" The camera recorded nothing for {silent / 1e6:.2f} s, which are left out."
            )
        judged = {label: row.judged for label, row in rows.items()}
        text = markdown(judged, marks(real.events, windows, real.size))
        return f"## {self.heading}\n\n{f'{compared} {self.about}'.strip()}\n\n{text}"

    def page(self, rows: Mapping[str, Row]) -> str:
        """Return measured and simulated events frame by frame, as HTML."""
        real, used = self.real, self.windows.used
        wanted = {start for start, _ in used}
        frames = {
            int(t_us): np.clip(light, 0, 255).astype(np.uint8)
            for t_us, light in zip(real.times_us[real.used], self.measured.clip.frames, strict=True)
            if t_us in wanted
        }
        measured = self.measured.seen(real.events, self.windows)
        columns = [side_by_side.Column("measured", "the camera", measured)]
        for (label, row), simulator in zip(rows.items(), self.simulators.values(), strict=True):
            scores = distances(measured, row.events, self.windows, *real.size).per_window[SCORE]
            columns.append(side_by_side.Column(label, simulator.nature, row.events, scores))
        about = f"Numbers with two digits: {COLUMNS[SCORE]}, {MEASURES[SCORE].definition}."
        return side_by_side.page(self.heading, frames, used, real.size, columns, about)


if __name__ == "__main__":
    main()
