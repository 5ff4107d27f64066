#!/usr/bin/env python
"""Which effects bring the simulation of real recordings nearer to what the cameras measured.

For each recording (a folder in the DAVIS240C layout) the declared model is a configuration, the
paper's by default, with thresholds that match the totals.  Effects are added one by one, each with
what it is fitted to: the first half of the frame intervals.  The second half is for the tables
alone: how far the events are before and after each effect::

    python scripts/diagnose_real.py cradle slider --out table.md

Two more numbers tell how far to trust them: how much of the simulation hangs on interpolation, told
by dropping every second frame, and the score where it does not.

A search can take an hour or two.  Ctrl-C (or ``timeout -s INT 3600``) ends it, and the table is of
what was found until then.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import click
import numpy as np
from real.bursts import bursts
from real.model import SCORE, Bench, Judged
from real.peers import peer_rows
from real.recording import Real, halves, read
from real.search import Search
from real.stability import LINES, Stability, compare_halved
from real.stability import MOST as UNSTABLE
from real.table import COLUMNS as TITLES
from real.table import number
from real.tried import UNSEEN, Added, tried_names
from writing.files import write
from writing.markdown import table

from adv2e.comparison.distances import distances
from adv2e.comparison.floor import Floor, half_split
from adv2e.comparison.windows import Windows, cut
from adv2e.config import Config, load_config, to_dict
from adv2e.config.paths import flat
from adv2e.diagnosis.nuisances import totals
from adv2e.diagnosis.readouts import without_coupling
from adv2e.errors import Adv2eError, DataError
from adv2e.events import Events, empty_events

COLUMNS = {
    name: TITLES[name] for name in ("relative_5_bins", SCORE, "relative_1_bin_smoothed", "error")
}


@dataclass(frozen=True)
class Step:
    """A model on the way, as judged on data that it was not fitted to."""

    added: Added
    judged: Judged


@click.command()
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True)
@click.option("--declared", default="paper", show_default=True, help="Shipped name or YAML file.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--effects", default="", help="Try these effects of the camera alone, by commas.")
@click.option("--threads", type=click.IntRange(min=1), help="[default: all cores]")
@click.option("--out", type=click.Path(path_type=Path), help="Write here.  [default: stdout]")
def main(
    folders: tuple[str, ...],
    declared: str,
    seed: int,
    effects: str,
    threads: int | None,
    out: Path | None,
) -> None:
    """Add effects to a declared model of real recordings, one by one."""
    try:
        only = _names(effects)
        parts = [_preamble(declared, only)]
        for folder in folders:
            real = read(folder)
            for problem in real.problems:
                click.echo(f"{folder}: {problem}", err=True)
            parts.append(section(real, declared, seed, only, threads))
        text = "\n\n".join(parts)
        write(text, out)
    except Adv2eError as error:
        raise click.ClickException(str(error)) from None


def _names(text: str) -> list[str]:
    """Return the names of effects to try.

    Raises
    ------
    BadParameter
        One of them cannot be tried.
    """
    only = [name.strip() for name in text.split(",") if name.strip()]
    for name in only:
        if name in UNSEEN:
            raise click.BadParameter(f"{name} is not tried: {UNSEEN[name]}", param_hint="--effects")
        if name not in tried_names():
            known = ", ".join(tried_names())
            raise click.BadParameter(f"{name}: must be one of {known}", param_hint="--effects")
    return only


def _preamble(declared: str, only: Sequence[str]) -> str:
    left_out = "; ".join(f"{name} ({why})" for name, why in UNSEEN.items())
    tried = ", ".join(only) or f"all of the library but {left_out}"
    return (
        f"Declared: {declared}. Distances relative to the measured grid, median over frame"
        " intervals, means over two seeds, on the second half of the intervals, which nothing was"
        " fitted to; 1 is as far as no events. In brackets: the distance between the two seeds."
        f" 'mean': '{COLUMNS[SCORE]}' without the simulation's own chance, as of a mean of many."
        " 'over time' is the error of `adv2e compare`. Events and ON share: simulated over"
        f" measured. Camera effects tried: {tried}."
    )


def section(real: Real, declared: str, seed: int, only: Sequence[str], threads: int | None) -> str:
    """Return what was found for one recording, as Markdown."""
    began = time.perf_counter()
    first, second = halves(real.windows)
    for windows, which in ((first, "first"), (second, "second")):
        if not len(cut(real.events, windows.start, windows.stop)):
            raise DataError(f"{real.name}: no events in the {which} half of its frame intervals")
    config = load_config([declared], seed=seed)
    bench = Bench(real, threads, config)
    seeds = (seed + 1, seed + 2)

    def say(text: str) -> None:
        click.echo(f"{real.name}: {text}", err=True)

    as_declared = Added.plain("as declared", config)
    steps = [Step(as_declared, bench.judge(config, second, seeds))]
    ended = True
    try:
        for added in Search(bench, first, say).run(config, only):
            settled = replace(added, config=bench.matched(added.config, first, tolerance=0.01))
            steps.append(Step(settled, bench.judge(settled.config, second, seeds)))
            say(f"{added.text()}: {added.score:.3f}, held out {steps[-1].judged.values[SCORE]:.3f}")
    except KeyboardInterrupt:
        if len(steps) == 1:  # nothing to tell
            raise
        ended = False
        say("interrupted: judging what was found so far")
    last = replace(
        steps[-1], judged=bench.judge(steps[-1].added.config, second, seeds, in_full=True)
    )
    steps[-1] = last
    stable = _where_stable(bench, steps, second, seeds)
    at_readouts = bursts(bench, last.added.config, second, seeds[0])
    seconds = time.perf_counter() - began
    say(f"{bench.simulations} simulations in {seconds:.0f} s")
    return "\n\n".join(
        [
            f"## {real.name}",
            _table(real.size, cut(real.events, second.start, second.stop), steps, second),
            _found(last, config, bench.missed(last.added.config, first), ended),
            stable,
            *([at_readouts] if at_readouts else []),
            _beside_peers(real, last),
        ]
    )


def _where_stable(bench: Bench, steps: list[Step], windows: Windows, seeds: tuple[int, int]) -> str:
    """Return what dropping every second frame changes, and the table of where that is little."""
    real, found = bench.real, steps[-1].added
    stability = _stability(bench, found, windows, seeds)
    within = partial(stability.alone, most=UNSTABLE)
    measured = within(real.events)
    kept = len(measured) / len(cut(real.events, windows.start, windows.stop))
    told = (
        f"Dropping every second frame changes the simulation by {stability.change:.2f} of its norm"
        f" (chance taken off). Tiles where that is below {UNSTABLE:.0%} hold {kept:.0%}"
        " of the measured events. The rest hangs on what was made up between frames and tells"
        " little of the camera."
    )
    if len(measured):
        steps = [
            Step(one.added, bench.judge(one.added.config, windows, seeds, of=within))
            for one in steps
        ]
        alone = [
            f"{told} The same of those tiles alone:",
            _table(real.size, measured, steps, windows),
        ]
    else:
        alone = [told]
    by_line = _by_line(bench, found, stability, seeds)
    return "\n\n".join([*alone, "The model found, by where that line is drawn:", by_line])


def _by_line(bench: Bench, found: Added, stability: Stability, seeds: tuple[int, int]) -> str:
    """Return how far a model is in the tiles that change by no more than each of `LINES`."""
    real, windows = bench.real, stability.windows
    everything = len(cut(real.events, windows.start, windows.stop))
    names = ["change below", "measured events", "events", "ON share", *COLUMNS.values(), "mean"]
    rows = []
    for line in LINES:
        alone = partial(stability.alone, most=line)
        measured = alone(real.events)
        if not len(measured):
            continue
        judged = bench.judge(found.config, windows, seeds, of=alone)
        share = totals(measured)[0] / len(measured)
        split = half_split(measured, windows, *real.size)
        rows.append(
            [
                "any" if np.isinf(line) else f"{line:.0%}",
                f"{len(measured) / everything:.0%}",
                f"{judged.events_ratio:.2f}",
                f"{number(judged.on_share)} / {share:.2f}",
                *_with_floors(judged),
                f"{number(split[SCORE])}",
            ]
        )
    return table([*names, f"half split, {COLUMNS[SCORE]}"], rows)


def _stability(bench: Bench, found: Added, windows: Windows, seeds: tuple[int, int]) -> Stability:
    """Return what dropping every second frame changes."""
    half = Bench(bench.real.thinned(), bench.threads)
    first, second = seeds

    # frames that are dropped were read out all the same
    config = without_coupling(found.config)

    def pair(one: Bench) -> tuple[Events, Events]:
        return one.quick(config, windows, first), one.quick(config, windows, second)

    return compare_halved(pair(bench), pair(half), windows, *bench.real.size)


def _table(size: tuple[int, int], measured: Events, steps: list[Step], windows: Windows) -> str:
    """Return a row a step, and what chance and no events come to; `measured`: what it is of."""
    share = totals(measured)[0] / len(measured)
    names = ["added", "ON / OFF threshold [ln]", "events", "ON share", *COLUMNS.values(), "mean"]
    rows = []
    for step in steps:
        levels, judged = step.added.config.pixel.thresholds, step.judged
        rows.append(
            [
                step.added.text(),
                f"{levels.on:.3f} / {levels.off:.3f}",
                f"{judged.events_ratio:.2f}",
                f"{number(judged.on_share)} / {share:.2f}",
                *_with_floors(judged),
            ]
        )
    split = half_split(measured, windows, *size)
    nothing = distances(measured, empty_events(), windows, *size).values
    for label, values in (("half split (Poisson)", split), ("no events at all", nothing)):
        rows.append([label, "", "", "", *_cells(values), ""])
    return table(names, rows)


def _with_floors(judged: Judged) -> list[str]:
    """Return the distances, and the one that counts without the simulation's own chance."""
    cells = [f"{number(judged.values[n])} ({number(judged.floor[n])})" for n in COLUMNS]
    return [*cells, number(judged.without_chance(SCORE))]


def _cells(values: Floor) -> list[str]:
    return [number(values[name]) for name in COLUMNS]


def _found(last: Step, declared: Config, missed: float, ended: bool) -> str:
    ratio, config = last.judged.events_ratio, last.added.config
    before = dict(flat(to_dict(declared)))
    keys = [
        f"{key}={f'{value:.5g}' if isinstance(value, float) else value}"
        for key, value in flat(to_dict(config))
        if value != before.get(key)
    ]
    return (
        f"After the last step the second half has {ratio:.2f} times the measured events, with"
        f" thresholds that match the totals of the first to {missed:.1%}. Keys that differ from"
        " those declared: "
        + ", ".join(f"`{key}`" for key in keys)
        + "."
        + " The search was interrupted: there may be more to find." * (not ended)
    )


def _beside_peers(real: Real, last: Step) -> str:
    rows = peer_rows(real.name)
    if not rows:
        return "No other tools were run on this recording."
    names = ["simulator", *list(COLUMNS.values())[:3]]
    own = ["adv2e, model found", *_cells(last.judged.values)[:3]]
    return table(names, [own, *rows])


if __name__ == "__main__":
    main()
