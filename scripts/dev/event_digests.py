#!/usr/bin/env python
"""Digests of what adv2e makes of many inputs and configurations, to compare commits by.

There are four kinds of cases, all of which are made here:

events      simulations of small sequences, through `adv2e.simulate` or ``adv2e convert``
info        what ``adv2e info --json`` tells of inputs of every kind, whole and damaged
datasets    what ``adv2e export`` makes
reports     what ``adv2e diagnose`` reports

So any commit can be asked::

    python scripts/dev/event_digests.py --out before.json --keep --package ../clone-of-before
    python scripts/dev/event_digests.py --out after.json --keep
    python scripts/dev/event_digests.py --compare before.json after.json

Of what differs, the comparison tells the keys.  ``--keep`` stores the events too, in a folder
beside the file; the comparison then says of what differs how many events are still the same one
(the same pixel's n-th event, with the same polarity), and by how much their times differ.
"""

from __future__ import annotations

import fnmatch
import json
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from dev.digests import commands, simulations
from dev.digests.comparison import changed, comparison, kept

Run = Callable[[int, Path], Any]
"""Runs a case with so many threads in a folder; returns events and a digest, or what it holds."""

KINDS: Mapping[str, tuple[Callable[[], Mapping[str, Run]], tuple[int, ...]]] = {
    "events": (simulations.cases, (1, 2)),
    "info": (commands.information, (1,)),
    "datasets": (commands.datasets, (1, 2)),
    "reports": (commands.reports, (2,)),
}
"""Cases of each kind, and the numbers of threads that they are run with."""

WORDS = {"info": "info", "dataset": "datasets", "report": "reports"}
"""Kinds of cases, by the first word of their names; others are events."""


def one(name: str, run: Run, threads: tuple[int, ...] = (1, 2)) -> tuple[dict[str, Any], Any]:
    """Return what is written of one case, and its events, if it makes any."""
    found = []
    try:
        for count in threads:
            with tempfile.TemporaryDirectory(prefix="adv2e-digests-") as folder:
                found.append(run(count, Path(folder)))
    except Exception as error:  # a case that a commit lacks must not hide the others
        return {"error": f"{type(error).__name__}: {error}"}, None
    first, last = found[0], found[-1]
    if isinstance(first, dict):
        other = {} if first == last else {"two_threads": changed(first, last)}
        return {"holds": first, **other}, None
    (events, digest), (_, other) = first, last
    on = int(np.count_nonzero(events["p"]))
    about = {"digest": digest, "events": int(events.size), "on": on, "off": int(events.size) - on}
    if other != digest:
        about["two_threads"] = other
    return about, events


def _kinds(ctx: click.Context, param: click.Parameter, text: str) -> set[str]:
    kinds = set(text.split(","))
    if unknown := kinds - {*KINDS}:
        raise click.BadParameter(f"{', '.join(sorted(unknown))}: no such kind", ctx, param)
    return kinds


@click.command()
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON to write.")
@click.option("--keep", is_flag=True, help="Store the events as well, in OUT without its suffix.")
@click.option(
    "--package",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder that holds the package adv2e.  [default: the installed one]",
)
@click.option(
    "--kinds", default=",".join(KINDS), show_default=True, callback=_kinds, help="Kinds of cases."
)
@click.option("--only", default="*", metavar="GLOB", help="Cases by name.")
@click.option(
    "--compare", nargs=2, type=click.Path(exists=True, path_type=Path), metavar="A B",
    help="Compare two results.",
)  # fmt: skip
def main(
    out: Path | None, keep: bool, package: Path | None, kinds: set[str], only: str,
    compare: tuple[Path, Path] | None,
) -> None:  # fmt: skip
    """Write digests of what many cases make, or compare two such files."""

    def wanted(name: str) -> bool:
        kind = WORDS.get(name.split(maxsplit=1)[0], "events")
        return kind in kinds and fnmatch.fnmatchcase(name, only)

    if compare:
        lines = comparison(*compare, wanted)
        click.echo("\n".join(lines) or "no differences")
        sys.exit(bool(lines))
    if out is None:
        raise click.UsageError("give --out FILE, or --compare A B")
    if package:
        sys.path.insert(0, str(package.resolve()))
    results, wrong = {}, []
    for cases, threads in KINDS.values():
        for name, run in cases().items():
            if not wanted(name):
                continue
            results[name], events = one(name, run, threads)
            about = results[name]
            if "error" in about or "two_threads" in about:
                wrong.append(f"{name}: {about.get('error', 'depends on the number of threads')}")
            elif keep and events is not None:
                kept(out, name).parent.mkdir(parents=True, exist_ok=True)
                np.savez_compressed(kept(out, name), events=events)
    out.write_text(json.dumps(results, indent=1) + "\n")
    click.echo(f"{len(results)} cases, {sum(r.get('events', 0) for r in results.values())} events")
    if wrong:
        raise click.ClickException("\n".join(wrong))


if __name__ == "__main__":
    main()
