#!/usr/bin/env python
"""How far shipped configurations are from real recordings.

The frames of a recording (a folder in the DAVIS240C layout) go in at their own times; what comes
out is compared with the recording's events over its frame intervals.  One Markdown table a folder,
and with ``--match-totals`` a second one that takes out the difference in thresholds::

    python scripts/real/compare.py slider_depth boxes --match-totals -o table.md
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from writing import one_line_errors, output_option, threads_option, write_report

from adv2e.comparison.windows import Windows
from adv2e.config import Config, load_config
from adv2e.config.model import INTERPOLATIONS
from adv2e.diagnosis.fitting.nuisances import TOLERANCE, fit_thresholds
from adv2e.events import cut
from adv2e.sources.times.instants import seconds
from real.model import Bench, Judged, totals
from real.recording import halves, read
from real.table import definitions, markdown, marks, preamble

CONFIGS = "adv2e,paper,v2e,vid2e,ideal"


@dataclass(frozen=True)
class Case:
    """A configuration and what the table calls it."""

    label: str
    config: Config


@click.command()
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True)
@click.option("--configs", default=CONFIGS, show_default=True, help="Shipped names or YAML files.")
@click.option(
    "--seeds",
    type=click.IntRange(min=2),
    default=2,
    show_default=True,
    help="Simulations of each; values are their means, floors the means over their pairs.",
)
@click.option("--interpolation", type=click.Choice(INTERPOLATIONS), help="For all configurations.")
@click.option(
    "--match-totals",
    "matching",
    is_flag=True,
    help="Add a table: thresholds set so that the totals of the first half of the intervals match,"
    " distances on the second.",
)
@threads_option
@output_option
@one_line_errors()
def main(
    folders: tuple[str, ...],
    configs: str,
    seeds: int,
    interpolation: str | None,
    matching: bool,
    threads: int | None,
    output: Path | None,
) -> None:
    """Compare the events of shipped configurations with those of real recordings."""
    cases = _cases(configs.split(","), interpolation)
    parts = [preamble()]
    for folder in folders:
        real = read(folder)
        for problem in real.problems:
            _say(f"{folder}: {problem}")
        bench = Bench(real, threads)
        parts.append(_section(bench, cases, real.windows, seeds, "thresholds as shipped"))
        if matching:
            parts.append(_matched(bench, cases, seeds))
    write_report("\n\n".join([*parts, definitions()]), output)


def _say(text: str) -> None:
    click.echo(text, err=True)


def _cases(names: Sequence[str], interpolation: str | None) -> list[Case]:
    cases = []
    for name in names:
        config = load_config([name])
        label = Path(name).stem
        if interpolation is not None:
            sampling = replace(config.sampling, interpolation=interpolation)
            config = replace(config, sampling=sampling)
            label += f", {interpolation}"
        cases.append(Case(label, config))
    return cases


def _matched(bench: Bench, cases: Sequence[Case], seeds: int) -> str:
    first, second = halves(bench.real.windows)
    matched = [with_totals(bench, case, first) for case in cases]
    title = "totals matched before"
    about = (
        f"Thresholds [ln] are such that the totals of ON and of OFF events match from"
        f" {_span(first)}; (!): they do not, to {TOLERANCE:.0%}."
    )
    return _section(bench, matched, second, seeds, title, about)


def with_totals(bench: Bench, case: Case, windows: Windows) -> Case:
    """Return the case with thresholds that match the totals in the windows."""

    def made(config: Config) -> tuple[int, int]:
        return totals(bench.made(config, windows, [config.seed], in_full=True)[0])

    real = bench.real
    goal = totals(cut(real.events, windows.start, windows.stop))
    config, miss = fit_thresholds(made, case.config, goal)
    on, off = config.pixel.thresholds.on, config.pixel.thresholds.off
    _say(f"{real.name}: {case.label}: ON {on:.3f}, OFF {off:.3f}: totals miss by {miss:.1%}")
    mark = " (!)" if miss > TOLERANCE else ""
    return Case(f"{case.label}, ON {on:.3f} OFF {off:.3f}{mark}", config)


def _section(
    bench: Bench, cases: Sequence[Case], windows: Windows, seeds: int, title: str, about: str = ""
) -> str:
    """Return heading, what is compared, and the table of the cases and the two marks to go by."""
    real = bench.real
    rows = dict(judged(bench, case, windows, seeds) for case in cases)
    compared = (
        f"{real.size[0]}x{real.size[1]} pixels, {np.count_nonzero(real.still):,} of them still;"
        f" {len(windows.used)} of {windows.total} frame intervals, {_span(windows)}. {about}"
    )
    table = markdown(rows, marks(real.events, windows, real.size))
    return f"## {real.name}: {title}\n\n{compared.strip()}\n\n{table}"


def _span(windows: Windows) -> str:
    return f"{seconds(windows.start * 1000)} to {seconds(windows.stop * 1000)} s"


def judged(bench: Bench, case: Case, windows: Windows, seeds: int) -> tuple[str, Judged]:
    """Return label and scores of a case: its seeds against the measured events and each other."""
    chosen = range(case.config.seed, case.config.seed + seeds)
    streams = bench.made(case.config, windows, chosen, in_full=True)
    label, found = case.label, bench.against(streams, windows)
    if all(np.array_equal(streams[0], one) for one in streams[1:]):
        label += " †"
        pixel = replace(case.config.pixel, initial_reference="random")
        others = bench.made(replace(case.config, pixel=pixel), windows, chosen, in_full=True)
        found = replace(found, floor=bench.against(others, windows).floor)
    _say(f"{bench.real.name}: {label}: {found.made.events:,.0f} events, {_span(windows)}")
    return label, found


if __name__ == "__main__":
    main()
