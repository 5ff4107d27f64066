"""``adv2e info``: what a recording, an event file or a video holds."""

from __future__ import annotations

from typing import Any

import click

from adv2e.cli import options
from adv2e.cli.commands import Command
from adv2e.options import InfoOptions
from adv2e.process.bars import reading_bar


@click.command("info", cls=Command)
@click.argument("file", metavar="FILE", type=click.Path(readable=False))
@click.option("--json", "as_json", is_flag=True, help="Print JSON, always with the same keys.")
@options.declared_options(InfoOptions)
@options.reporting_options
def command(
    file: str, as_json: bool, given: dict[str, Any], progress: bool, log: options.Log
) -> None:
    """Show what a video, a recording or an event file holds.

    \b
    Examples:
      adv2e info urban.zip
      adv2e info clip.events.h5 --json
      adv2e info clip.mp4

    This prints the size, the time span, and the counts and rates of the events and the frames. It
    names the program and the seed that made the file, if the file does. It reports problems: events
    out of order, repeated events, gaps, hot pixels. It reads a video to its end.
    """
    from adv2e.inspection.inspect import info

    log(f"reading {file}", 1)
    with reading_bar(file, progress) as told:
        report = info(file, progress=told, **given)
    if as_json:
        import json

        click.echo(json.dumps(report, indent=2, allow_nan=False))
    else:
        from adv2e.inspection.report import text

        click.echo(text(report))
