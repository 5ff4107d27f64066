"""``adv2e compare``: how far a simulated stream is from a measured one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.options import CompareOptions
from adv2e.process.bars import reading_bar

if TYPE_CHECKING:
    from adv2e.cli.options import Layers, Log


@click.command("compare", cls=Command)
@click.argument("measured", metavar="MEASURED", shell_complete=completion.files)
@click.argument("simulated", metavar="SIMULATED", shell_complete=completion.files)
@click.option(
    "--json", "as_json", is_flag=True, help="Print JSON, with the distances in each window."
)
@options.declared_options(
    CompareOptions,
    help={
        "rotate180": "Of MEASURED, and of --frames.",
        "track": "Of MEASURED.",
        "start_s": "Of MEASURED; SIMULATED is compared at the same times.",
        "stop_s": "Of MEASURED.",
        "crop": "Of all that is read.",
    },
)
@options.config_options()
@options.reporting_options
def command(
    measured: str,
    simulated: str,
    as_json: bool,
    given: dict[str, Any],
    layers: Layers,
    progress: bool,
    log: Log,
) -> None:
    """Measure how much two event streams differ.

    \b
    Examples:
      adv2e compare urban.zip urban_simulated.h5
      adv2e compare urban.zip urban_simulated.h5 -c davis240c --json
      adv2e compare measured.txt simulated.txt --window 0.02
      adv2e compare real/ made/
      adv2e compare 'real/*.bin' 'made/*.h5'

    MEASURED and SIMULATED are event files of one sensor size and on one clock. The command prints
    several distances between them, each with its definition. Beside each stands the distance
    between two halves of the measured events, which is about what chance alone makes.

    Or both are sets of ten recordings or more: folders, or patterns in quotation marks. The command
    then prints how often a classifier tells a simulated recording from a measured one, and by what.
    It does the same for windows of time of two recordings.

    With a configuration (-c, --set, --seed or --effect) and frames, the command also simulates the
    frames twice, with two seeds, and prints the distance between these two simulations.
    """
    from adv2e.comparison.compare import compare

    declared = layers.config()
    report = compare(
        measured,
        simulated,
        declared if layers.first_given else None,
        reading=lambda path: reading_bar(path, progress),
        doubt=log,
        **given,
    )
    if as_json:
        import json

        click.echo(json.dumps(report, indent=2, allow_nan=False))
    else:
        from adv2e.comparison.report import text

        click.echo(text(report))
