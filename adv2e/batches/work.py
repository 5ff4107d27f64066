"""One conversion of a batch, as any process does it: here, or on another machine."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from adv2e.config import Config, from_dict
from adv2e.config.user_effects import load_effects
from adv2e.errors import Adv2eError, is_for_users, warn
from adv2e.files.staging import Staging, writing
from adv2e.files.states import State, digest_of
from adv2e.formats.registry import to_write
from adv2e.in_python import in_python
from adv2e.process.machine import machine_complaint
from adv2e.side.carrying import places_of


@dataclass(frozen=True)
class Job:
    """One conversion.

    Attributes
    ----------
    name : str
        Of the sequence.
    source, output : str
        Paths.
    config : dict
        The configuration, as :func:`adv2e.config.to_dict` gives it.
    drawn : dict
        Which of its numbers were drawn.
    effect_files : tuple of str
        Effects of the user's own.
    options : dict
        Further arguments of :func:`adv2e.convert`.
    export : Export, optional
        What is made of the events, in `export_folder`.
    only_export : bool
        The events are there.
    state : State, optional
        Of the source when this was planned.
    """

    name: str
    source: str
    output: str
    config: dict[str, Any]
    drawn: dict[str, int | float]
    effect_files: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)
    threads: int = 1
    export: Export | None = None
    export_folder: str = ""
    only_export: bool = False
    state: State | None = None


def config_of(job: Job) -> Config:
    """Return the configuration of a conversion.

    Raises
    ------
    ConfigError, UsageError
        As :func:`adv2e.config.from_dict`; a file of effects is wrong.
    """
    effects = [effect for file in job.effect_files for effect in load_effects(file)]
    return from_dict(job.config, effects=effects)


def do(job: Job) -> dict[str, Any]:
    """Convert and export as a job says; return the record for the manifest.

    That holds ``error`` where nothing was made, and ``export_error`` where only events were.
    """
    found = {} if job.only_export else _reported(job, "error", _convert)
    if job.export is not None and "error" not in found:
        found |= _reported(job, "export_error", _export)
    return found


def _reported(job: Job, error_key: str, work: Callable[[Job], dict[str, Any]]) -> dict[str, Any]:
    try:
        return work(job)
    except Adv2eError as error:
        return {error_key: str(error)}
    except Exception as error:
        if told := machine_complaint(error):
            return {error_key: f"{job.source}: {told}"}
        if isinstance(error, OSError):
            return {error_key: f"{error.filename or job.source}: {error.strerror or error}"}
        return {error_key: f"{job.source}: internal error: {type(error).__name__}: {error}"}


def _convert(job: Job) -> dict[str, Any]:
    from adv2e.conversion.convert import convert_input  # noqa: PLC0415 - in the process

    source, side = digest_of(Path(job.source)), side_of(Path(job.source))
    notes: list[str] = []
    how = dict(job.options)
    streamed = how.pop("streamed", None)
    if streamed is not None:
        from adv2e.exporting.streaming import WindowSink  # noqa: PLC0415 - as above

        how["opening"] = partial(WindowSink, streamed["to"], streamed)
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        made = convert_input(
            *(job.source, job.output, lambda size: config_of(job)),
            log=lambda text: notes.append(in_python(text)),
            doubt=lambda text: warn(in_python(text)),
            overwrite=True,
            take="frames",
            source_sha256=source,
            threads=job.threads,
            **how,
        )
    return {
        "source_sha256": source,
        **({"side": side} if side else {}),
        "sha256": digest_of(Path(job.output)),
        "beside": {path.name: digest_of(path) for path in _beside(job)},
        "events": made.events,
        "frames": made.frames,
        "duration_s": made.duration_s,
        "seconds": round(made.seconds, 3),
        "notes": [*notes, *_told(doubts)],
    }


def side_of(source: Path) -> dict[str, str] | None:
    """Return the SHA-256 of the side data that lie outside a source; None without any."""
    return {str(path): digest_of(path) for path in places_of(source)} or None


def _told(warned: Iterable[warnings.WarningMessage]) -> Iterator[str]:
    """Yield the texts of warnings for users, without those of libraries about our code."""
    return (str(one.message) for one in warned if is_for_users(one.message, one.filename))


def _beside(job: Job) -> Iterator[Path]:
    """Yield the files that lie beside the output, of formats that have no place for all."""
    from adv2e.files.regular import beside as beside_of  # noqa: PLC0415
    from adv2e.formats.causes import beside  # noqa: PLC0415
    from adv2e.formats.writing import SIDE  # noqa: PLC0415

    output = Path(job.output)
    if "streamed" in job.options:
        return
    format = to_write(output, job.options.get("format"))
    if not format.holds_settings:
        yield output.with_name(f"{output.name}.json")
    if job.options.get("causes") and not format.causes:
        yield beside(output)
    if (side := beside_of(output, SIDE)).is_dir():
        yield side


def _export(job: Job) -> dict[str, Any]:
    assert job.export is not None
    doubts: list[str] = []
    made = job.export.make(Path(job.output), Path(job.export_folder), job.threads, doubts.append)
    return {"export": {**made, "notes": doubts}}


Engine = Callable[[Iterable[Job], int], Iterator[tuple[Job, dict[str, Any]]]]
"""Does jobs, so many at a time, and yields each with what :func:`do` returned, as they end.

