"""A whole batch: find, plan, convert what is missing, and write down what was made from what."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adv2e import __version__
from adv2e.background import default_threads
from adv2e.batches import processes
from adv2e.batches.manifest import Manifest, check_alone, manifest_path, read_records
from adv2e.batches.plan import (
    Task,
    Wanted,
    outputs,
    parse_shard,
    plan,
    seed_of,
    shard_of,
)
from adv2e.batches.recipe import Recipe, write_recipe
from adv2e.batches.sequences import Sequence as Found
from adv2e.batches.sequences import find_sequences
from adv2e.batches.work import Engine, Export, Job
from adv2e.config import Family, Written, load_family, to_dict
from adv2e.config.active_effects import user_sources
from adv2e.config.user_effects import load_effects
from adv2e.errors import Adv2eError, DataError, OutputError, UsageError
from adv2e.files.regular import shown
from adv2e.files.states import digest_of_values, state_of
from adv2e.formats.registry import check_frames, to_write
from adv2e.light.interpolation import network_of
from adv2e.options import (
    EXPORTS,
    AnyFrames,
    BatchOptions,
    Clock,
    MotionOptions,
    Part,
    declared,
    size_of,
    takes,
)
from adv2e.process import bars

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from adv2e.formats.registry import Format


@dataclass(frozen=True)
class Settings:
    """Settings with which all sequences of a batch are converted.

    Attributes
    ----------
    config : what :func:`adv2e.load_config` takes
    sets, effect_files : tuple of str
    seed : int, optional
        From which those of the sequences come; default: that of the configuration.
    suffix : str
        Of the files to write; empty: folders.
    options : dict
        Further arguments of :func:`adv2e.convert`.
    export : Export, optional
        What is made of the events.
    given : mapping
        Options of the batch, for its recipe.
    """

    config: Written | Sequence[Written] | None
    sets: tuple[str, ...]
    effect_files: tuple[str, ...]
    seed: int | None
    suffix: str
    options: Mapping[str, Any]
    export: Export | None = None
    given: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def family(self) -> Family:
        """The configuration for each seed; ConfigError, UsageError if it is wrong."""
        effects = [effect for file in self.effect_files for effect in load_effects(file)]
        return load_family(self.config, self.sets, self.seed, effects)

    def wanted(self, dest: Path) -> Wanted:
        """Return the settings of the files, with their digest; ConfigError, UsageError if wrong."""
        config = self.family.config
        network = network_of(config.sampling)
        made = self.family.written()
        del made["seed"]  # each sequence has its own
        del made["max_events"]  # what was made is within it
        digest = digest_of_values(
            made,
            dict(self.options),
            [dict(one) for one in user_sources(config)],
            network and network.source,
        )
        return Wanted(dest, self.suffix, config.seed, digest, self.export)


@dataclass(frozen=True)
class Outcome:
    """Outcome of a batch: tasks, failures, and number of events made.

    Attributes
    ----------
    tasks : list of Task
        All sequences, or those of the shard.
    failed : dict
        What went wrong, by the name of the sequence.
    events : int
        Made, not those that were kept.
    passed : int
        Files and folders that were passed over, of all shards.
    told : tuple of str
        Some of them, and why, a line each.
    """

    tasks: list[Task]
    failed: dict[str, str]
    events: int
    passed: int = 0
    told: tuple[str, ...] = ()

    @property
    def made(self) -> int:
        return sum(bool(one.why) and one.sequence.name not in self.failed for one in self.tasks)

    @property
    def kept(self) -> int:
        return sum(not task.why for task in self.tasks)


class Batch:
    """The sequences of a batch, or of one of its shards, and what is to be done with them.

    Parameters
    ----------
    source, dest : Path
        Where sequences are, and where the same tree of events is made.
    layout : str
        Which sequences count; see :mod:`adv2e.batches.sequences`.
    shard : (int, int), optional
        (I, N): only the I-th of N parts of about the same size.
    overwrite : bool
        Make all anew, and replace files that others made.
    recipe : Recipe, optional
        What is to come out.

    Attributes
    ----------
    dest, manifest : Path
        Folder of the events, and the file of records in it.
    passed : list of str
        Files and folders that were passed over, and why.

    Raises
    ------
    Adv2eError
        There is nothing to convert, or settings are wrong.
    """

    def __init__(
        self,
        source: Path,
        dest: Path,
        settings: Settings,
        *,
        layout: str = "auto",
        shard: tuple[int, int] | None = None,
        overwrite: bool = False,
        recipe: Recipe | None = None,
    ) -> None:
        self._recipe = recipe
        self.dest, self._settings, self._overwrite = dest, settings, overwrite
        self.manifest = manifest_path(dest, shard)
        self._wanted = settings.wanted(dest)
        found = find_sequences(
            source,
            layout,
            leave_out=dest,
            fps=settings.options.get("fps"),
            stills="motion" in settings.options,
        )
        self._sequences, self.passed = found.sequences, found.told()
        self._passed = sum(map(len, found.passed.values()))
        if recipe is not None:
            if recipe.settings != self._wanted.settings:
                raise DataError("the recipe is of other effects or networks: give --effect FILE")
            self._sequences = recipe.chosen(self._sequences)
        self._names = {one.name for one in self._sequences}
        self._states = {one.name: state_of(one.source) for one in self._sequences}
        if shard is not None:
            mine = shard_of(self._states, *shard)
            self._sequences = [one for one in self._sequences if one.name in mine]
        self._check_draws()
        _check_apart(self._wanted, self._sequences)

    def _check_draws(self) -> None:
        """Raise the error of the first sequence for which numbers are drawn that cannot be."""
        name = ""
        try:
            for one in self._sequences if self._settings.family.forms else ():
                name = one.name
                self._settings.family.of(seed_of(self._wanted.seed, name))
        except Adv2eError as error:
            raise type(error)(f"{shown(name)}: {error}") from None

    def plan(self) -> list[Task]:
        """Return the tasks of the batch; files that are kept are compared with their digests.

        Raises
        ------
        OutputError
            A file that this batch did not make lies where one is to go, or a link leads out.
        """
        records = read_records(self.dest)
        tasks = plan(
            self._sequences, self._states, records, self._wanted, overwrite=self._overwrite
        )
        made, dest = list(outputs(tasks, self._wanted)), self.dest.resolve()
        for path in (path for _, path in made if dest not in path.resolve().parents):
            raise OutputError(f"{shown(path)}: a link leads out of {shown(self.dest)}: remove it")
        strange = (path for name, path in made if name not in records and path.exists())
        for path in strange if not self._overwrite else ():
            raise OutputError(
                f"{shown(path)}: exists and was not made by this batch: choose another DEST, or"
                " --overwrite replaces it"
            )
        return tasks

    def run(
        self,
        *,
        jobs: int | None = None,
        threads: int | None = None,
        engine: Engine | None = None,
        begun: Callable[[list[Task]], None] = lambda tasks: None,
        ended: Callable[[Task, Mapping[str, Any]], None] = lambda task, record: None,
    ) -> Outcome:
        """Convert every sequence of which the file is missing or out of date.

        Parameters
        ----------
        jobs : int, optional
            Conversions at a time; default: as many as there are threads.
        threads : int, optional
            Threads of all together; default: all cores.
        engine : callable, optional
            Who converts; default: processes of this machine.
        begun, ended : callable
            Told what is planned, and each sequence with what the manifest says of it.

        Raises
        ------
        Adv2eError
            As :meth:`plan`; or another batch works there.  What is wrong with a sequence is in the
            outcome.
        """
        failed: dict[str, str] = {}
        events = 0
        with Manifest(self.manifest) as manifest:
            check_alone(manifest.path)
            tasks = self.plan()
            begun(tasks)
            waiting = {task.sequence.name: task for task in tasks if task.why}
            count, each = _shares(len(waiting), jobs, threads)
            for task in waiting.values():
                task.output.parent.mkdir(parents=True, exist_ok=True)
                if not task.only_export:
                    manifest.add({"name": task.sequence.name, "status": "started"})
            work = (_job(task, self._settings, self._wanted, each) for task in waiting.values())
            for job, found in (engine or processes.run)(work, count):
                record = _record(waiting[job.name], self._wanted, job, found)
                manifest.add(record)
                events += found.get("events", 0)
                if wrong := error_of(found):
                    failed[job.name] = wrong
                ended(waiting[job.name], record)
            if self._wanted.export is not None:
                self._wanted.export.write_lists(self.dest, read_records(self.dest).values())
            self._compare(tasks, failed)
        return Outcome(tasks, failed, events, self._passed, tuple(self.passed))

    def _compare(self, tasks: Sequence[Task], failed: dict[str, str]) -> None:
        """Note what is not as the recipe says, and write that of what is there."""
        records, settings = read_records(self.dest), self._settings
        for name in (task.sequence.name for task in tasks if task.sequence.name not in failed):
            if self._recipe and (wrong := self._recipe.complaint(records[name], self._wanted)):
                failed[name] = wrong
        names, config = self._names, settings.family.written()
        write_recipe(self._wanted, config, settings.given, records, names.__contains__)


@takes(BatchOptions)
def batch(
    source: str | Path,
    dest: str | Path,
    config: Written | Sequence[Written] | None = None,
    *,
    sets: Sequence[str] = (),
    seed: int | None = None,
    effects: Sequence[str | Path] = (),
    log: Callable[[str, int], None] = lambda text, level: None,
    **options: Unpack[BatchOptions],
) -> Outcome:
    """Convert every sequence below a folder, and make the same tree below another.

    It may be called again: it makes what is missing, and what has changed since in its source, its
    settings or the version of adv2e.

    Parameters
    ----------
    source, dest : str or Path
        Folder of sequences, and folder of the events.
    config : what :func:`adv2e.load_config` takes, optional
    sets : sequence of str
        Single keys, such as ``pixel.low_pass.cutoff_hz=100``.
    seed : int, optional
        Seed of the batch. Each sequence has one of its own, made of this and its name.
    effects : sequence of path
        Files of effects of your own.
    log : callable
        Takes lines for people, and how much is asked for who sees them: 0, or 1 for more.
    **options
        See :class:`adv2e.options.BatchOptions`.

    Returns
    -------
    Outcome
        Its `failed` says what went wrong with a sequence, by its name.

    Raises
    ------
    Adv2eError
        There is nothing to convert, settings are wrong, or files of others are in the way.

    Examples
    --------
    >>> import os, tempfile
    >>> import cv2
    >>> import numpy as np
    >>> from adv2e import batch
    >>> folder = tempfile.TemporaryDirectory()
    >>> clips, events = (os.path.join(folder.name, name) for name in ("clips", "events"))
    >>> os.makedirs(os.path.join(clips, "first"))
    >>> for number in range(3):
    ...     picture = np.full((24, 32), 40 + 60 * number, np.uint8)
    ...     _ = cv2.imwrite(os.path.join(clips, "first", f"{number}.png"), picture)
    >>> done = batch(clips, events, fps=100)
    >>> (done.made, done.kept, done.failed, os.path.isfile(os.path.join(events, "first.h5")))
    (1, 0, {}, True)
    >>> batch(clips, events, fps=100).kept
    1
    >>> folder.cleanup()
    """
    work = open_batch(source, dest, config, sets=sets, seed=seed, effects=effects, **options)
    with ExitStack() as stack:
        told = _Told(options, log, stack)
        return work.run(
            jobs=options["jobs"],
            threads=options["threads"],
            engine=_engine(work, options, log),
            begun=told.begun,
            ended=told.ended,
        )


_RECORDED = ("fps", "rotate180", "track")
"""Options of inputs that settings of a batch always hold."""


@takes(BatchOptions)
def open_batch(
    source: str | Path,
    dest: str | Path,
    config: Written | Sequence[Written] | None,
    *,
    sets: Sequence[str],
    seed: int | None,
    effects: Sequence[str | Path],
    **options: Unpack[BatchOptions],
) -> Batch:
    """Find the sequences of a batch; parameters and errors as :func:`batch`."""
    recipe = None
    if options["recipe"] is not None:
        path = Path(options["recipe"])
        recipe = Recipe.read(path)
        others = bool(config or sets) or seed is not None
        options = recipe.asked(path, options, others)  # type: ignore[assignment]
        config, seed = recipe.config, recipe.seed
    given, sets = options, tuple(sets)
    for name in (str(source), str(dest)):
        if "://" in name:
            raise UsageError(
                f"{name}: addresses are not read: mount it as a folder, or copy it (such as by"
                " rclone)"
            )
    size = size_of(options)
    if size is not None:
        sets = (*sets, f"sensor.width={size.width}", f"sensor.height={size.height}")
    format = to_write(Path("a"), options["format"])
    export = _export(options, format)
    if options["with_frames"]:
        check_frames(format)
    # what was made before an option came to be is up to date without it
    usual = declared(AnyFrames, Part, Clock, MotionOptions)
    asked = {
        name: value
        for name, value in options.items()
        if name in usual and name != "size"
        if name in _RECORDED or value != usual[name].default
    }
    asked |= {
        "format": options["format"],
        "with_frames": options["with_frames"] or (export is not None and export.needs_frames),
        "causes": options["causes"],
        **{name: options[name] for name in ("side", "blurred_frames", "strict") if options[name]},
    }
    suffix = next(iter(format.suffixes))
    if options["no_events"]:
        if export is None or not export.has_windows:
            raise UsageError("--no-events is for --export voxel, histogram, surface and picture")
        if options["causes"] or options["with_frames"]:
            raise UsageError("--no-events keeps no --causes and --with-frames: leave them out")
        from adv2e.exporting.layouts import chosen_options  # noqa: PLC0415 - takes its time

        group = EXPORTS[export.kind]
        how = {name: one.default for name, one in declared(group).items()} | export.options()
        asked["streamed"] = {"to": export.kind, **chosen_options(export.kind, how)}
        asked["with_frames"], suffix, export = False, f".{export.kind}", None
    files = tuple(map(str, effects))
    settings = Settings(config, tuple(sets), files, seed, suffix, asked, export, given)
    shard = None if options["shard"] is None else parse_shard(options["shard"])
    return Batch(
        Path(source),
        Path(dest),
        settings,
        layout=options["layout"],
        shard=shard,
        overwrite=options["overwrite"],
        recipe=recipe,
    )


def _export(options: BatchOptions, format: Format) -> Export | None:
    """Return the settings of --export, None without; UsageError if other options do not fit it."""
    kind, window_us, bins = options["export"], options["window_us"], options["bins"]
    for name, value in (("window_us", window_us), ("bins", bins)):
        having = [one for one, group in EXPORTS.items() if name in declared(group)]
        if value is not None and kind not in having:
            flag = declared(BatchOptions)[name].flag_of(name)
            raise UsageError(f"{flag} is for --export {', '.join(having[:-1])} and {having[-1]}")
    if kind is None:
        return None
    export = Export(kind, window_us, bins)
    if export.needs_frames and "w" not in format.frames:
        raise UsageError(
            f"--export {kind} needs frames, and {format.what} holds events alone: leave out"
            " --format"
        )
    return export


def _engine(work: Batch, options: BatchOptions, log: Callable[[str, int], None]) -> Engine | None:
    """Return the Dask cluster that converts; None: processes of this machine."""
    scheduler, threads = options["scheduler"], options["threads"] or 1
    if scheduler is None:
        return None
    from adv2e.batches.cluster import Cluster  # noqa: PLC0415 - dask is an extra

    return Cluster(
        scheduler,
        work.manifest,
        at_most=options["jobs"],
        threads=threads,
        log=lambda text: log(text, 0),
    )


class _Told:
    """The bar over all sequences, and a line for each failure."""

    def __init__(
        self, options: BatchOptions, log: Callable[[str, int], None], stack: ExitStack
    ) -> None:
        self._options, self._log, self._stack = options, log, stack
        self._bar: Any = None

    def begun(self, tasks: list[Task]) -> None:
        self._log(reasons(tasks), 0)
        if self._options["progress"]:
            total = sum(task.state.bytes for task in tasks if task.why)
            self._bar = self._stack.enter_context(
                bars.bar(total=total, unit="B", unit_scale=True, desc="batch")
            )

    def ended(self, task: Task, record: Mapping[str, Any]) -> None:
        if self._bar is not None:
            self._bar.update(task.state.bytes)
        name = shown(task.sequence.name)
        if wrong := error_of(record):
            self._log(f"{name}: {wrong}", 0)
            return
        self._log(f"{name}: {record['events']:,} events", 1)
        for note in [*record["notes"], *record.get("export", {}).get("notes", ())]:
            self._log(f"{name}: {note}", 1)


def _check_apart(wanted: Wanted, sequences: Sequence[Found]) -> None:
    """Raise OutputError if the folder of one sequence would hold what another makes."""
    owners: dict[Path, str] = {}
    for one in sequences:
        for path in filter(None, (wanted.output(one), wanted.export_folder(one))):
            other = owners.setdefault(path, one.name)
            if other != one.name:
                raise OutputError(f"{shown(one.name)}, {shown(other)}: would both make {path}")
    for path, name in owners.items():
        above = next((owners[place] for place in path.parents if place in owners), None)
        if above is not None:
            raise OutputError(
                f"{shown(name)}: its folder would lie in that of {shown(above)}: choose another"
                " --format, such as zip"
            )


def _shares(sequences: int, jobs: int | None, threads: int | None) -> tuple[int, int]:
    threads = threads or default_threads()
    count = max(1, min(jobs or threads, sequences))
    return count, max(1, threads // count)


def _job(task: Task, settings: Settings, wanted: Wanted, threads: int) -> Job:
    config, drawn = settings.family.of(task.seed)
    return Job(
        task.sequence.name,
        str(task.sequence.source),
        str(task.output),
        to_dict(config),
        drawn,
        settings.effect_files,
        dict(settings.options),
        threads,
        settings.export,
        str(wanted.export_folder(task.sequence) or ""),
        task.only_export,
        task.state,
    )


def _record(task: Task, wanted: Wanted, job: Job, found: Mapping[str, Any]) -> dict[str, Any]:
    kept = task.record or {}
    return {
        **{key: value for key, value in kept.items() if not key.startswith("export")},
        "name": task.sequence.name,
        "status": "failed" if "error" in found else "done",
        "source": asdict(task.state),
        "output": task.output.relative_to(wanted.dest).as_posix(),
        "settings": wanted.settings,
        "adv2e": __version__,
        "seed": task.seed,
        "drawn": job.drawn,
        "why": task.why,
        **found,
    }


def error_of(record: Mapping[str, Any]) -> str:
    wrong: str = record.get("error") or record.get("export_error") or ""
    return wrong


def table(outcome: Outcome) -> list[str]:
    """Return a table of the outcome of a batch, in lines for people."""
    count = len(outcome.tasks)
    lines = [
        f"{count} sequences: {outcome.made} made ({outcome.events:,} events), {outcome.kept} kept,"
        f" {len(outcome.failed)} failed"
        + (f", {outcome.passed:,} passed over" if outcome.passed else "")
    ]
    width = max((len(shown(name)) for name in outcome.failed), default=0)
    return lines + [
        f"  {shown(name):{width}}  {shown(error)}" for name, error in outcome.failed.items()
    ]


def reasons(tasks: Sequence[Task]) -> str:
    """Return the numbers of sequences to convert, by reason, and of those kept, as text."""
    count = Counter(task.why or "kept" for task in tasks)
    kept = count.pop("kept", 0)
    told = [f"{number} {why}" for why, number in count.items()]
    return ", ".join([*told, *([f"{kept} kept"] if kept else [])])
