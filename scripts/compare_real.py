#!/usr/bin/env python
"""How far shipped configurations are from real recordings.

The frames of a recording (a folder in the DAVIS240C layout) go in at their own times; what comes
out is compared with the recording's events over its frame intervals.  One Markdown table a folder,
and with ``--match-totals`` a second one that takes out the difference in thresholds::

    python scripts/compare_real.py slider_depth boxes --match-totals --out table.md
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from real.recording import Real, halves, read, still_rate
from real.table import Row, Stream, definitions, markdown, preamble
from writing.files import write

from adv2e.comparison.distances import distances, pooled
from adv2e.comparison.floor import Floor, half_split
from adv2e.comparison.windows import Windows, cut
from adv2e.config import Config, load_config
from adv2e.config.model import INTERPOLATIONS
from adv2e.diagnosis.fitting.nuisances import TOLERANCE, match_totals, totals, with_thresholds
from adv2e.errors import Adv2eError
from adv2e.events import Events, empty_events
from adv2e.sources.times.instants import seconds

CONFIGS = "adv2e,paper,v2e,vid2e,ideal"


@dataclass(frozen=True)
class Case:
    """A configuration and what the table calls it."""

    label: str
    config: Config


@dataclass(frozen=True)
class Run:
    """How to simulate."""

    seeds: int
    threads: int | None

    def streams(self, real: Real, config: Config, windows: Windows) -> list[Events]:
        """Return the events in the windows, a stream a seed."""
        simulate_events = real.simulator(config, windows.stop, self.threads)
        chosen = range(config.seed, config.seed + self.seeds)
        return [cut(simulate_events(seed), windows.start, windows.stop) for seed in chosen]


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
@click.option("--threads", type=click.IntRange(min=1), help="[default: all cores]")
@click.option("--out", type=click.Path(path_type=Path), help="Write here.  [default: stdout]")
def main(
    folders: tuple[str, ...],
    configs: str,
    seeds: int,
    interpolation: str | None,
    matching: bool,
    threads: int | None,
    out: Path | None,
) -> None:
    """Compare the events of shipped configurations with those of real recordings."""
    run = Run(seeds, threads)
    try:
        cases = _cases(configs.split(","), interpolation)
        parts = [preamble()]
        for folder in folders:
            real = read(folder)
            for problem in real.problems:
                _say(f"{folder}: {problem}")
            parts.append(_shipped(real, cases, run))
            if matching:
                parts.append(_matched(real, cases, run))
        write("\n\n".join([*parts, definitions()]), out)
    except Adv2eError as error:
        raise click.ClickException(str(error)) from None


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


def _shipped(real: Real, cases: Sequence[Case], run: Run) -> str:
    return _section(real, cases, real.windows, run, "thresholds as shipped")


def _matched(real: Real, cases: Sequence[Case], run: Run) -> str:
    first, second = halves(real.windows)
    matched = [with_totals(real, case, first, run) for case in cases]
    title = "totals matched before"
    about = (
        f"Thresholds [ln] are such that the totals of ON and of OFF events match from"
        f" {_span(first)}; (!): they do not, to {TOLERANCE:.0%}."
    )
    return _section(real, matched, second, run, title, about)


def with_totals(real: Real, case: Case, windows: Windows, run: Run) -> Case:
    """Return the case with thresholds that match the totals in the windows."""

    def count(on: float, off: float) -> tuple[int, int]:
        once = replace(run, seeds=1)
        return totals(once.streams(real, with_thresholds(case.config, on, off), windows)[0])

    shipped = case.config.pixel.thresholds
    goal = totals(cut(real.events, windows.start, windows.stop))
    on, off, miss = match_totals(count, (shipped.on, shipped.off), goal)
    _say(f"{real.name}: {case.label}: ON {on:.3f}, OFF {off:.3f}: totals miss by {miss:.1%}")
    mark = " (!)" if miss > TOLERANCE else ""
    label = f"{case.label}, ON {on:.3f} OFF {off:.3f}{mark}"
    return Case(label, with_thresholds(case.config, on, off))


def _section(
    real: Real, cases: Sequence[Case], windows: Windows, run: Run, title: str, about: str = ""
) -> str:
    """Return heading, what is compared, and the table of the cases and the two marks to go by."""
    rows = [judged(real, case, windows, run) for case in cases]
    split = half_split(real.events, windows, *real.size)
    nothing = distances(real.events, empty_events(), windows, *real.size).values
    rows += [Row("half split (Poisson)", split), Row("no events at all", nothing)]
    measured = [cut(real.events, windows.start, windows.stop)]
    compared = (
        f"{real.size[0]}x{real.size[1]} pixels, {np.count_nonzero(real.still):,} of them still;"
        f" {len(windows.used)} of {windows.total} frame intervals, {_span(windows)}. {about}"
    )
    table = markdown(rows, _stream(real, measured, windows))
    return f"## {real.name}: {title}\n\n{compared.strip()}\n\n{table}"


def _span(windows: Windows) -> str:
    return f"{seconds(windows.start * 1000)} to {seconds(windows.stop * 1000)} s"


def judged(real: Real, case: Case, windows: Windows, run: Run) -> Row:
    """Return the row of a case: its seeds against the measured events and against each other."""
    label, streams = case.label, run.streams(real, case.config, windows)
    found = [distances(real.events, one, windows, *real.size).values for one in streams]
    others = streams
    if all(np.array_equal(streams[0], one) for one in streams[1:]):
        label += " †"
        pixel = replace(case.config.pixel, initial_reference="random")
        others = run.streams(real, replace(case.config, pixel=pixel), windows)
    pairs = itertools.combinations(others, 2)
    apart = [distances(*pair, windows, *real.size, whole=real.events).values for pair in pairs]
    stream = _stream(real, streams, windows)
    _say(f"{real.name}: {label}: {stream.events:,.0f} events, {_span(windows)}")
    return Row(label, _means(found), _means(apart), stream)


def _stream(real: Real, streams: Sequence[Events], windows: Windows) -> Stream:
    """Return counts and rates, means over `streams`, which are cut to the windows."""
    shares = [totals(one)[0] / len(one) if len(one) else None for one in streams]
    rates = [still_rate(one, real.still, windows.duration_s) for one in streams]
    return Stream(
        float(np.mean([len(one) for one in streams])),
        pooled(shares, "mean"),
        pooled(rates, "mean"),
    )


def _means(found: Sequence[Floor]) -> Floor:
    return {name: pooled([one[name] for one in found], "mean") for name in found[0]}


if __name__ == "__main__":
    main()