It asks for the next one when it can begin it.
"""


# ---- Training sets of a batch: an export for each sequence, beside its events.


_VALID_SHARE = 0.2


@dataclass(frozen=True)
class Export:
    """Export of the events of each sequence, as by ``adv2e export``: kind and settings.

    Attributes
    ----------
    kind : str
        One of :data:`adv2e.options.EXPORTS`.
    window_us : int, optional
        Length of the windows [us]; default: for something of each window, from each image to the
        next; else as ``adv2e export`` has it.
    bins : int, optional
        Of time; default: as there.
    """

    kind: str
    window_us: int | None = None
    bins: int | None = None

    @property
    def has_windows(self) -> bool:
        return self.kind in ("voxel", "histogram", "surface", "picture")

    @property
    def is_set(self) -> bool:
        """True for what lies in one folder for all sequences."""
        return self.kind in ("evreal", "rvt", "dsec", "spikingjelly", "nmnist")

    @property
    def needs_frames(self) -> bool:
        if self.has_windows:
            return self.window_us is None
        return self.kind in ("e2vid", "ev-segnet", "evreal", "dsec")

    def place(self, name: str) -> str:
        """Return where the export of a sequence lies below DEST; DataError if it has no class."""
        if not self.is_set:
            return f"{name}.{self.kind}"
        return f"{self.kind}/{self._row(name)[0]}"

    def _row(self, name: str) -> tuple[str, str, str]:
        from adv2e.exporting.layouts import LAYOUTS  # noqa: PLC0415 - takes its time

        place, label, split = LAYOUTS[self.kind].place_of(name, _VALID_SHARE)
        return str(place), label, split

    def described(self) -> dict[str, Any]:
        # what was made before other kinds came is up to date
        bins = 5 if self.bins is None and self.kind in _FIVE else self.bins
        return {**asdict(self), "bins": bins}

    def options(self) -> dict[str, Any]:
        """Return the arguments of :func:`adv2e.export`."""
        given = {"window_us": self.window_us, "bins": self.bins}
        how: dict[str, Any] = {name: one for name, one in given.items() if one is not None}
        if self.kind == "e2vid":  # which ones are for validation, the lists of the batch say
            how["valid"] = 0.0
        if self.has_windows and self.window_us is None:
            how["at"] = "images"
        return how

    def make(
        self, events: Path, folder: Path, threads: int, doubt: Callable[[str], None]
    ) -> dict[str, Any]:
        """Write the export of one file; return its entry in the manifest.

        Raises
        ------
        Adv2eError
            Something is wrong with the file; then nothing is left.
        """
        from adv2e.exporting import export  # noqa: PLC0415 - in the process that converts

        how: dict[str, Any] = {**self.options(), "threads": threads, "doubt": doubt}
        if self.is_set:
            items = export.export_unit(events, folder, self.kind, **how)
        else:
            items = export.export(events, folder, self.kind, overwrite=True, **how).items
        return {**self.described(), "items": items, "sha256": digest_of(folder)}

    def write_lists(self, dest: Path, records: Iterable[Mapping[str, Any]]) -> None:
        """Write the lists of what was exported of all sequences, where there are some."""
        of_kind = [one for one in records if one.get("export", {}).get("kind") == self.kind]
        lists: dict[str, str] = {}
        if self.kind == "e2vid":
            lists = _training_lists(dest.resolve(), of_kind)
        elif self.is_set and of_kind:
            from adv2e.exporting.export import FILES, list_of  # noqa: PLC0415

            rows = [self._row(record["name"]) for record in of_kind]
            lists = {f"{self.kind}/{FILES}": list_of(rows)}
        with Staging(overwrite=True) as staging, writing(dest):
            places = [(staging.file(dest / name), text) for name, text in lists.items()]
            staging.prepare()
            for place, text in places:
                place.write_text(text, "utf-8", newline="")


_FIVE = ("voxel", "ev-segnet", "e2vid")
"""Kinds whose entries tell 5 bins where nothing was asked for."""


def _training_lists(dest: Path, records: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return the lists of exported sequences for training and for validation, by their names.

    The order comes from their seeds, so that sequences that are added later hardly change it.
    """
    files = [(record["seed"], dest / f"{record['name']}.e2vid" / "sequences") for record in records]
    files.sort(key=lambda one: (one[0], str(one[1])))
    held = math.ceil(_VALID_SHARE * len(files))
    return {
        name: "".join(sorted(f"{one}\n" for _, folder in chosen for one in folder.glob("*.h5")))
        for name, chosen in (("e2vid-train.txt", files[held:]), ("e2vid-valid.txt", files[:held]))
    }
