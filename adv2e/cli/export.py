"""``adv2e export``: recordings in, training sets and representations out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.options import EXPORTS, ExportOptions

if TYPE_CHECKING:
    from adv2e.cli.options import Log


@click.command("export", cls=Command)
@click.argument(
    "events", metavar="EVENTS...", nargs=-1, required=True, shell_complete=completion.files
)
@options.output_options
@click.option(
    "--to",
    required=True,
    type=click.Choice(list(EXPORTS)),
    help="What to make: something for each window (voxel, histogram, surface, picture), or the"
    " folders that a trainer opens.",
)
@options.declared_options(*EXPORTS.values(), ExportOptions)
@options.reporting_options
def command(
    events: tuple[str, ...],
    output: str | None,
    overwrite: bool,
    to: str,
    given: dict[str, Any],
    progress: bool,
    log: Log,
) -> None:
    """Make training sets and representations of events.

    \b
    Examples:
      adv2e export clip.events.h5 -o grids --to voxel --window 33ms
      adv2e export clip.zip -o grids --to voxel --at images --bins 5 --normalise e2vid
      adv2e export first.h5 second.h5 -o training --to e2vid
      adv2e export drive.h5 -o segmentation --to ev-segnet
      adv2e export events/ -o spiking --to spikingjelly

    EVENTS are recordings or event files, simulated or measured; or one folder, of which all below
    it are exported: folders train, valid and test divide the set, and others name classes. For
    e2vid, ev-segnet and --at images they must hold images: 'adv2e convert --with-frames' stores
    them.
    """
    if output is None:
        raise click.UsageError("-o DIR is missing: name the folder to write")
    from adv2e.exporting.export import export

    done = export(events, output, to, overwrite=overwrite, doubt=log, **given)
    if log.level >= 0:
        click.echo(done.text())
