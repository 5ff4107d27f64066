"""``adv2e diagnose``: what a recording holds that its simulation lacks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.options import DiagnoseOptions

if TYPE_CHECKING:
    from adv2e.cli.options import Layers, Log


@click.command("diagnose", cls=Command)
@click.argument("recordings", metavar="RECORDING...", nargs=-1, shell_complete=completion.files)
@options.config_options()
@options.output_options
@options.reporting_options
@options.declared_options(DiagnoseOptions, help={"start_s": "Here, the first frame."})
def command(
    recordings: tuple[str, ...],
    layers: Layers,
    output: str | None,
    overwrite: bool,
    given: dict[str, Any],
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

    With --film, RECORDING holds events of a screen that showed a known film, or a picture before
    which the camera moved, as N-MNIST was recorded. How the camera saw it (path, scale, turn, blur,
    grey curve) is fitted and told apart from the camera. Many recordings of one camera may be given
    at once: half of them judge what was fitted to the others. --films names those that saw each its
    own picture.

    DIR (-o; default: <stem>.diagnosis) gets report.html with the pictures, report.json, and
    model.yaml, the declared model with what was found, for 'adv2e convert -c'. Until the end, they
    hold what is known so far, and say so; Ctrl-C leaves them.

    \b
    Examples:
      adv2e config template davis346 > declared.yaml
      adv2e diagnose recording.zip -c declared.yaml -o diagnosis
      adv2e diagnose recording.zip -c davis346 --without flicker
      adv2e diagnose led.raw --light stimulus.csv -c declared.yaml --fit-thresholds
      adv2e diagnose --films pairs.csv --size 34x34 -c declared.yaml --fit-thresholds
    """
    from pathlib import Path

    from adv2e.config import names_of, written_keys
    from adv2e.diagnosis.recordings import diagnose_file
    from adv2e.files.regular import shown
    from adv2e.reports.summary import summary_text

    declared = layers.config(given["size"])
    named = given["films"] if given["films"] and not recordings else (*recordings, "")[0]
    folder = Path(output or f"{Path(named).stem}.diagnosis")
    found = diagnose_file(
        recordings,
        declared,
        name=names_of(layers.config_files, layers.sets),
        written=written_keys(layers.config_files, layers.sets),
        also_read=layers.files(),
        output=folder,
        overwrite=overwrite,
        progress=progress,
        say=log,
        log=lambda text: log(text, 1),
        **given,
    )
    for line in summary_text(found).splitlines():
        log(line)
    log(shown(f"report: {folder / 'report.html'}"))
