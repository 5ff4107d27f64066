"""``adv2e render``: pictures and films of events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.cli.options import POSITIVE, SECONDS
from adv2e.cli.progress import reading_told

if TYPE_CHECKING:
    from adv2e.cli.options import Log


@click.command("render", cls=Command)
@click.argument("events", metavar="EVENTS", shell_complete=completion.files)
@options.output_options
@options.reporting_options
@click.option(
    "--style",
    type=click.Choice(["white", "black", "grey", "surface"]),
    default="white",
    show_default=True,
    help="white, black: coloured events on that ground. grey: the net count of events, as v2e draws"
    " it. surface: colours that fade with age.",
)
@click.option(
    "--on-color",
    default="red",
    show_default=True,
    metavar="COLOR",
    help="Colour of ON events: a name or #rrggbb.",
)
@click.option(
    "--off-color",
    default="blue",
    show_default=True,
    metavar="COLOR",
    help="Colour of OFF events: a name or #rrggbb.",
)
@click.option(
    "--window",
    type=POSITIVE,
    metavar="MS",
    help="A picture shows the events of the last MS milliseconds.  [default: in a film, those since"
    " the picture before; in a .png 20]",
)
@click.option(
    "--fps",
    type=POSITIVE,
    default=30.0,
    show_default=True,
    metavar="F",
    help="Pictures a second of a film.",
)
@click.option(
    "--speed",
    type=POSITIVE,
    default=1.0,
    show_default=True,
    metavar="X",
    help="Speed of a film: 1 is real time, 0.1 is ten times slower.",
)
@click.option(
    "--start", "start_s", type=SECONDS, default=0.0, metavar="S", help="Begin S seconds in."
)
@click.option("--stop", "stop_s", type=SECONDS, metavar="S", help="Stop S seconds in.")
@click.option(
    "--at",
    "at_s",
    type=SECONDS,
    multiple=True,
    metavar="S",
    help="Show this instant in a .png. Repeatable.",
)
@click.option(
    "--count",
    type=options.WholeNumber(min=1, max=100),
    default=6,
    show_default=True,
    metavar="N",
    help="Show N instants in a .png, about evenly spaced, if there is no --at.",
)
@click.option(
    "--beside/--no-beside",
    "frames",
    default=None,
    help="Show the frames to the left of the events.  [default: if there are frames]",
)
@click.option(
    "--scale",
    type=options.WholeNumber(min=1, max=32),
    metavar="N",
    help="Draw each pixel N times as wide and high.  [default: panels about 640 pixels wide]",
)
@click.option(
    "--max-pictures",
    type=options.WholeNumber(min=1),
    default=36_000,
    show_default=True,
    metavar="N",
    help="Most pictures of a film: one wrong time would make far too many.",
)
@options.time_unit_option
@options.rotate_option()
@options.track_option("EVENTS")
@options.events_options
def command(
    events: str,
    output: str | None,
    log: Log,
    style: str,
    on_color: str,
    off_color: str,
    window: float | None,
    frames: bool | None,
    progress: bool,
    time_unit: str | None,
    rotate180: bool,
    track: str | None,
    reading: dict[str, Any],
    **shown: Any,
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
    options.check_part(shown["start_s"], shown["stop_s"])
    from adv2e.formats.reading import read_events
    from adv2e.rendering import render_recording
    from adv2e.rendering.render import chosen_style

    about = {name: shown[name] for name in ("fps", "speed", "at_s")}
    chosen = chosen_style(output, style, on_color, off_color, window_ms=window, **about)
    reading |= {"time_unit": time_unit, "rotate180": rotate180, "track": track}
    with reading_told(events, progress) as told:
        recording = read_events(events, progress=told, **reading)
    for problem in recording.problems:
        log(f"{events}: {problem}")
    if frames and recording.frame_times_ns is None:
        log(f"{events}: holds no frames to show beside the events")
    shown.update(style=chosen, frames=frames is not False, progress=progress)
    render_recording(recording, output, **shown)
    log(f"{output}: written")
