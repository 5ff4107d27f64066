"""``adv2e batch``: every sequence below a folder, in such a way that it can be done again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from adv2e.cli import completion, options
from adv2e.cli.commands import Command
from adv2e.files.names import shown
from adv2e.formats import registry
from adv2e.process import bars

if TYPE_CHECKING:
    from adv2e.batch.exports import Export
    from adv2e.batch.plan import Task
    from adv2e.batch.work import Engine
    from adv2e.cli.options import Log
    from adv2e.conversion.estimate import Estimate
    from adv2e.formats.registry import Format
    from adv2e.geometry import Size

# adv2e.batch.sequences.LAYOUTS, without the time that importing it takes
LAYOUTS = ("auto", "gopro", "ddd17", "davis240c", "images", "videos")
# adv2e.batch.exports.KINDS, likewise
EXPORTS = ("e2vid", "voxel", "ev-segnet")

_UNKNOWN = (
    "how much comes and how long it takes is not known: a tenth of the work tells nothing of it"
)

_LARGE_SOURCE = 100_000_000
"""Bytes of source from which on it is worth to look how much will come out."""


@click.command("batch", cls=Command)
@click.argument(
    "source", metavar="SOURCE", type=click.Path(path_type=str), shell_complete=completion.files
)
@click.argument(
    "dest", metavar="DEST", type=click.Path(path_type=str), shell_complete=completion.files
)
@options.files_option(
    "Configuration: a YAML file or a shipped name, such as davis346. Repeatable: a later one wins."
)
@options.sets_option("Set one key, such as pixel.low_pass.cutoff_hz=100. Repeatable.")
@click.option(
    "--seed",
    type=options.SEED,
    metavar="N",
    help="Seed of the batch. Each sequence has one of its own, made of this and its name.",
)
@options.effect_option
@click.option(
    "--layout",
    type=click.Choice(LAYOUTS),
    default="auto",
    show_default=True,
    help="Which sequences count.",
)
@click.option(
    "--format",
    metavar="NAME",
    default="h5",
    show_default=True,
    shell_complete=completion.formats,
    help=f"Format of the files: {', '.join(registry.names())}.",
)
@click.option("--fps", metavar="F", callback=options.rate, help="Take all frames at F a second.")
@click.option("--size", type=options.SIZE, metavar="WxH", help="Size of the sensor.")
@options.rotate_option()
@options.track_option("every sequence")
@click.option("--with-frames", is_flag=True, help="Store the frames, too, in HDF5.")
@click.option("--causes", is_flag=True, help="Store what made each event, too.")
@click.option(
    "--export",
    "kind",
    type=click.Choice(EXPORTS),
    help="Make a training set of the events of each sequence, too, as 'adv2e export' does. Stores"
    " the frames where it needs them.",
)
@click.option(
    "--window",
    "window_us",
    type=options.TIME,
    metavar="TIME",
    help="Of --export voxel: windows of TIME, such as 33ms.  [default: from image to image]"
    "  Of --export ev-segnet: the time before each image.  [default: 50ms]",
)
@click.option(
    "--bins",
    type=options.WholeNumber(1, 10_000),
    metavar="N",
    help="Of --export voxel: temporal bins of a grid.  [default: 5]",
)
@click.option(
    "--jobs",
    type=options.WholeNumber(min=1),
    metavar="N",
    help="Convert N sequences at a time.  [default: one for each thread]",
)
@click.option("--shard", metavar="I/N", help="Do only the I-th of N parts of about the same size.")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Convert on the workers of this Dask scheduler, such as tcp://node1:8786 or the file that"
    " it wrote. --jobs N bounds how many at a time; each has --threads, 1 by default.",
)
@click.option("--dry-run", is_flag=True, help="Show what would be done, and write nothing.")
@click.option("--overwrite", is_flag=True, help="Make all anew, and replace files of others.")
@options.threads_option
@options.reporting_options
def command(
    source: str,
    dest: str,
    config_files: tuple[str, ...],
    sets: tuple[str, ...],
    seed: int | None,
    effect_files: tuple[str, ...],
    layout: str,
    format: str,
    size: Size | None,
    with_frames: bool,
    kind: str | None,
    window_us: int | None,
    bins: int | None,
    jobs: int | None,
    shard: str | None,
    scheduler: str | None,
    dry_run: bool,
    overwrite: bool,
    threads: int | None,
    progress: bool,
    log: Log,
    **given: Any,
) -> None:
    """Convert every sequence below the folder SOURCE, and make the same tree below DEST.

    \b
    Examples:
      adv2e batch videos/ events/
      adv2e batch GOPRO_Large_all/ events/ -c davis346 --seed 1 --jobs 4
      adv2e batch videos/ events/ --dry-run
      adv2e batch videos/ events/ --shard 2/8
      adv2e batch videos/ training/ -c vid2e -c train-e2vid --export e2vid

    Killed or done, it may be called again: it makes what is missing, and what has changed since in
    its source, its settings or the version of adv2e. Files that it keeps are compared with what
    DEST/manifest.jsonl says of them. A sequence that fails does not stop the others; at the end
    all of these are listed, and the exit status is 1.
    """
    from adv2e.batch.manifest import manifest_path
    from adv2e.batch.plan import parse_shard
    from adv2e.batch.run import Batch, Settings, reasons, table

    for name in (source, dest):
        if "://" in name:
            raise click.UsageError(
                f"{name}: addresses are not read: mount it as a folder, or copy it (such as by"
                " rclone)"
            )
    part = None if shard is None else parse_shard(shard)
    options.check_sets(sets, seed, size)
    if size is not None:
        sets = (*sets, f"sensor.width={size[0]}", f"sensor.height={size[1]}")
    written = registry.to_write(Path("a"), format)
    export = _export(kind, window_us, bins, written)
    if with_frames:
        registry.check_frames(written)
    with_frames = with_frames or (export is not None and export.needs_frames)
    given |= {"format": format, "with_frames": with_frames}
    suffix = next(iter(written.suffixes))
    settings = Settings(config_files, sets, effect_files, seed, suffix, given, export)
    with ExitStack() as stack:
        work = Batch(
            Path(source), Path(dest), settings, layout=layout, shard=part, overwrite=overwrite
        )
        engine = _engine(scheduler, manifest_path(Path(dest), part), jobs, threads, log)
        if dry_run:
            tasks = work.plan()
            for task in tasks:
                log(f"{shown(task.sequence.name)}: {task.why or 'kept'}", 0 if task.why else 1)
            click.echo(reasons(tasks))
            for line in work.passed:
                log(shown(line))
            if any(task.why and not task.only_export for task in tasks):
                coming = work.forecast(tasks, jobs, threads)
                click.echo(coming.text(Path(dest)) if coming else _UNKNOWN)
            return
        told = _Told(
            log, progress, stack, Path(dest), lambda tasks: work.forecast(tasks, jobs, threads)
        )
        outcome = work.run(
            jobs=jobs,
            threads=threads,
            engine=engine,
            begun=told.begun,
            ended=told.ended,
        )
    lines = table(outcome)
    if log.level >= 0:
        click.echo(lines[0])
    for line in lines[1:]:
        click.echo(line, err=True)
    for line in work.passed:
        log(shown(line))
    if outcome.failed:
        raise click.exceptions.Exit(1)


def _engine(
    scheduler: str | None,
    manifest: Path,
    jobs: int | None,
    threads: int | None,
    log: Log,
) -> Engine | None:
    """Return the Dask cluster that converts; None: processes of this machine."""
    if scheduler is None:
        return None
    from adv2e.batch.cluster import Cluster

    return Cluster(scheduler, manifest, at_most=jobs, threads=threads or 1, log=log)


def _export(
    kind: str | None, window_us: int | None, bins: int | None, written: Format
) -> Export | None:
    """Return the settings of --export, None without; UsageError if other options do not fit it."""
    from adv2e.batch.exports import Export

    if window_us is not None and kind not in ("voxel", "ev-segnet"):
        raise click.UsageError("--window is for --export voxel and --export ev-segnet")
    if bins is not None and kind != "voxel":
        raise click.UsageError("--bins is for --export voxel")
    if kind is None:
        return None
    export = Export(kind, window_us, bins or 5)
    if export.needs_frames and "w" not in written.frames:
        raise click.UsageError(
            f"--export {kind} needs frames, and {written.what} holds events alone: leave out"
            " --format"
        )
    return export


class _Told:
    """The bar over all sequences, and a line for each failure."""

    def __init__(
        self,
        log: Log,
        progress: bool,
        stack: ExitStack,
        dest: Path,
        forecast: Callable[[list[Task]], Estimate | None],
    ) -> None:
        self._log, self._progress, self._stack, self._dest = log, progress, stack, dest
        self._forecast = forecast
        self._bar: Any = None

    def begun(self, tasks: list[Task]) -> None:
        from adv2e.batch.run import reasons

        self._log(reasons(tasks))
        total = sum(task.state.bytes for task in tasks if task.why)
        if total > _LARGE_SOURCE:
            coming = self._forecast(tasks)
            if coming is not None and coming.is_much(self._dest):
                self._log(coming.text(self._dest))
        if self._progress:
            self._bar = self._stack.enter_context(
                bars.bar(total=total, unit="B", unit_scale=True, desc="batch")
            )

    def ended(self, task: Task, record: Mapping[str, Any]) -> None:
        from adv2e.batch.run import error_of

        if self._bar is not None:
            self._bar.update(task.state.bytes)
        name = shown(task.sequence.name)
        wrong = error_of(record)
        if wrong:
            self._log(f"{name}: {wrong}")
            return
        self._log(f"{name}: {record['events']:,} events", 1)
        for note in [*record["notes"], *record.get("export", {}).get("notes", ())]:
            self._log(f"{name}: {note}", 1)
