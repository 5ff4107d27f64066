"""A whole batch: find, plan, convert what is missing, and write down what was made from what."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from adv2e import __version__
from adv2e.background import default_threads
from adv2e.batch import processes
from adv2e.batch.exports import Export, write_lists
from adv2e.batch.forecast import forecast
from adv2e.batch.manifest import Manifest, check_alone, manifest_path, read_records
from adv2e.batch.plan import (
    Task,
    Wanted,
    outputs_in_the_way,
    outputs_outside,
    plan,
    seed_of,
    shard_of,
)
from adv2e.batch.sequences import Sequence as Found
from adv2e.batch.sequences import find_sequences
from adv2e.batch.work import Engine, Job
from adv2e.config import Family, load_family, to_dict
from adv2e.config.active_effects import user_sources
from adv2e.config.user_effects import load_effects
from adv2e.conversion.estimate import Estimate
from adv2e.errors import Adv2eError, OutputError
from adv2e.files.names import shown
from adv2e.files.states import digest_of_values, state_of
from adv2e.light.interpolation import network_of


@dataclass(frozen=True)
class Settings:
    """Settings with which all sequences of a batch are converted.

    Attributes
    ----------
    config_files, sets, effect_files : tuple of str
    seed : int, optional
        From which those of the sequences come; default: that of the configuration.
    suffix : str
        Of the files to write; empty: folders.
    options : dict
        Further arguments of :func:`adv2e.convert`.
    export : Export, optional
        What is made of the events.
    """

    config_files: tuple[str, ...]
    sets: tuple[str, ...]
    effect_files: tuple[str, ...]
    seed: int | None
    suffix: str
    options: Mapping[str, Any]
    export: Export | None = None

    @cached_property
    def family(self) -> Family:
        """The configuration for each seed; ConfigError, UsageError if it is wrong."""
        effects = [effect for file in self.effect_files for effect in load_effects(file)]
        return load_family(self.config_files, self.sets, self.seed, effects)

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
    """

    tasks: list[Task]
    failed: dict[str, str]
    events: int
    passed: int = 0

    @property
    def made(self) -> int:
        """Sequences that were converted now."""
        return sum(bool(task.why) for task in self.tasks) - len(self.failed)

    @property
    def kept(self) -> int:
        """Sequences whose files were kept."""
        return sum(not task.why for task in self.tasks)


class Batch:
    """The sequences of a batch, or of one of its shards, and what is to be done with them.

    Parameters
    ----------
    source, dest : Path
        Where sequences are, and where the same tree of events is made.
    settings : Settings
    layout : str
        Which sequences count; see :mod:`adv2e.batch.sequences`.
    shard : (int, int), optional
        (I, N): only the I-th of N parts of about the same size.
    overwrite : bool
        Make all anew, and replace files that others made.

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
    ) -> None:
        self._dest, self._settings, self._overwrite = dest, settings, overwrite
        self._shard = shard
        self._wanted = settings.wanted(dest)
        found = find_sequences(source, layout, leave_out=dest, fps=settings.options.get("fps"))
        self._sequences, self.passed = found.sequences, found.told()
        self._passed = sum(map(len, found.passed.values()))
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
        records = read_records(self._dest)
        tasks = plan(
            self._sequences,
            self._states,
            records,
            self._wanted,
            overwrite=self._overwrite,
        )
        for path in outputs_outside(tasks, self._wanted):
            raise OutputError(f"{shown(path)}: a link leads out of {shown(self._dest)}: remove it")
        strange = outputs_in_the_way(tasks, records, self._wanted)
        if strange and not self._overwrite:
            raise OutputError(
                f"{shown(strange[0])}: exists and was not made by this batch: choose another DEST,"
                " or --overwrite replaces it"
            )
        return tasks

    def forecast(
        self, tasks: Sequence[Task], jobs: int | None, threads: int | None
    ) -> Estimate | None:
        """Return an estimate of the conversion; `jobs` and `threads` as for :meth:`run`."""
        waiting = [task for task in tasks if task.why and not task.only_export]
        count, each = _shares(len(waiting), jobs, threads)

        def job_of(task: Task) -> Job:
            return _job(task, self._settings, self._wanted, each)

        return forecast(waiting, job_of, count)

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
        with Manifest(manifest_path(self._dest, self._shard)) as manifest:
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
            if self._wanted.export is not None and self._wanted.export.kind == "e2vid":
                write_lists(self._dest, read_records(self._dest).values())
        return Outcome(tasks, failed, events, self._passed)


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
    """Return the number of simultaneous conversions, and of threads for each."""
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


def _record(
    task: Task,
    wanted: Wanted,
    job: Job,
    found: Mapping[str, Any],
) -> dict[str, Any]:
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
    """Return the error of a sequence, "" without."""
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
