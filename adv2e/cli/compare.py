"""``adv2e compare``: how far a simulated stream is from a measured one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.options import EventInput
from adv2e.process.bars import reading_bar

if TYPE_CHECKING:
    from collections.abc import Callable

    from adv2e.cli.options import Log
    from adv2e.comparison.compare import Resimulation
    from adv2e.config import Config
    from adv2e.formats.reading import Recording
    from adv2e.sources import Source


@click.command("compare", cls=Command)
@click.argument("measured", metavar="MEASURED", shell_complete=completion.files)
@click.argument("simulated", metavar="SIMULATED", shell_complete=completion.files)
@click.option(
    "--json", "as_json", is_flag=True, help="Print JSON, with the distances in each window."
)
@click.option(
    "--window",
    "window_s",
    type=options.FiniteNumber(min=1e-6),
    metavar="S",
    help="Compare in windows of S seconds.  [default: from frame to frame; 0.05 if MEASURED has no"
    " frames]",
)
@click.option(
    "--frames",
    "frames_path",
    metavar="INPUT",
    shell_complete=completion.files,
    help="Take the frames from INPUT, on the clock of MEASURED. They set the windows, and are what"
    " is simulated.  [default: the frames in MEASURED]",
)
@options.declared_options(
    EventInput,
    help={
        "rotate180": "Of MEASURED, and of --frames.",
        "track": "Of MEASURED.",
    },
)
@options.config_options
@options.threads_option
@options.reporting_options
def command(
    measured: str,
    simulated: str,
    as_json: bool,
    window_s: float | None,
    frames_path: str | None,
    given: dict[str, Any],
    config: Callable[[], Config],
    threads: int | None,
    progress: bool,
    log: Log,
) -> None:
    """Measure how much two event streams differ.

    \b
    Examples:
      adv2e compare urban.zip urban_simulated.h5
      adv2e compare urban.zip urban_simulated.h5 -c davis240c --json
      adv2e compare measured.txt simulated.txt --window 0.02

    MEASURED and SIMULATED are event files of one sensor size and on one clock. The command prints
    several distances between them, each with its definition. Beside each stands the distance
    between two halves of the measured events, which is about what chance alone makes.

    With a configuration (-c, --set, --seed or --effect) and frames, the command also simulates the
    frames twice, with two seeds, and prints the distance between these two simulations.
    """
    import numpy as np

    from adv2e.comparison.compare import compare
    from adv2e.formats.frames import open_frames
    from adv2e.formats.reading import read_events

    declared = config()
    with reading_bar(measured, progress) as told:
        ours = read_events(measured, progress=told, **given)
    with reading_bar(simulated, progress) as told:
        theirs = read_events(
            simulated, progress=told, **{**given, "rotate180": False, "track": None}
        )
    source = open_frames(frames_path, rotate180=given["rotate180"]) if frames_path else None
    for doubt in source.doubts if source else []:
        log(doubt)
    times = np.array([frame.t_ns for frame in source.frames()]) if source else None
    again = _resimulation(ours, source, declared, threads, log) if _configured() else None
    report = compare(ours, theirs, frame_times_ns=times, window_s=window_s, again=again)
    for stream in (ours, theirs):
        for problem in stream.problems:
            log(f"{stream.path}: {problem}")
    if as_json:
        import json

        click.echo(json.dumps(report, indent=2, allow_nan=False))
    else:
        from adv2e.comparison.report import text

        click.echo(text(report))


def _configured() -> bool:
    given = click.get_current_context().params
    layers = (given["config_files"], given["sets"], given["effect_files"])
    return any(layers) or given["seed"] is not None


def _resimulation(
    measured: Recording, source: Source | None, config: Config, threads: int | None, log: Log
) -> Resimulation:
    """Return the resimulation of the frames of `source`, or of `measured`, by two seeds."""
    from dataclasses import replace

    from adv2e.comparison.compare import Resimulation
    from adv2e.comparison.resimulation import resimulator
    from adv2e.errors import DataError
    from adv2e.kernel.rng import LARGEST_SEED
    from adv2e.light.sensor import check_beside

    size = measured.width, measured.height
    if source is not None:
        frames, encoding = source.frames, source.encoding
    elif measured.frame_times_ns is not None:
        check_beside(*size, config.sensor, measured.path)
        config = replace(config, sensor=None)
        frames, encoding = measured.frames, measured.encoding
    else:
        raise DataError(
            f"{measured.path}: holds no frames to simulate with this configuration; give them with"
            " --frames"
        )
    simulate_events = resimulator(frames, config, encoding, size, threads=threads)
    return Resimulation(simulate_events, (config.seed, (config.seed + 1) % (LARGEST_SEED + 1)))
