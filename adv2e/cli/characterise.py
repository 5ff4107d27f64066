"""``adv2e characterise``: what a table of measurements says of the camera."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from adv2e.cli.options import Layers, Log


@click.command("characterise", cls=Command)
@click.argument("table", metavar="TABLE", shell_complete=completion.files)
@options.config_options(
    "What is known of the camera: every key written there is held. Repeatable.",
    "Declare one key.",
    "Seed of the drawn tables.",
    usual_seed=0,
    takes_effects=False,
)
@click.option(
    "--where", metavar="COL=VALUE", multiple=True, help="Use only such rows. Repeatable: all hold."
)
@click.option(
    "--judge",
    metavar="COL=VALUE",
    multiple=True,
    help="Judge on such rows and fit to the others."
    "  [default: each light level is held out in turn]",
)
@click.option(
    "--white",
    type=options.POSITIVE,
    metavar="LIGHT",
    help="Light that 255 DN stand for, in the table's unit.  [default: the highest]",
)
@click.option(
    "--contrast",
    type=options.POSITIVE,
    default=1.0,
    show_default=True,
    metavar="LN",
    help="Size of the steps where a table of latencies does not say.",
)
@click.option(
    "--error",
    type=options.POSITIVE,
    metavar="SHARE",
    help="Standard error of every row, relative.  [default: from the table]",
)
@options.output_options
@options.reporting_options
def command(
    table: str,
    layers: Layers,
    output: str | None,
    overwrite: bool,
    log: Log,
    progress: bool,
    **settings: Any,
) -> None:
    """Name the effect that measured latencies or noise rates ask for.

    TABLE is delimited text with a header. Columns are known by their names: light (irradiance_W_m2,
    illuminance_lux or light_dn) and either latency_us (_ms, _s), with latency_error_us or
    latency_sd_us and number, contrast_ln, polarity and bias where known; or on_rate_hz and
    off_rate_hz, with on_median_hz, off_median_hz, on_share, off_share, on_share_5 (of the pixels
    with 5 events or more; any number), pixels and duration_s where known. Other columns are labels.

    The declared model is the circuit of the paper (corner proportional to light, no noise) with the
    keys written in -c and --set. An effect is named only where it lowers the error on light that it
    was not fitted to. With -o, report.html, report.json and model.yaml are written there.

    \b
    Examples:
      adv2e characterise latency.csv -o latency/
      adv2e characterise latency.csv --where bias=0 --judge camera=CAM2 -o judged/
      adv2e characterise noise.csv -c v2e -o noise/
    """
    from adv2e.diagnosis.tables.characterise import characterise
    from adv2e.diagnosis.tables.problem import Settings, read_declared
    from adv2e.diagnosis.tables.table import read_table
    from adv2e.files.regular import shown
    from adv2e.reports.files import check_folder, write_reports
    from adv2e.reports.summary import details_text, summary_text

    if output is not None:
        check_folder(output, overwrite=overwrite, inputs=[table, *layers.files()])
    seed = layers.seed or 0
    declared = read_declared(layers.config_files, layers.sets, seed)
    chosen = Settings(**settings, seed=seed, log=lambda text: log(text, 1))
    found = characterise(read_table(table), declared, chosen)
    if output is not None:
        write_reports(found, output, overwrite=overwrite)
    if log.level >= 0:
        click.echo(summary_text(found))
        click.echo(details_text(found))
        if output is not None:
            click.echo(shown(f"report: {Path(output) / 'report.html'}"))
