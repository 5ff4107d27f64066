"""``adv2e batch``: every sequence below a folder, in such a way that it can be done again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.files.regular import shown
from adv2e.formats import registry
from adv2e.options import BatchOptions, size_of

if TYPE_CHECKING:
    from adv2e.batches.run import Batch
    from adv2e.cli.options import Layers, Log


@click.command("batch", cls=Command)
@click.argument("source", metavar="SOURCE", shell_complete=completion.files)
@click.argument("dest", metavar="DEST", shell_complete=completion.files)
@options.config_options(
    "Configuration: a YAML file or a shipped name, such as davis346. Repeatable: a later one wins.",
    "Set one key, such as pixel.low_pass.cutoff_hz=100. Repeatable.",
    "Seed of the batch. Each sequence has one of its own, made of this and its name.",
)
@options.declared_options(BatchOptions, help={"format": f"One of: {', '.join(registry.names())}."})
@click.option("--dry-run", is_flag=True, help="Show what would be done, and write nothing.")
@click.option("--overwrite", is_flag=True, help="Make all anew, and replace files of others.")
@options.reporting_options
def command(
    source: str,
    dest: str,
    layers: Layers,
    given: BatchOptions,
    dry_run: bool,
    overwrite: bool,
    progress: bool,
    log: Log,
) -> None:
    """Convert every sequence below the folder SOURCE, and make the same tree below DEST.

    \b
    Examples:
      adv2e batch videos/ events/
      adv2e batch GOPRO_Large_all/ events/ -c davis346 --seed 1 --jobs 4
      adv2e batch videos/ events/ --dry-run
      adv2e batch videos/ events/ --shard 2/8
      adv2e batch videos/ training/ -c vid2e -c train-e2vid --export e2vid

    Killed or done, it may be called again: it makes what is missing, and what has changed since in
    its source, its settings or the version of adv2e. Files that it keeps are compared with what
    DEST/manifest.jsonl says of them. A sequence that fails does not stop the others; at the end
    all of these are listed, and the exit status is 1.
    """
    from adv2e.batches.run import batch, open_batch, table

    layers.check(size_of(given))
    how: Any = {**given, "sets": layers.sets, "seed": layers.seed, "effects": layers.effect_files}
    how["overwrite"] = overwrite
    if dry_run:
        _tell_of(open_batch(source, dest, layers.config_files, **how), log)
        return
    outcome = batch(source, dest, layers.config_files, log=log, progress=progress, **how)
    lines = table(outcome)
    if log.level >= 0:
        click.echo(lines[0])
    for line in lines[1:]:
        click.echo(line, err=True)
    for line in outcome.told:
        log(shown(line))
    if outcome.failed:
        raise click.exceptions.Exit(1)


def _tell_of(work: Batch, log: Log) -> None:
    from adv2e.batches.run import reasons

    tasks = work.plan()
    for task in tasks:
        log(f"{shown(task.sequence.name)}: {task.why or 'kept'}", 0 if task.why else 1)
    click.echo(reasons(tasks))
    for line in work.passed:
        log(shown(line))
