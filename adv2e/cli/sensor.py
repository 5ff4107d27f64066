"""``adv2e sensor``: what a configured sensor does, on one page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.errors import UsageError
from adv2e.options import SensorOptions

if TYPE_CHECKING:
    from adv2e.cli.options import Layers, Log


@click.command("sensor", cls=Command)
@click.argument(
    "sensors", metavar="[SENSOR]...", nargs=-1, shell_complete=completion.configurations
)
@options.declared_options(SensorOptions)
@click.option("--json", "as_json", is_flag=True, help="Print JSON: all numbers and curves.")
@options.config_options()
@options.output_options
@options.reporting_options
def command(
    sensors: tuple[str, ...],
    given: dict[str, Any],
    as_json: bool,
    layers: Layers,
    output: str | None,
    overwrite: bool,
    progress: bool,
    log: Log,
) -> None:
    """Measure what a sensor does: thresholds, latency, noise, bandwidth, rate, readout.

    SENSOR is a configuration: a YAML file or a shipped name. Several are drawn side by side. -c and
    --set are laid over each. The pixels are simulated in known light and their events are counted,
    so all effects act together. docs/sensor.md defines each quantity.

    With -o, the page is written: FILE.html, or a folder with sensor.html and sensor.json.

    \b
    Examples:
      adv2e sensor davis346
      adv2e sensor davis346 gen4 -o sensors.html
      adv2e sensor davis346 --set pixel.photoreceptor_noise.rms=0.05 --white-lux 1000 -o noisy/
    """
    import json

    from adv2e.config import names_of
    from adv2e.config.files import find
    from adv2e.files.staging import Staging
    from adv2e.inspection.sensor import measured
    from adv2e.reports.sensor import sensor_page, sensor_text

    outputs = [] if output is None else [Path(output)]
    if outputs and outputs[0].suffix != ".html":
        if outputs[0].suffix:
            raise UsageError(f"-o {output}: must end in .html, or name a folder")
        outputs = [outputs[0] / f"sensor.{suffix}" for suffix in ("html", "json")]
    chosen = []
    for named in [[name] for name in sensors] or [[]]:
        one = replace(layers, config_files=(*named, *layers.config_files))
        config = one.config()
        chosen.append((names_of(one.config_files, one.sets) or "adv2e", config))
    inputs = [*layers.files(), *map(find, sensors)]
    for path in outputs:
        Staging(overwrite, inputs).file(path)  # before the work: raises if it cannot be
    found = measured(chosen, **given)
    text = json.dumps(found, indent=2, allow_nan=False)
    with Staging(overwrite, inputs) as staging:
        placed = [staging.file(path) for path in outputs]
        staging.prepare()
        for path in placed:
            page = path.suffix == ".html"
            path.write_text(sensor_page(found) if page else f"{text}\n", "utf-8", newline="\n")
    if as_json:
        click.echo(text)
    elif log.level >= 0:
        click.echo(sensor_text(found))
