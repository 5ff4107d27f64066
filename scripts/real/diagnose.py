#!/usr/bin/env python
"""Which effects bring the simulation of real recordings nearer to what the cameras measured.

For each recording (a folder in the DAVIS240C layout) the declared model is a configuration, the
paper's by default, with thresholds that match the totals.  Effects are added one by one, each with
what it is fitted to: the first half of the frame intervals.  The second half is for the tables
alone: how far the events are before and after each effect::

    python scripts/real/diagnose.py cradle slider -o table.md

Two more numbers tell how far to trust them: how much of the simulation hangs on interpolation, told
by dropping every second frame, and the score where it does not.

A search can take an hour or two.  Ctrl-C (or ``timeout -s INT 3600``) ends it, and the table is of
what was found until then.  With ``--models FOLDER`` the model that a search ended at is kept, and
judged again by the next run.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import one_line_errors, output_option, table, threads_option, write_report

from adv2e.config import Config, load_config, to_dict, to_yaml
from adv2e.config.paths import flat
from adv2e.errors import DataError
from adv2e.events import cut
from real.bursts import bursts
from real.model import SCORE, Bench
from real.peers import peer_rows
from real.recording import Real, halves, read
from real.search import Search
from real.table import SHORT, Step, cells, steps_table
from real.tried import UNSEEN, Added, tried_names
from real.where_stable import where_stable


@click.command()
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True)
@click.option("--declared", default="paper", show_default=True, help="Shipped name or YAML file.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--effects", default="", help="Try these effects of the camera alone, by commas.")
@threads_option
@click.option(
    "--models",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for the models found, as NAME.yaml; one that is there is judged, not sought.",
)
@output_option
@one_line_errors()
def main(
    folders: tuple[str, ...],
    declared: str,
    seed: int,
    effects: str,
    threads: int | None,
    models: Path | None,
    output: Path | None,
) -> None:
    """Add effects to a declared model of real recordings, one by one."""
    only = _names(effects)
    if models is not None:
        models.mkdir(parents=True, exist_ok=True)  # before hours are spent
    parts = [_preamble(declared, only)]
    for folder in folders:
        real = read(folder)
        for problem in real.problems:
            click.echo(f"{folder}: {problem}", err=True)
        parts.append(section(real, declared, seed, only, threads, models))
    write_report("\n\n".join(parts), output)


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
        f" 'mean': '{SHORT[SCORE]}' without the simulation's own chance, as of a mean of many."
        " 'over time' is the error of `adv2e compare`. Events and ON share: simulated over"
        f" measured. Camera effects tried: {tried}."
    )


def section(
    real: Real,
    declared: str,
    seed: int,
    only: Sequence[str],
    threads: int | None,
    models: Path | None,
) -> str:
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

    kept = None if models is None else models / f"{real.name}.yaml"
    search = Search(bench, first, say).run(config, only)
    if kept is not None and kept.exists():
        before = Added.plain(f"as found, {kept.name}", load_config([kept], seed=seed))
        search = chain(islice(search, 1), [before])
        say(f"judging the model of {kept}")
    as_declared = Added.plain("as declared", config)
    steps = [Step(as_declared, bench.judge(config, second, seeds))]
    ended = True
    try:
        for added in search:
            settled = replace(added, config=bench.matched(added.config, first, tolerance=0.01))
            steps.append(Step(settled, bench.judge(settled.config, second, seeds)))
            say(f"{added.text()}: {added.score:.3f}, held out {steps[-1].judged.values[SCORE]:.3f}")
    except KeyboardInterrupt:
        if len(steps) == 1:  # nothing to tell
            raise
        ended = False
        say("interrupted: judging what was found so far")
    found = steps[-1].added.config
    if kept is not None and ended and not kept.exists():
        kept.write_text(to_yaml(found), encoding="utf-8")
    converted = bench.made(found, second, seeds, in_full=True)
    steps[-1] = last = replace(steps[-1], judged=bench.against(converted, second))
    stable = where_stable(bench, steps, second, seeds, converted)
    at_readouts = bursts(bench, found, second, seeds[0])
    seconds = time.perf_counter() - began
    say(f"{bench.simulations} simulations in {seconds:.0f} s")
    measured = cut(real.events, second.start, second.stop)
    return "\n\n".join(
        [
            f"## {real.name}",
            steps_table(real.size, measured, steps, second),
            _found(last, config, bench.missed(found, first), ended),
            stable,
            *([at_readouts] if at_readouts else []),
            _beside_peers(real, last),
        ]
    )


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
    names = ["simulator", *list(SHORT.values())[:3]]
    own = ["adv2e, model found", *cells(last.judged.values)[:3]]
    return table(names, [own, *rows])


if __name__ == "__main__":
    main()
