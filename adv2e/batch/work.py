"""One conversion of a batch, as any process does it: here, or on another machine."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adv2e import __version__
from adv2e.batch.exports import Export
from adv2e.batch.transfer import is_url, through
from adv2e.config import Config, from_dict
from adv2e.config.active_effects import user_sources
from adv2e.config.effect_files import load_effects
from adv2e.errors import Adv2eError, Adv2eWarning, is_for_users
from adv2e.files.states import State, digest_of, digest_of_values
from adv2e.formats.lookup import to_write
from adv2e.light.interpolation import network_of
from adv2e.process.machine import machine_complaint

if TYPE_CHECKING:
    from adv2e.conversion.pipeline import Summary
    from adv2e.conversion.reading import Reading


@dataclass(frozen=True)
class Job:
    """One conversion, or a part of it.

    Attributes
    ----------
    name : str
        Of the sequence.
    source, output : str
        Paths, or URLs.
    config : dict
        The configuration, as :func:`adv2e.config.to_dict` gives it.
    drawn : dict
        Which of its numbers were drawn.
    effect_files : tuple of str
        Effects of the user's own.
    options : dict
        Further arguments of :func:`adv2e.convert`.
    threads : int
    export : Export, optional
        What is made of the events, in `export_folder`.
    only_export : bool
        The events are there.
    state : State, optional
        Of the source when this was planned.
    share : (int, int), optional
        Only the events of that share of the pixels are made, as the part `output`.
    parts : tuple of str
        Those of all shares, which are to be merged; empty: the events are made now.
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
    share: tuple[int, int] | None = None
    parts: tuple[str, ...] = ()


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
    """Do what a job says, and return what the manifest says of it.

    That holds ``error`` where nothing was made, and ``export_error`` where only events were.  Of a
    part there is nothing else to say.
    """
    if is_url(job.source) or is_url(job.output):
        return _reported(job, "error", lambda job: through(job, do))
    if job.share is not None:
        return _reported(job, "error", _make_part)
    found = {} if job.only_export else _reported(job, "error", _convert)
    if job.export is not None and "error" not in found:
        found |= _reported(job, "export_error", _export)
    return found


def _reported(job: Job, error_key: str, work: Callable[[Job], dict[str, Any]]) -> dict[str, Any]:
    """Return the result of `work`, or its error message under `error_key`."""
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


def _make_part(job: Job) -> dict[str, Any]:
    """Make a part, unless it is there, whole, and of the same source and settings."""
    from adv2e.conversion.parts import make_part, told_of_part  # noqa: PLC0415

    assert job.share is not None
    config, path, causes = config_of(job), Path(job.output), bool(job.options.get("causes"))
    key = _key(job, config, digest_of(Path(job.source)), job.share)
    if told_of_part(path, key, causes) is None:
        with _reading(job) as reading, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are told when the parts are merged
            make_part(reading, path, key, job.share, config=config, causes=causes)
    return {}


def _reading(job: Job) -> Reading:
    from adv2e.conversion.reading import READING, Reading  # noqa: PLC0415

    given = {name: value for name, value in job.options.items() if name in READING}
    return Reading(job.source, threads=job.threads, **given)


def _key(job: Job, config: Config, source: str, share: tuple[int, int]) -> str:
    """Return the digest of all that determines the events of a part."""
    network = network_of(config.sampling)
    settings = {key: value for key, value in job.config.items() if key != "max_events"}
    options = {
        key: value for key, value in job.options.items() if key not in ("format", "with_frames")
    }
    return digest_of_values(
        *(__version__, source, settings, options, share),
        *([dict(one) for one in user_sources(config)], network and network.source),
    )


def _convert(job: Job) -> dict[str, Any]:
    source = digest_of(Path(job.source))
    config = config_of(job)
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        made, seconds = _merged(job, config, source) if job.parts else _whole(job, config)
    return {
        "source_sha256": source,
        "sha256": digest_of(Path(job.output)),
        "beside": {path.name: digest_of(path) for path in _beside(job)},
        "events": made.events,
        "frames": made.frames,
        "duration_s": made.duration_s,
        "seconds": round(made.seconds + seconds, 3),
        "notes": [*made.notes, *_told(doubts)],
    }


def _told(warned: Iterable[warnings.WarningMessage]) -> Iterator[str]:
    """Yield the texts of warnings for users, without those of libraries about our code."""
    return (str(one.message) for one in warned if is_for_users(one.message, one.filename))


def _whole(job: Job, config: Config) -> tuple[Summary, float]:
    from adv2e.conversion.convert import convert  # noqa: PLC0415 - in the process that converts

    made = convert(
        *(job.source, job.output, config),
        overwrite=True,
        take="frames",
        threads=job.threads,
        **job.options,
    )
    return made, 0.0


def _merged(job: Job, config: Config, source: str) -> tuple[Summary, float]:
    """Merge the events of all parts; return the summary, and the time that parts took [s]."""
    from adv2e.conversion.parts import merged, read_part  # noqa: PLC0415
    from adv2e.conversion.pipeline import convert_reading  # noqa: PLC0415
    from adv2e.conversion.reading import READING  # noqa: PLC0415

    causes, count = bool(job.options.get("causes")), len(job.parts)
    notes: list[str] = []
    told: list[dict[str, Any]] = [{} for _ in job.parts]
    parts = [
        read_part(Path(path), _key(job, config, source, (k + 1, count)), causes, told[k])
        for k, path in enumerate(job.parts)
    ]
    given = {key: value for key, value in job.options.items() if key not in READING}
    with _reading(job) as reading:
        made = convert_reading(
            *(reading, job.output),
            config=config,
            overwrite=True,
            of_pixels=merged(parts),
            log=notes.append,
            doubt=lambda text: warnings.warn(text, Adv2eWarning, stacklevel=2),
            **given,
        )
    return replace(made, notes=tuple(notes)), sum(one["seconds"] for one in told)


def _beside(job: Job) -> Iterator[Path]:
    """Yield the files that lie beside the output, of formats that have no place for all."""
    from adv2e.formats.causes import beside  # noqa: PLC0415

    output = Path(job.output)
    format = to_write(output, job.options.get("format"))
    if not format.holds_settings:
        yield output.with_name(f"{output.name}.json")
    if job.options.get("causes") and not format.causes:
        yield beside(output)


def _export(job: Job) -> dict[str, Any]:
    assert job.export is not None
    doubts: list[str] = []
    made = job.export.make(Path(job.output), Path(job.export_folder), job.threads, doubts.append)
    return {"export": {**made, "notes": doubts}}


Engine = Callable[[Iterable[Job | None], int], Iterator[tuple[Job, dict[str, Any]]]]
"""Does jobs, so many at a time, and yields each with what :func:`do` returned, as they end.

It asks for the next one when it can begin it.  None: there is none until another one has ended.
"""
