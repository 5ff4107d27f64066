"""``adv2e diagnose``: what a recording holds that its simulation lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from collections.abc import Callable

    from adv2e.cli.options import Log
    from adv2e.config import Config
    from adv2e.geometry import Rectangle, Size


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
@click.option(
    "--light",
    metavar="TABLE",
    shell_complete=completion.files,
    help="What the light was, in the place of frames: columns time_s and light_dn (255 is white).",
)
@click.option(
    "--size",
    type=options.SIZE,
    metavar="WxH",
    help="Size of the sensor (sensor.width and sensor.height), where the file does not tell it.",
)
@options.time_unit_option
@options.rotate_option()
@options.track_option("RECORDING")
@click.option(
    "--start", type=options.SECONDS, metavar="S", help="Look at it from S seconds after its start."
)
@click.option(
    "--stop", type=options.SECONDS, metavar="S", help="Look at it until S seconds after its start."
)
@options.crop_option("Look at a part of the sensor only: first column, first row, columns, rows.")
@options.events_options
def command(
    recording: str,
    config: Callable[[Size | None], Config],
    output: str | None,
    overwrite: bool,
    without: tuple[str, ...],
    fit_thresholds: bool,
    light: str | None,
    size: Size | None,
    time_unit: str | None,
    rotate180: bool,
    track: str | None,
    start: float | None,
    stop: float | None,
    crop: Rectangle | None,
    reading: dict[str, Any],
    threads: int | None,
    progress: bool,
    log: Log,
) -> None:
    """Find what a recording holds that its simulation lacks.

    RECORDING holds frames and events on one clock: a DAVIS240C folder or zip, AEDAT4, AEDAT-2, a
    ROS bag, HDF5 of DDD17, DDD20 or MVSEC, or HDF5 that adv2e wrote with frames. The configuration
    (-c) says what is known of the camera. The events are simulated from the frames; where the
    recording differs from all simulations by more than chance, the effect that the declared model
    lacks is looked for, fitted, and judged on data that it was not fitted to.

    With --light, RECORDING holds events alone, in any format that adv2e reads, of a light that is
    known: an LED that leaps, a lamp with a photodiode. TABLE is delimited text: time_s on the clock
    of the events, and light_dn. Between two rows the light is a line; two rows of the same time are
    a leap. A column 'light_dn X Y COLUMNS ROWS' is the light of a rectangle. 'adv2e protocol' says
    what to record.

    DIR (-o; default: <stem>.diagnosis) gets report.html with the pictures, report.json, and
    model.yaml, the declared model with what was found, for 'adv2e convert -c'.

    \b
    Examples:
      adv2e config template davis346 > declared.yaml
      adv2e diagnose recording.zip -c declared.yaml -o diagnosis
      adv2e diagnose recording.zip -c davis346 --without flicker
      adv2e diagnose led.raw --light stimulus.csv -c declared.yaml --fit-thresholds
    """
    from pathlib import Path

    from adv2e.config import names_of, written_keys
    from adv2e.diagnosis.recordings import diagnose_file
    from adv2e.files.names import shown
    from adv2e.reports.summary import summary_text

    options.check_part(start, stop)
    declared = config(size)
    options_given = click.get_current_context().params
    given = options_given["config_files"], options_given["sets"]
    folder = Path(output or f"{Path(recording).stem}.diagnosis")
    found = diagnose_file(
        recording,
        declared,
        name=names_of(*given),
        written=written_keys(*given),
        also_read=options.files_given(),
        light=light,
        output=folder,
        without=without,
        fit_thresholds=fit_thresholds,
        reading={**reading, "time_unit": time_unit, "rotate180": rotate180, "track": track},
        part=(start, stop, crop),
        overwrite=overwrite,
        threads=threads,
        progress=progress,
        say=log,
        log=lambda text: log(text, 1),
    )
    for line in summary_text(found).splitlines():
        log(line)
    log(shown(f"report: {folder / 'report.html'}"))
