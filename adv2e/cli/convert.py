"""``adv2e convert``: video or frames in, events out."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.cli.options import POSITIVE, SECONDS
from adv2e.formats import registry

if TYPE_CHECKING:
    from adv2e.cli.options import Log
    from adv2e.config import Config
    from adv2e.geometry import Rectangle, Size
    from adv2e.sources.base import Source


@click.command("convert", cls=Command)
@click.argument("source", metavar="INPUT", shell_complete=completion.files)
@options.run_options
@options.config_options
@options.source_options
@options.events_options
@click.option("--start", type=SECONDS, metavar="S", help="Begin S seconds after the first frame.")
@click.option("--stop", type=SECONDS, metavar="S", help="Stop S seconds after the first frame.")
@options.crop_option(
    "Take a part of each frame or sensor only, before anything else: first column, first row,"
    " columns, rows."
)
@click.option(
    "--size",
    type=options.SIZE,
    metavar="WxH",
    help="Size of the sensor, such as 346x260 (sensor.width and sensor.height). Frames are scaled"
    " and cut to it; sensor.fit says how. Of raw video it is the size of the frames, too."
    "  [default: as the frames are]",
)
@click.option(
    "--t0",
    type=click.Choice(["auto", "zero", "keep"]),
    default="auto",
    show_default=True,
    help="Where times begin. zero: at the first frame converted. keep, auto: as on the input's own"
    " clock; if it has none, at the input's first frame.",
)
@click.option(
    "--motion",
    type=click.Choice(["saccade", "shake", "pan"]),
    help="INPUT is one picture, before which the sensor moves: in three saccades, as N-MNIST was"
    " recorded, as a hand shakes, or to the right.",
)
@click.option(
    "--extent",
    "extent_px",
    type=POSITIVE,
    metavar="PX",
    help="How far it moves, in pixels of the sensor.  [default: 6, 8 or 32]",
)
@click.option(
    "--duration",
    "duration_s",
    type=POSITIVE,
    metavar="S",
    help="How long that takes, in seconds.  [default: 0.3, 1 or 1]",
)
@click.option(
    "--from",
    "choice",
    type=click.Choice(["frames", "events"]),
    help="What to take of an INPUT that holds both: simulate its frames, or write its events in"
    " another format.  [default: the frames of cameras' recordings; the events of other files]",
)
@click.option(
    "--format",
    metavar="NAME",
    shell_complete=completion.formats,
    help=f"Write this format, whatever the suffix: {', '.join(registry.names())}.",
)
@click.option(
    "--layout",
    metavar="NAME",
    shell_complete=completion.layouts,
    help=f"Layout of an HDF5 output: {', '.join(registry.layouts())}."
    f"  [default: {registry.layouts()[0]}]",
)
@click.option(
    "--with-frames",
    is_flag=True,
    help="Store the frames, too, in an HDF5 output. DAVIS240C outputs always hold them.",
)
@click.option(
    "--preview",
    metavar="FILE",
    shell_complete=completion.files,
    help="Also draw the frames beside the events, as 'adv2e render' does: a film (.mp4, .webm,"
    " .gif, .avi) or a sheet of pictures (.png).",
)
@click.option(
    "--causes",
    is_flag=True,
    help="Also store what made each event: the light, leak or a kind of noise. HDF5 holds it as"
    " events/causes, .npz and .csv as a column; beside other formats it is OUT.causes.txt.",
)
def command(
    source: str,
    output: str | None,
    config: Callable[[Size | None], Config],
    threads: int | None,
    log: Log,
    given: dict[str, Any],
    reading: dict[str, Any],
    start: float | None,
    stop: float | None,
    crop: Rectangle | None,
    size: Size | None,
    t0: str,
    choice: str | None,
    motion: str | None,
    extent_px: float | None,
    duration_s: float | None,
    **written: Any,
) -> None:
    """Turn a video or frames into events, or a file of events into another format.

    \b
    Examples:
      adv2e convert clip.mp4
      adv2e convert clip.mp4 -o clip.txt -c davis346 --set pixel.leak=null
      adv2e convert clip.mp4 --size 346x260
      adv2e convert frames/ --fps 240 -o events.h5 --with-frames
      adv2e convert urban.zip -o urban_simulated --preview urban.mp4
      adv2e convert photo.png --motion saccade -o photo.h5
      adv2e convert clip.events.h5 -o clip.txt
      ffmpeg -i clip.mp4 -f yuv4mpegpipe - | adv2e convert - -o piped.h5

    INPUT is a video file, a folder or a zip of images, a recording of a data set (DAVIS240C, GOPRO,
    TUM RGB-D, EuRoC, UZH-FPV), a TIFF of several pages, or a .npy stack of frames, grey (frames,
    rows, columns) or colour (with a fourth axis, of 3). INPUT - is standard input, through which
    Y4M or raw video comes. It may be a file of events, too: these are written in the format of OUT,
    and nothing is simulated. Frames from a pipe end with the first Ctrl-C: the events of those that
    came whole are written. A second Ctrl-C stops at once and leaves nothing.

    Without -o, the events go to <stem>.events.h5 in the current folder, or with the suffix of
    --format. The suffix of OUT chooses the format:

    \b
      .h5          HDF5
      .txt         text, a line for each event: seconds x y polarity
      .zip         a DAVIS240C recording: events.txt, images.txt and the frames
      no suffix    the same in a folder
      -            text to standard output
    """
    if given["fps"] is not None and given["timestamps"] is not None:
        raise click.UsageError("--fps and --timestamps both give the times of the frames: keep one")
    if given["fps"] is not None and given["time_unit"] is not None:
        raise click.UsageError("--time-unit is for lists of times, which --fps replaces: keep one")
    options.check_part(start, stop)
    if motion is None and (extent_px is not None or duration_s is not None):
        raise click.UsageError("--extent and --duration are of the path that --motion makes")
    part: dict[str, Any] = {"start_s": start, "stop_s": stop, "t0": t0, "crop": crop}
    if _takes_events(source, choice, given["track"]):
        from adv2e.conversion.transfer import convert_events

        del written["preview"]
        if output is None:
            raise click.UsageError("-o OUT is missing: say what to write the events to")
        part |= {name: given[name] for name in ("time_unit", "rotate180", "track")} | reading
        summary = convert_events(
            source, output, size=size, threads=threads, log=log, **part, **written
        )
        if log.level >= 0:
            click.echo(summary.text(), err=output == "-")
        return
    if any(reading.values()):
        from adv2e.errors import DataError

        raise DataError(
            f"{source}: its frames are simulated: --set-back and --crop-events are for events,"
            " leave them out"
        )
    from adv2e.compiled import import_ahead

    import_ahead()
    from adv2e.conversion.reading import Reading

    if motion is not None:
        from adv2e.sources.paths import SensorPath

        part["along"] = SensorPath(motion, extent_px, duration_s)
    opened = Reading(source, **given, **part, frame_size=size, threads=threads)
    # it reads while all else that is needed is imported
    with opened, opened.capturing(_ENDED if log.level >= 0 else ""):
        from adv2e.conversion.pipeline import convert_reading

        gc.freeze()  # all that was imported stays; looking through it for garbage takes its time
        chosen = config(None if crop and given["pixel_format"] else size)
        if output != "-" and opened.is_open:
            wanted = {**given, **part, **written, "threads": threads}
            _tell_of_much(opened.source, chosen, Path(output or "events.h5"), wanted, log)
        summary = convert_reading(
            opened,
            output,
            config=chosen,
            also_read=options.files_given(),
            log=log,
            **written,
        )
    if log.level >= 0:
        click.echo(summary.text(), err=output == "-")


def _tell_of_much(
    source: Source, config: Config, output: Path, given: dict[str, Any], log: Log
) -> None:
    """Warn of a very large output, or of one larger than the free disk space, by an estimate."""
    from adv2e.conversion.estimate import estimate, may_be_much

    if not may_be_much(source):
        return
    options = {key: given[key] for key in given if key not in ("overwrite", "preview", "progress")}
    found = estimate(source.path, output, config, **options)
    folder = output.absolute().parent
    if found is not None and found.is_much(folder):
        log(found.text(folder))


_ENDED = "capture ended: what came is converted; a second Ctrl-C stops at once and keeps nothing"

_OF_SIMULATION = (
    *("config_files", "sets", "seed", "effect_files"),
    *("fps", "timestamps", "allow_damaged", "bayer", "pixel_format", "motion", "preview"),
)
"""Options that say how frames are simulated."""


def _takes_events(source: str, choice: str | None, track: str | None) -> bool:
    """Tell whether to copy the events of the source, without a simulation.

    Raises
    ------
    DataError
        Events are copied, but options of a simulation are given.
    """
    if choice is None and not registry.may_hold_events(Path(source)):
        return False
    from adv2e.errors import DataError
    from adv2e.formats.frames import takes_events

    if not takes_events(Path(source), choice, track):
        return False
    context = click.get_current_context()
    for parameter in context.command.params:
        name = parameter.name or ""
        written = context.get_parameter_source(name) is not ParameterSource.DEFAULT
        if name in _OF_SIMULATION and written:
            raise DataError(
                f"{source}: its events are written, nothing is simulated: leave out"
                f" {parameter.opts[-1]}, or take its frames, if it has any, with --from frames"
            )
    return True
