"""``adv2e render``: pictures and films of events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.options import RenderOptions

if TYPE_CHECKING:
    from adv2e.cli.options import Log


@click.command("render", cls=Command)
@click.argument("events", metavar="EVENTS", shell_complete=completion.files)
@options.output_options
@options.reporting_options
@click.option(
    "--beside/--no-beside",
    "frames",
    default=None,
    help="Show the frames to the left of the events.  [default: if there are frames]",
)
@options.declared_options(RenderOptions, help={"start_s": "Here, whichever is earlier."})
def command(
    events: str,
    output: str | None,
    overwrite: bool,
    log: Log,
    frames: bool | None,
    progress: bool,
    given: dict[str, Any],
) -> None:
    """Make pictures and films of events.

    \b
    Examples:
      adv2e render clip.events.h5 -o events.mp4
      adv2e render clip.events.h5 -o slow.gif --start 0.2 --stop 0.4 --speed 0.1
      adv2e render urban.zip -o urban.png --at 1.5 --at 2.5 --window 10 --style grey

    EVENTS is a file of events (.txt, .h5, .hdf5, .npz) or a recording (a DAVIS240C folder or zip).
    Times are counted from its first event or frame. The suffix of OUT chooses what is made:

    \b
      .mp4    a film (H.264) for browsers, slides and everything else
      .webm   a film (VP8) for Chrome, Edge, Firefox, VLC, and Safari from 14.1 on
      .gif    a film for everything that shows pictures, at most 50 pictures a second
      .avi    a film without any loss (HuffYUV) for VLC, mpv and ffmpeg, but for no browser
      .png    a sheet of one or several pictures
    """
    if output is None:
        raise click.UsageError("-o is missing: a .mp4, .webm, .avi, .gif or .png file")
    from adv2e.rendering.render import render

    how = {**given, "overwrite": overwrite, "progress": progress}
    render(events, output, frames=frames, doubt=log, **how)
    log(f"{output}: written")
