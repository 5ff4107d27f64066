"""``adv2e diagnose``: what a recording holds that its simulation lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from collections.abc import Callable

    from adv2e.cli.options import Log
    from adv2e.config import Config


@click.command("diagnose", cls=Command)
@click.argument("recording", metavar="RECORDING", shell_complete=completion.files)
@options.config_options
@options.run_options
@click.option(
    "--without",
    "without",
    multiple=True,
    metavar="EFFECT",
    shell_complete=completion.library,
    help="Leave an effect out of the library. Repeatable.",
)
@click.option(
    "--fit-thresholds",
    is_flag=True,
    help="The contrast thresholds are not known: fit them first, to the totals of ON and OFF.",
)
@options.time_unit_option
@options.rotate_option()
def command(
    recording: str,
    config: Callable[[], Config],
    output: str | None,
    overwrite: bool,
    without: tuple[str, ...],
    fit_thresholds: bool,
    time_unit: str | None,
    rotate180: bool,
    threads: int | None,
    progress: bool,
    log: Log,
) -> None:
    """Find what a recording holds that its simulation lacks.

    RECORDING holds frames and events on one clock: a DAVIS240C folder or zip, or HDF5. The
    configuration (-c) says what is known of the camera. The events are simulated from the frames;
    where the recording differs from all simulations by more than chance, the effect that the
    declared model lacks is looked for, fitted, and judged on data that it was not fitted to.

    DIR (-o; default: <stem>.diagnosis) gets report.html with the pictures, report.json, and
    model.yaml, the declared model with what was found, for 'adv2e convert -c'.

    \b
    Examples:
      adv2e diagnose recording.zip -c declared.yaml -o diagnosis
      adv2e diagnose recording.zip -c davis346 --without flicker
    """
    from pathlib import Path

    from adv2e.config import names_of, written_keys
    from adv2e.diagnosis.recordings import diagnose_file
    from adv2e.files.names import shown
    from adv2e.reports.summary import summary_text

    declared = config()
    options_given = click.get_current_context().params
    given = options_given["config_files"], options_given["sets"]
    folder = Path(output or f"{Path(recording).stem}.diagnosis")
    found = diagnose_file(
        recording,
        declared,
        name=names_of(*given),
        written=written_keys(*given),
        also_read=options.files_given(),
        output=folder,
        without=without,
        fit_thresholds=fit_thresholds,
        time_unit=time_unit,
        rotate180=rotate180,
        overwrite=overwrite,
        threads=threads,
        progress=progress,
        log=lambda text: log(text, 1),
    )
    for line in summary_text(found).splitlines():
        log(line)
    log(shown(f"report: {folder / 'report.html'}"))
