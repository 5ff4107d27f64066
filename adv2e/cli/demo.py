"""``adv2e demo``: a first try."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from adv2e.cli import options
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from adv2e.cli.options import Layers, Log


@click.command("demo", cls=Command)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("adv2e-demo"),
    show_default=True,
    metavar="DIR",
    help="Folder to make.",
)
@click.option("--overwrite", is_flag=True, help="Replace what an earlier demo left in it.")
@options.config_options()
@options.threads_option
@options.reporting_options
def command(
    output: Path,
    overwrite: bool,
    layers: Layers,
    threads: int | None,
    progress: bool,
    log: Log,
) -> None:
    """Make a sample clip, convert it and render the events.

    The clip is a textured scene with disks of high contrast that moves, rests, moves and rests.
    Beside it, recording.zip and declared.yaml are made for a first 'adv2e diagnose'.

    \b
    Examples:
      adv2e demo
      adv2e demo -o v2e-demo -c v2e
    """
    from adv2e.conversion.demo import run_demo

    demo = run_demo(
        output, layers.config(), overwrite=overwrite, threads=threads, progress=progress, log=log
    )
    if log.level >= 0:
        click.echo(demo.text())
