"""``adv2e convert``: video or frames in, events out."""

from __future__ import annotations

import gc
from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.formats import registry
from adv2e.options import ConvertOptions

if TYPE_CHECKING:
    from adv2e.cli.options import Layers, Log

_ENDED = "capture ended: what came is converted; a second Ctrl-C stops at once and keeps nothing"


@click.command("convert", cls=Command)
@click.argument("source", metavar="INPUT", shell_complete=completion.files)
@options.output_options
@options.reporting_options
@options.config_options()
@options.declared_options(
    ConvertOptions,
    help={
        "format": f"One of: {', '.join(registry.names())}.",
        "layout": f"One of: {', '.join(registry.layouts())}.  [default: {registry.layouts()[0]}]",
    },
)
def command(
    source: str,
    output: str | None,
    overwrite: bool,
    layers: Layers,
    given: dict[str, Any],
    progress: bool,
    log: Log,
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
      adv2e convert 0 --stop 10 -o live.h5

    INPUT is a video file, a folder or a zip of images, a recording of a data set (DAVIS240C, GOPRO,
    TUM RGB-D, EuRoC, UZH-FPV), a TIFF of several pages, or a .npy stack of frames, grey (frames,
    rows, columns) or colour (with a fourth axis, of 3). INPUT - is standard input, through which
    Y4M or raw video comes. A camera at this computer is a number, or
    /dev/video0. An address is read with --network. INPUT may be a file of events, too: these are
    written in the format of OUT, and nothing is simulated. Frames from a pipe or a camera end with
    the first Ctrl-C: the events of those that came whole are written. A second Ctrl-C stops at once
    and leaves nothing.

    Without -o, the events go to <stem>.events.h5 in the current folder, or with the suffix of
    --format. The suffix of OUT chooses the format:

    \b
      .h5          HDF5
      .txt         text, a line for each event: seconds x y polarity
      .zip         a DAVIS240C recording: events.txt, images.txt and the frames
      no suffix    the same in a folder
      -            text to standard output
    """
    from adv2e.compiled import import_ahead
    from adv2e.conversion.convert import convert_input

    wanted = {**given, "overwrite": overwrite, "progress": progress}
    # effects of others may compile what SciPy computes for Numba, which that import leaves out
    is_ours = not layers.effect_files

    summary = convert_input(
        source,
        output,
        layers.config,
        configured=layers.first_given,
        also_read=layers.files,
        log=log,
        begin=import_ahead if is_ours else lambda: None,
        ready=gc.freeze,  # what was imported stays; looking through it for garbage takes time
        capturing=_ENDED if log.level >= 0 else "",
        **wanted,
    )
    if log.level >= 0:
        click.echo(summary.text(), err=output == "-")
