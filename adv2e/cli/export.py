"""``adv2e export``: recordings in, training sets and representations out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from adv2e.cli import completion, options
from adv2e.cli.commands import Command

if TYPE_CHECKING:
    from adv2e.cli.options import Log
    from adv2e.geometry import Size

_OPTIONS = {
    "voxel": {"bins", "window_us", "count", "at", "normalise", "polarity", "span", "most_empty"},
    "ev-segnet": {"window_us", "split", "rows", "counts"},
    "e2vid": {"valid"},
}
"""Options that only some exports take."""


@click.command("export", cls=Command)
@click.argument(
    "events", metavar="EVENTS...", nargs=-1, required=True, shell_complete=completion.files
)
@options.output_options
@click.option(
    "--to",
    required=True,
    type=click.Choice(list(_OPTIONS)),
    help="What to make: voxel grids, pictures for Ev-SegNet, or a training set for E2VID.",
)
@click.option(
    "--window",
    "window_us",
    type=options.TIME,
    metavar="TIME",
    help="Cut the events into windows of TIME, such as 33ms. For ev-segnet: the time before each"
    " image.  [default: ev-segnet: 50ms]",
)
@click.option(
    "--count", type=options.WholeNumber(1), metavar="N", help="Cut into windows of N events."
)
@click.option(
    "--max-empty",
    "most_empty",
    type=options.WholeNumber(1),
    default=1000,
    show_default=True,
    metavar="N",
    help="Most windows of TIME in a row without an event: one wrong time would make far too many.",
)
@click.option("--at", type=click.Choice(["images"]), help="Cut where the images are.")
@click.option(
    "--bins",
    type=options.WholeNumber(1, 10_000),
    default=5,
    show_default=True,
    metavar="N",
    help="Temporal bins of a voxel grid.",
)
@click.option(
    "--normalise",
    type=click.Choice(["none", "e2vid", "event_cnn_minimal"]),
    default="none",
    show_default=True,
    help="e2vid: mean 0 and deviation 1 over the cells that are not zero. event_cnn_minimal: its"
    " RobustNorm, 0th to 95th percentile.",
)
@click.option(
    "--polarity",
    type=click.Choice(["signed", "split"]),
    default="signed",
    show_default=True,
    help="signed: ON counts +1, OFF -1. split: the bins of ON, then those of OFF.",
)
@click.option(
    "--span",
    type=click.Choice(["events", "window"]),
    default="events",
    show_default=True,
    help="The bins reach from the first to the last event, as in E2VID, or over the whole window.",
)
@click.option(
    "--split",
    type=click.Choice(["train", "test", "other"]),
    default="train",
    show_default=True,
    help="Part of the data set of Ev-SegNet.",
)
@click.option(
    "--rows",
    type=options.WholeNumber(1),
    metavar="N",
    help="Keep the upper N rows.  [default: 200 of 346x260 pixels, as DDD17 was cut; else all]",
)
@click.option(
    "--counts",
    type=click.Choice(["scaled", "raw"]),
    default="scaled",
    show_default=True,
    help="Counts of Ev-SegNet: scaled to -1...1, or as counted.",
)
@click.option(
    "--valid",
    type=options.FiniteNumber(0, 0.9),
    default=0.2,
    show_default=True,
    metavar="SHARE",
    help="Share that is for validation: of the recordings, or of the images if there is one.",
)
@options.time_unit_option
@options.track_option("each of EVENTS")
@click.option(
    "--size",
    type=options.SIZE,
    metavar="WxH",
    help="Size of the sensor, where the files do not state it.",
)
@options.events_options
@options.threads_option
@options.reporting_options
def command(
    events: tuple[str, ...],
    output: str | None,
    overwrite: bool,
    to: str,
    window_us: int | None,
    count: int | None,
    at: str | None,
    time_unit: str | None,
    track: str | None,
    size: Size | None,
    reading: dict[str, Any],
    threads: int | None,
    log: Log,
    **given: Any,
) -> None:
    """Make training sets and representations of events.

    \b
    Examples:
      adv2e export clip.events.h5 -o grids --to voxel --window 33ms
      adv2e export clip.zip -o grids --to voxel --at images --bins 5 --normalise e2vid
      adv2e export first.h5 second.h5 -o training --to e2vid
      adv2e export drive.h5 -o segmentation --to ev-segnet

    EVENTS are recordings or event files, simulated or measured. For e2vid, ev-segnet and --at
    images they must hold images: 'adv2e convert --with-frames' stores them.
    """
    _check(to, output, window_us, count, at)
    from adv2e.export import export as exports

    assert output is not None
    how = {**reading, "time_unit": time_unit, "size": size, "track": track}
    how |= {"overwrite": overwrite, "doubt": log}
    paths = [Path(path) for path in events]
    if to == "voxel":
        from adv2e.export.voxels import VoxelSettings

        settings = {name: given[name] for name in ("bins", "normalise", "polarity", "span")}
        cutting = exports.Cutting(window_us, count, at == "images")
        how["most_empty"] = given["most_empty"]
        done = exports.export_voxels(paths, output, cutting, VoxelSettings(**settings), **how)
    elif to == "ev-segnet":
        from adv2e.export.ev_segnet import SegmentationSettings

        chosen = SegmentationSettings(given["split"], given["rows"], given["counts"] == "scaled")
        done = exports.export_ev_segnet(paths, output, window_us or 50_000, chosen, **how)
    else:
        done = exports.export_e2vid(paths, output, given["valid"], threads, **how)
    if log.level >= 0:
        click.echo(done.text())


def _check(
    to: str, output: str | None, window_us: int | None, count: int | None, at: str | None
) -> None:
    """Raise UsageError where options are missing, or do not fit what is made."""
    if output is None:
        raise click.UsageError("-o DIR is missing: name the folder to write")
    context = click.get_current_context()
    names = {parameter.name: parameter.opts[-1] for parameter in context.command.params}
    for name in set().union(*_OPTIONS.values()) - _OPTIONS[to]:
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{names[name]} is not for --to {to}: leave it out")
    cuts = [window_us is not None, count is not None, at is not None]
    if to == "voxel" and sum(cuts) != 1:
        raise click.UsageError("--to voxel needs one of --window TIME, --count N and --at images")
